"""Hyperfoam law fitted to stress-strain curves: variable projection, order by BIC, nu, stability, cross prediction."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from matcal.fitting.hyperfoam.constrained_moduli import stable_moduli
from matcal.fitting.hyperfoam.cross_prediction import Alone, alone_sentences, each_alone, relative_rms, unstable_within
from matcal.fitting.hyperfoam.curves import (
    Curve,
    different_strains,
    reached,
    weight_sentence,
    weighted_model,
    weighted_stress,
)
from matcal.fitting.hyperfoam.exponent_search import Problem, allowed_exponents, best_law, pose, search
from matcal.fitting.hyperfoam.order_selection import (
    ACCURATE,
    OrderRow,
    chosen_order,
    collinearity,
    criterion,
    order_sentences,
)
from matcal.fitting.hyperfoam.per_term_poisson import refine, with_nu
from matcal.fitting.hyperfoam.poisson import (
    FITTED,
    KEPT_VOLUME,
    NU_BOUNDS,
    PRIOR_NU,
    Poisson,
    checked_poisson,
    nu_sentences,
)
from matcal.fitting.hyperfoam.shared_poisson import best_at_any_nu, with_coarse_nu
from matcal.fitting.hyperfoam.stable_fit import StabilityRows, keeps, search_stable
from matcal.fitting.hyperfoam.variable_projection import Optimum
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import L, Law
from touchcal.errors import NotConverged

__all__ = ["ORDERS", "Alone", "Fit", "allowed_exponents", "fit", "modelled", "quick_law", "relative_rms"]

Array = NDArray[np.float64]
# order -> the problem with its nu, and the best law of that order
_Find = Callable[[int], tuple[Problem, Optimum]]
_Tried = Mapping[int, tuple[Problem, Optimum]]
# rows that must stay positive -> the best law that keeps them so
_Search = Callable[[StabilityRows], Hyperfoam]

ORDERS = (1, 2, 3, 4, 5, 6)
# orders that "auto" always tries; each higher one only while the one before has the least BIC and parameters that can
# be read: beyond that, terms only chase what neighbouring residuals have in common
_ALWAYS = 4
# starts of a search for nu or for a stable law
_FEW = 3
# times the residual of the chosen order up to which one term fewer counts as fitting nearly as well
NEARLY = 1.5
# nu of the first and last term off the shared one, at further starts of a search term by term
_TILT = 0.1
# tensile strain above which a material may be a rubber
_STRETCHED = 1.0


@dataclass(frozen=True)
class Fit:
    """A fitted law and how it was obtained."""

    # long-term law
    law: Any
    # the curves it was fitted to
    curves: tuple[Curve, ...]
    # the search's own result at the chosen order
    optimum: Optimum
    # every order tried
    orders: tuple[OrderRow, ...]
    # laws of one more term and, where it fits nearly as well, of one fewer: what the choice of the order hides
    neighbours: tuple[Hyperfoam, ...]
    # mode -> law of that mode alone; empty with one mode
    alone: Mapping[str, Alone]
    # what was decided, one sentence each
    decisions: tuple[str, ...]
    # CPU seconds of all starts and orders, of the cross predictions too
    cpu_s: float
    # the law without the stability that was asked for; None where none was
    free: Hyperfoam | None = None
    # nu -> mu_0, Pa, of laws that nearly keep their volume, where a stretched material's nu was not fitted
    kept_volume: Mapping[float, float] = field(default_factory=dict)
    # how nu came about: "fit", "fit-each", "given", or "assumed" where nothing was said of it
    nu_how: str = "given"
    # (K, k) directions in the K parameters of `matcal.laws.law.vector` that the search was free to take; None for a
    # hyperfoam, whose exponents say it
    moves: Array | None = None
    # parameter -> {value, stderr} where the search gives it; empty for a hyperfoam
    parameters: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)
    # names of parameters that were given, of a law other than a hyperfoam
    given: tuple[str, ...] = ()
    # law of the same order whose nu is PRIOR_NU more, where nu was assumed: what that hides in modes without a test
    other_nu: Hyperfoam | None = None

    @property
    def sees_lateral(self) -> bool:
        """Whether lateral strains were fitted: nu was, of a hyperfoam or of another law."""
        return self.nu_fitted is not None or (self.moves is not None and "nu" not in self.given)

    @property
    def nu_fitted(self) -> str | None:
        """How nu was fitted, one of `poisson.FITTED`; None where it was not."""
        return self.nu_how if self.nu_how in FITTED else None


def fit(curves: Sequence[Curve], order: int | str = "auto", poisson: Poisson | None = None, starts: int = 8,
        thorough: bool = True, stable: str | None = None, stable_range: tuple[float, float] | None = None) -> Fit:
    """Long-term hyperfoam law with least weighted mean square residual over `curves`.

    order: number of terms 1 to 6, or "auto" (by BIC, see `chosen_order`); poisson: one nu for all terms, one a term
    (increasing alpha), "fit", "fit-each", or None: a foam's 0; thorough: also fit one more term, and each mode alone;
    stable: criterion that the law keeps at all principal stretches within stable_range (by default those that the
    curves drive), the single-mode laws and the neighbours being left free. Raises ValueError for another choice, for no
    curves, or for fewer different strains than parameters; NotConverged where no such stable law is found.
    """
    start = time.process_time()
    curves = tuple(curves)
    orders = _orders(order, curves, poisson)
    choice = checked_poisson(poisson, curves)
    log_range = _log_range(stable_range, curves)
    find, fitted = _finder(choice, curves, starts), choice if isinstance(choice, str) else None
    tried = _tried(find, orders, order == "auto", fitted)
    rows = tuple(_row(problem, optimum, fitted) for problem, optimum in tried.values())
    best = chosen_order(rows)
    problem, found = tried[best.order]
    nu = problem.nu
    law = _law(found, nu, curves)
    if isinstance(choice, tuple) or choice == "fit-each":
        law, found = _term_by_term(problem, choice if isinstance(choice, tuple) else None, found)
    free = law if stable else None
    if stable:
        law, found = _stable_law(problem, stable, log_range, law, found)
    alone = each_alone(curves, lambda own: _law(best_law(pose(own, nu), best.order, max(1, starts // 2)), nu, own)
                       ) if thorough else {}
    decisions = (weight_sentence(curves),
                 *order_sentences(order, rows, best, tried[best.order][1], different_strains(curves)),
                 *alone_sentences(curves, alone), *nu_sentences(law.nu.tolist(), poisson, curves),
                 *_unequal_sentences(law, free, nu, curves, bool(alone)),
                 *_cost_sentences(stable, log_range, law, free, curves))
    near = _neighbours(curves, {} if stable else tried, _finder(choice, curves, max(1, starts // 2)), found, law
                       ) if thorough else ()
    return Fit(law, curves, found, rows, near, alone, decisions, time.process_time() - start, free,
               {} if fitted or not thorough else _kept_volume(curves, best.order),
               fitted or ("assumed" if poisson is None else "given"),
               other_nu=_other_nu(curves, best.order, nu, starts) if thorough and poisson is None else None)


def quick_law(curves: Sequence[Curve], order: int | str, nu: float) -> Hyperfoam:
    """The law alone, from fewer starts, three terms where the order is open: for the shape of a curve on the way."""
    curves = tuple(curves)
    terms = min(3, _orders("auto", curves, nu)[-1]) if order == "auto" else _orders(order, curves, nu)[0]
    return _law(best_law(pose(curves, nu), terms, _FEW), nu, curves)


def modelled(law: Law, curve: Curve) -> Array:
    """Nominal stress of a law along the curve's own history, Pa, (n,)."""
    return curve.model(law)


def _orders(order: int | str, curves: tuple[Curve, ...], poisson: Poisson | None) -> tuple[int, ...]:
    if not curves:
        raise ValueError("no stress-strain curve to fit: give a uniaxial, biaxial, planar, shear or volumetric file.")
    listed = 0 if poisson is None or isinstance(poisson, str) else np.atleast_1d(poisson).size
    if listed > 1 and order not in ("auto", listed):
        raise ValueError(f"poisson lists {listed} values but the order is {order}. Give one value a term.")
    order = listed if listed > 1 else order
    points = different_strains(curves)
    if order == "auto":
        return tuple(n for n in ORDERS if 2 * n < points)
    if order not in ORDERS:
        raise ValueError(f"order '{order}' is unknown; known: auto, {', '.join(map(str, ORDERS))}.")
    if 2 * int(order) >= points:
        raise ValueError(f"order {order} has {2 * int(order)} parameters but there are {points} different strains away "
                         "from rest. Lower the order or give more data.")
    return (int(order),)


def _finder(choice: float | str | tuple[float, ...], curves: tuple[Curve, ...], starts: int) -> _Find:
    """What finds the best law of an order: with nu as given, the mean of a list, or the best one for that order."""
    if isinstance(choice, str):
        coarse = with_coarse_nu(curves)
        return lambda order: best_at_any_nu(coarse, order, starts)
    problem = pose(curves, float(np.mean(choice)))
    return lambda order: (problem, best_law(problem, order, starts))


def _kept_volume(curves: tuple[Curve, ...], order: int) -> dict[float, float]:
    """nu -> mu_0, Pa, at the ends of KEPT_VOLUME, where some curve is stretched like a rubber."""
    far = max((float(c.experiment.strain.max()) for c in curves
               if c.experiment.kind in ("uniaxial", "planar", "biaxial")), default=0.0)
    return {nu: float(best_law(pose(curves, nu), order, _FEW).mu_Pa.sum()) for nu in KEPT_VOLUME if far > _STRETCHED}


def _tried(find: _Find, orders: Sequence[int], auto: bool, fitted: str | None) -> dict[int, tuple[Problem, Optimum]]:
    out: dict[int, tuple[Problem, Optimum]] = {}
    for n in orders:
        if auto and n > _ALWAYS and not _worth_another(out, fitted):
            break
        out[n] = find(n)
    return out


def _worth_another(tried: _Tried, fitted: str | None) -> bool:
    rows = [_row(problem, optimum, fitted) for problem, optimum in tried.values()]
    return min(rows, key=lambda row: row.bic) is rows[-1] and not rows[-1].collinearity


def _term_by_term(problem: Problem, listed: tuple[float, ...] | None, found: Optimum) -> tuple[Hyperfoam, Optimum]:
    """The law with nu term by term, as listed or fitted, from the best laws with one nu."""
    curves, n = problem.curves, found.alpha.size
    if listed is None:
        tilt = np.linspace(-_TILT, _TILT, n) if n > 1 else np.zeros(1)
        shared = _law(found, problem.nu, curves)
        starts, fit_nu = [with_nu(shared, np.clip(problem.nu + t, *NU_BOUNDS)) for t in (0 * tilt, tilt, -tilt)], True
    else:
        others = [best_law(pose(curves, v), n, _FEW) for v in sorted({min(listed), max(listed)})]
        starts, fit_nu = [with_nu(_law(o, problem.nu, curves), listed) for o in (found, *others)], False
    try:
        refined = refine(curves, starts, problem.allowed, fit_nu)
    except NotConverged:  # a stable law has one free stretch, and so have those near it
        held = _stable_law(problem, "drucker", reached(curves), _law(found, problem.nu, curves), found)[0]
        start = with_nu(held, held.nu if listed is None else listed)
        refined = refine(curves, [start], problem.allowed, fit_nu)
    return with_ranges(refined.law, curves), _as_optimum(refined.law, found, refined.evaluations, curves)


def _stable_law(problem: Problem, criterion: str, log_range: tuple[float, float], law: Hyperfoam,
                found: Optimum) -> tuple[Hyperfoam, Optimum]:
    """The best law that keeps `criterion`, searched from the free one."""
    searching = _stable_unequal if np.ptp(law.nu) else _stable_shared
    held = search_stable(criterion, log_range, searching(problem, law))
    if criterion == "elliptic":
        drucker = _drucker_law(log_range, searching, problem, law)
        if drucker is not None and _cost(drucker, problem.curves) < _cost(held, problem.curves):
            anew = search_stable(criterion, log_range, searching(problem, drucker))
            held = min(drucker, anew, key=lambda each: _cost(each, problem.curves))
    return with_ranges(held, problem.curves), _as_optimum(held, found, 0, problem.curves)


def _drucker_law(log_range: tuple[float, float], searching: Callable[[Problem, Hyperfoam], _Search],
                 problem: Problem, law: Hyperfoam) -> Hyperfoam | None:
    """The best Drucker stable law where it is strongly elliptic as well, for no elliptic law may be worse than that;
    None where there is none: neither criterion implies the other."""
    try:
        held = search_stable("drucker", log_range, searching(problem, law))
    except NotConverged:
        return None
    return held if keeps("elliptic", held, log_range) else None


def _stable_shared(problem: Problem, law: Hyperfoam) -> _Search:
    latest = [law]

    def searching(rows: StabilityRows) -> Hyperfoam:
        solve = stable_moduli(lambda alpha: rows(alpha, np.full(alpha.size, problem.nu)))
        optimum = search(problem, law.alpha.size, _FEW, solve, [latest[-1].alpha])
        latest.append(Hyperfoam(optimum.mu_Pa, optimum.alpha, law.nu))
        return latest[-1]

    return searching


def _stable_unequal(problem: Problem, law: Hyperfoam) -> _Search:
    latest = [law]

    def searching(rows: StabilityRows) -> Hyperfoam:
        latest.append(refine(problem.curves, latest[-1:], problem.allowed, False, rows).law)
        return latest[-1]

    return searching


def _as_optimum(law: Hyperfoam, found: Optimum, evaluations: int, curves: tuple[Curve, ...]) -> Optimum:
    cost = _cost(law, curves)
    return replace(found, mu_Pa=law.mu_Pa, alpha=law.alpha, cost=cost, starts=(cost,),
                   evaluations=found.evaluations + evaluations)


def _cost(law: Hyperfoam, curves: tuple[Curve, ...]) -> float:
    """Weighted mean square residual."""
    return float(np.sum((weighted_model(curves, law) - weighted_stress(curves)) ** 2))


def _neighbours(curves: tuple[Curve, ...], tried: _Tried, find: _Find, found: Optimum, law: Hyperfoam
                ) -> tuple[Hyperfoam, ...]:
    """Laws of one more term, and of one fewer that fits nearly as well, with one nu; with nu term by term none."""
    if np.ptp(law.nu):
        return ()
    order, most = found.alpha.size, sum(np.unique(c.experiment.strain).size for c in curves)
    near = [(n, tried.get(n) or find(n)) for n in (order + 1, order - 1) if 0 < 2 * n < most]
    return tuple(_law(optimum, problem.nu, problem.curves) for n, (problem, optimum) in near
                 if n > order or optimum.cost < NEARLY**2 * found.cost)


def _other_nu(curves: tuple[Curve, ...], order: int, nu: float, starts: int) -> Hyperfoam:
    other = nu + PRIOR_NU
    return _law(best_law(pose(curves, other), order, max(1, starts // 2)), other, curves)


def _row(problem: Problem, optimum: Optimum, fitted: str | None) -> OrderRow:
    curves, order = problem.curves, optimum.alpha.size
    merged = collinearity(optimum.mu_Pa, optimum.alpha, problem.allowed.gap)
    bic = criterion(optimum.cost, 2 * order + (fitted is not None), sum(c.experiment.value.size for c in curves),
                    different_strains(curves))
    law = _law(optimum, problem.nu, curves)
    worst = max(relative_rms(law, c) for c in curves)
    return OrderRow(order, float(np.sqrt(optimum.cost)), worst, bic, merged,
                    worst < ACCURATE and "drucker" in unstable_within(law, curves),
                    problem.nu if fitted else None)


def _law(optimum: Optimum, nu: float, curves: tuple[Curve, ...]) -> Hyperfoam:
    return with_ranges(Hyperfoam(optimum.mu_Pa, optimum.alpha, np.full(optimum.alpha.size, nu)), curves)


def with_ranges(law: L, curves: tuple[Curve, ...]) -> L:
    """The law with the strains that curves of each mode cover."""
    ranges: dict[str, tuple[float, float]] = {}
    for curve in curves:
        e, kind = curve.experiment.strain, curve.experiment.kind
        low, high = ranges.get(kind, (np.inf, -np.inf))
        ranges[kind] = (min(low, float(e.min())), max(high, float(e.max())))
    return replace(law, strain_range=ranges)


def _log_range(stable_range: tuple[float, float] | None, curves: tuple[Curve, ...]) -> tuple[float, float]:
    if stable_range is None:
        return reached(curves)
    low, high = stable_range
    if not 0 < low < 1 < high or not np.isfinite(high):
        raise ValueError(f"stable range {low:g} to {high:g}: give two principal stretches, the first between 0 and 1, "
                         "the second above 1, for example 0.3,1.5.")
    return float(np.log(low)), float(np.log(high))


def _unequal_sentences(law: Hyperfoam, free: Hyperfoam | None, nu: float, curves: tuple[Curve, ...],
                       alone: bool) -> list[str]:
    if not np.ptp(law.nu):
        return []
    rms = np.linalg.norm(weighted_model(curves, free or law) - weighted_stress(curves))
    return [f"Orders{' and the laws of single modes' if alone else ''} are those with nu = {nu:.4g} for every term; "
            f"with nu term by term the weighted RMS is {rms:.3%}, moduli and exponents being searched anew."]


def _cost_sentences(stable: str | None, log_range: tuple[float, float], law: Hyperfoam, free: Hyperfoam | None,
                    curves: tuple[Curve, ...]) -> list[str]:
    if stable is None or free is None:
        return []
    low, high = np.exp(log_range)
    costs = ", ".join(f"{c.label} {relative_rms(law, c):.3%} instead of {relative_rms(free, c):.3%}" for c in curves)
    out = [f"The law is held {stable} stable at every combination of principal stretches from {low:.3g} to {high:.3g}, "
           f"and was checked there; relative RMS next to the law without that: {costs}."]
    if stable == "elliptic":
        out.append("Neither criterion implies the other at large stretches: where the best Drucker stable law is not "
                   "strongly elliptic, it may fit better than this one.")
    if stable == "drucker":
        out.append("Drucker stability rejects legitimate foam plateaus, where |lambda P| falls under compression while "
                   "P still rises; strong ellipticity (--stable elliptic) is what a finite element solution needs.")
    return out
