"""Hyperfoam law fitted to stress-strain curves: variable projection, order by BIC, cross prediction between modes."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from matcal.constrained import stable_moduli
from matcal.curves import Curve, largest_log_stretch, weighted_design, weighted_stress
from matcal.hyperfoam import Hyperfoam
from matcal.orders import OrderRow, chosen_order, confluence, order_sentences
from matcal.tabulated import Table, tabulate
from matcal.varpro import Exponents, Optimum, Solve, least_moduli, minimise

Array = NDArray[np.float64]

ORDERS = (1, 2, 3, 4, 5, 6)
# exponents searched, and the largest |alpha ln lambda| that a column may reach
_LOWEST, _HIGHEST, _LARGEST_POWER = -15.0, 25.0, 40.0
# |ln lambda| times the least distance of two exponents: nearer ones look alike over the curves
_LEAST_POWER_GAP = 0.3
_NU_BOUNDS = (0.0, 0.45)


@dataclass(frozen=True)
class Alone:
    """The law fitted to one mode only, and how it predicts the others; of a lower order where that needs no negative
    mu_0."""

    # fitted law
    law: Hyperfoam
    # mode -> relative RMS there
    relative_rms: Mapping[str, float]


@dataclass(frozen=True)
class Fit:
    """A fitted law and how it was obtained."""

    # long-term law
    law: Hyperfoam
    # the curves it was fitted to
    curves: tuple[Curve, ...]
    # the search's own result at the chosen order
    optimum: Optimum
    # every order tried
    orders: tuple[OrderRow, ...]
    # law of one more term, which shows what the order hides; None where there are too few points for it
    wider: Hyperfoam | None
    # mode -> law of that mode alone; empty with one mode
    alone: Mapping[str, Alone]
    # what was decided, one sentence each
    decisions: tuple[str, ...]
    # CPU seconds of all starts and orders, of the cross predictions too
    cpu_s: float


def fit(curves: Sequence[Curve], order: int | str = "auto", poisson: float | str = 0.0, starts: int = 8,
        thorough: bool = True, stable: str | None = None) -> Fit:
    """Long-term hyperfoam law with least weighted mean square residual over `curves`.

    order: number of terms, or "auto" (1 to 4 by BIC, see `chosen_order`); poisson: one nu for all terms, or "fit";
    thorough: also fit one more term, and each mode alone; stable: criterion that the law keeps over the stretches of
    the curves (the single-mode laws and the wider one are left free). Raises ValueError for another choice, for no
    curves, or for fewer points than parameters.
    """
    start = time.process_time()
    curves = tuple(curves)
    orders = _orders(order, curves)
    nu = _fitted_nu(curves, orders[0] if len(orders) == 1 else 3) if poisson == "fit" else _checked_nu(poisson)
    table = _table(curves, nu)
    solve = stable_moduli(stable, curves, nu) if stable else least_moduli
    tried = {n: _minimise(table, curves, n, nu, starts, solve) for n in orders}
    left_out = [n for n, o in tried.items() if o.mu_Pa.sum() <= 0]
    tried = {n: o for n, o in tried.items() if n not in left_out} or tried
    rows = tuple(_row(curves, optimum) for optimum in tried.values())
    best = chosen_order(rows)
    free = _minimise(table, curves, best.order, nu, starts) if stable else None
    decisions = (*order_sentences(order, rows, best), *_mode_sentences(curves), *_cost_sentences(stable, best, free),
                 _nu_sentence(nu, poisson), *(f"Order {n} was left out: its mu_0 is not positive." for n in left_out))
    return Fit(_law(tried[best.order], nu, curves), curves, tried[best.order], rows,
               _wider(table, curves, {} if stable else tried, best.order + 1, nu, starts) if thorough else None,
               _alone(curves, best.order, nu, starts) if thorough else {}, decisions,
               time.process_time() - start)


def quick_law(curves: Sequence[Curve], order: int | str, nu: float) -> Hyperfoam:
    """The law alone, from fewer starts, three terms where the order is open: for the shape of a curve on the way."""
    curves = tuple(curves)
    terms = min(3, _orders("auto", curves)[-1]) if order == "auto" else _orders(order, curves)[0]
    return _law(_minimise(_table(curves, nu), curves, terms, nu, 3), nu, curves)


def modelled(law: Hyperfoam, curve: Curve) -> Array:
    """Nominal stress of a law along the curve's own history, Pa, (n,)."""
    return curve.model(law)


def relative_rms(law: Hyperfoam, curve: Curve) -> float:
    """rms(residual)/rms(stress) of a law on a curve."""
    stress = curve.experiment.value
    return float(np.sqrt(np.mean((stress - modelled(law, curve))**2) / np.mean(stress**2)))


def allowed_exponents(curves: Sequence[Curve]) -> Exponents:
    """Exponents searched: wide, but no column beyond e^40, and no two that look alike over the stretches reached;
    positive for shear alone, which is even in each exponent."""
    reach = max(largest_log_stretch(curves), 1e-3)
    low = 0.05 if {c.experiment.kind for c in curves} == {"shear"} else max(_LOWEST, -_LARGEST_POWER / reach)
    high = min(_HIGHEST, _LARGEST_POWER / reach)
    return Exponents(low, high, min(_LEAST_POWER_GAP / reach, (high - low) / 8))


def _orders(order: int | str, curves: tuple[Curve, ...]) -> tuple[int, ...]:
    if not curves:
        raise ValueError("no stress-strain curve to fit: give a uniaxial, biaxial, planar, shear or volumetric file.")
    points = sum(c.experiment.value.size for c in curves)
    if order == "auto":
        return tuple(n for n in ORDERS if 2 * n < points)
    if order not in ORDERS:
        raise ValueError(f"order '{order}' is unknown; known: auto, {', '.join(map(str, ORDERS))}.")
    if 2 * int(order) >= points:
        raise ValueError(f"order {order} has {2 * int(order)} parameters but there are {points} points. "
                         "Lower the order or give more data.")
    return (int(order),)


def _checked_nu(poisson: float | str) -> float:
    nu = float(poisson)
    if not -1 < nu < 0.5:
        raise ValueError(f"poisson {nu:g} must lie between -1 and 0.5, or be 'fit'.")
    return nu


def _table(curves: tuple[Curve, ...], nu: float) -> Table:
    allowed = allowed_exponents(curves)
    return tabulate(curves, nu, (allowed.low, allowed.high))


def _minimise(table: Table, curves: tuple[Curve, ...], order: int, nu: float, starts: int,
              solve: Solve = least_moduli) -> Optimum:
    """Best of the starts, searched on the table and evaluated with the exact design."""
    found = minimise(table.design, table.slope, table.target, order, allowed_exponents(curves), starts, solve)
    design, stress = weighted_design(curves, found.alpha, nu), weighted_stress(curves)
    mu = solve(design, stress, found.alpha)
    return replace(found, mu_Pa=mu, cost=float(np.sum((design @ mu - stress) ** 2)))


def _wider(table: Table, curves: tuple[Curve, ...], tried: Mapping[int, Optimum], order: int, nu: float,
           starts: int) -> Hyperfoam | None:
    if 2 * order >= sum(c.experiment.value.size for c in curves):
        return None
    optimum = tried.get(order) or _minimise(table, curves, order, nu, max(1, starts // 2))
    return _law(optimum, nu, curves) if optimum.mu_Pa.sum() > 0 else None


def _fitted_nu(curves: tuple[Curve, ...], order: int) -> float:
    if not {c.experiment.kind for c in curves} - {"shear"}:
        raise ValueError("poisson 'fit' needs another mode than shear, which does not depend on nu. Give a value.")

    def cost(nu: float) -> float:
        return _minimise(_table(curves, nu), curves, order, nu, 2).cost

    found = minimize_scalar(cost, bounds=_NU_BOUNDS, method="bounded", options={"xatol": 1e-4})
    return float(found.x)  # pyright: ignore[reportAttributeAccessIssue]


def _row(curves: tuple[Curve, ...], optimum: Optimum) -> OrderRow:
    n = sum(c.experiment.value.size for c in curves)
    order = optimum.alpha.size
    merged = confluence(optimum.mu_Pa, optimum.alpha, allowed_exponents(curves).gap)
    bic = n * np.log(optimum.cost) + 2 * order * np.log(n)
    return OrderRow(order, float(np.sqrt(optimum.cost)), float(bic), merged)


def _law(optimum: Optimum, nu: float, curves: tuple[Curve, ...]) -> Hyperfoam:
    if optimum.mu_Pa.sum() <= 0:
        names = ", ".join(s for c in curves for s in c.experiment.source)
        raise ValueError(f"the best law of order {optimum.mu_Pa.size} has mu_0 = {optimum.mu_Pa.sum():.4g} Pa, which "
                         f"is no material: {names} may begin with a toe. Cut the toe off, or lower the order.")
    ranges: dict[str, tuple[float, float]] = {}
    for curve in curves:
        e, kind = curve.experiment.strain, curve.experiment.kind
        low, high = ranges.get(kind, (np.inf, -np.inf))
        ranges[kind] = (min(low, float(e.min())), max(high, float(e.max())))
    return Hyperfoam(optimum.mu_Pa, optimum.alpha, np.full(optimum.alpha.size, nu), "longterm", ranges)


def _alone(curves: tuple[Curve, ...], order: int, nu: float, starts: int) -> dict[str, Alone]:
    kinds = list(dict.fromkeys(c.experiment.kind for c in curves))
    out: dict[str, Alone] = {}
    for kind in kinds if len(kinds) > 1 else []:
        own = tuple(c for c in curves if c.experiment.kind == kind)
        table = _table(own, nu)
        tried = (_minimise(table, own, n, nu, starts) for n in range(order, 0, -1))
        if (optimum := next((o for o in tried if o.mu_Pa.sum() > 0), None)) is not None:
            law = _law(optimum, nu, own)
            out[kind] = Alone(law, {k: _rms_in(law, curves, k) for k in kinds})
    return out


def _rms_in(law: Hyperfoam, curves: tuple[Curve, ...], kind: str) -> float:
    squares = [relative_rms(law, c) ** 2 for c in curves if c.experiment.kind == kind]
    return float(np.sqrt(np.mean(squares)))


def _cost_sentences(stable: str | None, chosen: OrderRow, free: Optimum | None) -> list[str]:
    if stable is None or free is None:
        return []
    return [f"The law is held {stable} stable over the stretches of the curves: weighted relative RMS {chosen.rms:.3%} "
            f"instead of {np.sqrt(free.cost):.3%} without that."]


def _nu_sentence(nu: float, poisson: float | str) -> str:
    if poisson != "fit":
        return f"nu = {nu:.4g} for every term, as given."
    bound = min(abs(nu - end) for end in _NU_BOUNDS) < 1e-3
    return f"nu = {nu:.4g} for every term, fitted" + (", at the bound of its search: do not read it." if bound else ".")


def _mode_sentences(curves: tuple[Curve, ...]) -> list[str]:
    kinds = {c.experiment.kind for c in curves}
    if kinds == {"shear"}:
        return ["Shear alone is even in each exponent: their signs are taken as positive, not measured."]
    if len(kinds) == 1:
        return [f"Only {kinds.pop()} was fitted: other modes are extrapolated and may be far off."]
    return []
