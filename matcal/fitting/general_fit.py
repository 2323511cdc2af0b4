"""Any law fitted to stress-strain curves: least weighted squares over its parameters within their bounds.

Where the stress is linear in all that is fitted, one linear solution is the fit. Else the parameters in which it is not
are tried on a grid within their bounds, the others being solved for, and the best are refined together; the fit that is
reported is lmfit's, from there. Laws with terms are built up term by term, their number chosen by the criterion of
`matcal.fitting.hyperfoam.order_selection`. Source: Newville et al., lmfit, DOI 10.5281/zenodo.598352; Golub & Pereyra,
SIAM J. Numer. Anal. 10 (1973) 413, DOI 10.1137/0710036.
"""

import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, lsq_linear

from matcal.fitting.fit_options import GENERAL_ORDERS
from matcal.fitting.hyperfoam.cross_prediction import alone_sentences, each_alone
from matcal.fitting.hyperfoam.curves import Curve, different_strains, weight_sentence, weighted_model, weighted_stress
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, with_ranges
from matcal.fitting.hyperfoam.order_selection import criterion
from matcal.fitting.hyperfoam.poisson import lateral_residual
from matcal.fitting.hyperfoam.variable_projection import Optimum
from matcal.laws.deformation_modes import push_forward, stacked_second_piola
from matcal.laws.law import Law, expanded, has_terms, scaled, units, vector, with_vector
from matcal.laws.law_stack import LawStack
from touchcal.arrays import Array
from touchcal.errors import NotConverged

_NO_LAW = 1e6  # residual, in scales of the curves, where there is no such law or state
_AT_BOUND = 1e-6  # distance from a bound, over a parameter's size, up to which a parameter lies on it
_GRID, _GRID_OF_TWO, _GRID_OF_THREE = 12, 7, 5  # values of one parameter that are tried, and of each of several
_REFINED, _EVALUATIONS = 2, 100  # starts that are refined, and evaluations of each at most
_ATOMS = np.geomspace(0.4, 16.0, 16)  # exponents of many terms
_STEP = 1e-6  # of a parameter, over its size, for slopes
_NU_GRID = (0.0, 0.2, 0.3, 0.4, 0.45, 0.48, 0.49, 0.499, 0.4999)


@dataclass(frozen=True)
class _Problem:
    curves: tuple[Curve, ...]
    first: Law  # where searches start, scaled to the data
    free: NDArray[np.bool_]  # (K,) truth of each parameter: whether it is fitted
    linear: NDArray[np.bool_]  # (K,) truth of each: whether the stress is linear in it

    @cached_property
    def sizes(self) -> Array:
        """(K,) units of the parameters: moduli are over mu_0 of the first law."""
        return units(self.first)

    @cached_property
    def stress(self) -> Array:
        """(n,) weighted, as measured."""
        return weighted_stress(self.curves)

    @cached_property
    def low(self) -> Array:
        """(K,) bounds."""
        return np.array([p.bounds[0] for p, _ in expanded(self.first)]) / self.sizes

    @cached_property
    def high(self) -> Array:
        return np.array([p.bounds[1] for p, _ in expanded(self.first)]) / self.sizes

    def law(self, theta: Array) -> Law:
        return with_vector(self.first, theta * self.sizes)

    def exists(self, theta: Array) -> bool:
        """Whether a law has these parameters."""
        try:
            self.law(theta)
        except ValueError:
            return False
        return True

    def miss(self, theta: Array) -> Array:
        """Weighted residuals, of lateral strains too where nu is fitted."""
        try:
            law = self.law(theta)
            out = weighted_model(self.curves, law) - self.stress
            out = np.r_[out, lateral_residual(self.curves, law)] if self._sees_lateral else out
        except (ValueError, NotConverged):
            return np.full(self.stress.size, _NO_LAW)
        return np.where(np.isfinite(out), np.clip(out, -_NO_LAW, _NO_LAW), _NO_LAW)

    @cached_property
    def _sees_lateral(self) -> bool:
        return any(free and p.name == "nu" for free, (p, _) in zip(self.free, expanded(self.first), strict=True))


@dataclass(frozen=True)
class _Found:
    law: Law
    cost: float  # weighted mean square residual
    evaluations: int
    errors: Array  # (K,) standard errors, NaN where there is none


def fit_law(curves: Sequence[Curve], kind: type[Law], given: Mapping[str, float], order: int | str = "auto",
            thorough: bool = True, near: Law | None = None) -> Fit:
    """Long-term law of a kind with least weighted mean square residual over `curves`; `given`: parameters that are not
    fitted; order: terms of a law that has them; thorough: each mode alone as well, and lmfit's errors; near: a law of
    the kind from which alone the search begins. ValueError for no curves, or fewer different strains than parameters.
    """
    start, curves = time.process_time(), tuple(curves)
    if not curves:
        raise ValueError("no stress-strain curve to fit: give a uniaxial, biaxial, planar, shear or volumetric file.")
    given = _with_kept_volume(curves, kind, given)
    found, said = _of_orders(curves, kind, given, order, thorough) if near is None else (_from(curves, near, given), [])
    found = _by_lmfit(curves, given, found) if thorough else found
    law, sizes = with_ranges(found.law, curves), units(found.law)
    named = expanded(law)
    loose = np.array([p.name not in given and not _at_bound(value, p.bounds, size)
                      for (p, _), value, size in zip(named, vector(law), sizes, strict=True)])
    kept = [name for (p, name), moves in zip(named, loose, strict=True) if not moves and p.name not in given]
    terms = np.size(getattr(law, law.parameters[0].name)) if has_terms(kind) else order
    alone = each_alone(curves, lambda own: with_ranges(_of_orders(own, kind, given, terms)[0].law, own)
                       ) if thorough else {}
    errors = {name: {"value": float(value), "stderr": float(error) if np.isfinite(error) else None}
              for (_, name), value, error in zip(named, vector(law), found.errors, strict=True)}
    return Fit(law, curves, Optimum(np.zeros(0), np.zeros(0), found.cost, (found.cost,), found.evaluations), (), (),
               alone, (weight_sentence(curves), _sentence(law, given, kept), *said,
                       *alone_sentences(curves, alone, exponents=False)),
               time.process_time() - start, moves=np.eye(loose.size)[:, loose], parameters=errors, given=tuple(given))


def _with_kept_volume(curves: Sequence[Curve], kind: type[Law], given: Mapping[str, float]) -> dict[str, float]:
    """nu = 1/2 of a rubber, unless it was given or a test measures how the volume changes."""
    measured = any(c.experiment.kind == "volumetric" or c.experiment.lateral is not None for c in curves)
    return dict(given) | ({"nu": 0.5} if kind.keeps_volume and "nu" not in given and not measured else {})


def _of_orders(curves: tuple[Curve, ...], kind: type[Law], given: Mapping[str, float], order: int | str,
               thorough: bool = True) -> tuple[_Found, list[str]]:
    different, points = different_strains(curves), sum(c.experiment.value.size for c in curves)
    count = len(kind.parameters) - len(given)
    if count >= different:
        raise ValueError(f"{kind.name} has {count} parameters to fit but there are {different} "
                         "different strains away from rest. Give more data.")
    if not has_terms(kind):
        return _searched(curves, _first(kind, given, 1), given), []
    most = GENERAL_ORDERS[-1 if thorough else -2] if order == "auto" else int(order)
    tried: dict[int, tuple[_Found, float]] = {}
    for n in range(1, most + 1):
        if 2 * n >= different:
            break
        before = tried[n - 1][0].law if n > 1 else None
        found = _searched(curves, _first(kind, given, n), given, before)
        tried[n] = found, criterion(found.cost, 2 * n, points, different)
        if order == "auto" and n > 1 and tried[n][1] > tried[n - 1][1]:
            break
    if order != "auto" and most not in tried:
        raise ValueError(f"order {order} has {2 * most} parameters but there are {different} different strains away "
                         "from rest. Lower the order or give more data.")
    best = min(tried, key=lambda n: tried[n][1]) if order == "auto" else most
    return tried[best][0], ["Terms tried, by relative residual and BIC: "
                            + ", ".join(f"{n}: {row.cost**0.5:.3%}, {bic:.0f}" for n, (row, bic) in tried.items())
                            + f"; {best} taken."]


def _from(curves: tuple[Curve, ...], near: Law, given: Mapping[str, float]) -> _Found:
    problem = _posed(curves, near, given)
    found = _projected(problem, vector(problem.first) / problem.sizes)
    theta = vector(problem.first) / problem.sizes if found is None else found[0]
    return _refined(problem, theta)


def _posed(curves: tuple[Curve, ...], first: Law, given: Mapping[str, float]) -> _Problem:
    first = scaled(first, _stiffness(curves) / first.mu_0_Pa)
    named = expanded(first)
    return _Problem(curves, first, np.array([p.name not in given for p, _ in named]),
                    np.array([p.name in first.linear_parameters for p, _ in named]))


def _first(kind: type[Law], given: Mapping[str, float], terms: int) -> Law:
    """A law of the starts; the exponents of several terms differ."""
    starts = {p.name: given.get(p.name, p.start) for p in kind.parameters}
    if "nu" in starts and starts["nu"] == 0.5 and "nu" not in given:
        starts["nu"] = 0.49
    each = {p.name: starts[p.name] * np.arange(1.0, terms + 1) for p in kind.parameters if p.each_term}
    return kind(**starts | each)


def _searched(curves: tuple[Curve, ...], first: Law, given: Mapping[str, float], before: Law | None = None) -> _Found:
    """Linear solution, or the best of refined starts; `before`: the law of one term fewer."""
    problem = _posed(curves, first, given)
    first = problem.first
    tried = [*_grid(problem, before), *(_atoms(problem) if before is not None else ())]
    starts = [(at, float(np.sum(miss**2))) for at, miss in filter(None, (_projected(problem, t) for t in tried))]
    if not np.any(problem.free & ~problem.linear) and first.incompressible:
        theta, cost = starts[0]
        return _Found(problem.law(theta), cost, 1, _standard_errors(problem, theta, cost))
    refined = [_refined(problem, theta) for theta, _ in sorted(starts, key=lambda s: s[1])[:_REFINED]] or [
        _refined(problem, vector(first) / units(first))]
    return min(refined, key=lambda found: found.cost)


def _stiffness(curves: Sequence[Curve]) -> float:
    """Stress over strain of all curves, Pa: the size of their moduli."""
    strain = np.concatenate([c.experiment.strain - (c.experiment.kind == "volumetric") for c in curves])
    stress = np.concatenate([c.experiment.value for c in curves])
    return float(np.sum(np.abs(strain * stress)) / np.sum(strain**2))


def _grid(problem: _Problem, before: Law | None) -> list[Array]:
    """Vectors (K,) to begin from: a grid over the parameters in which the stress is not linear; of a law with terms,
    those of `before` and each further exponent."""
    start, named = vector(problem.first) / problem.sizes, expanded(problem.first)
    loose = np.flatnonzero(problem.free & ~problem.linear)
    if before is not None:
        known = dict(zip((name for _, name in expanded(before)), vector(before), strict=True))
        for k in loose:
            start[k] = known.get(named[k][1], start[k])
        loose = loose[[named[k][0].each_term for k in loose]][-1:]
    count = {1: _GRID, 2: _GRID_OF_TWO, 3: _GRID_OF_THREE}.get(loose.size, 1)
    values = [_NU_GRID if named[k][0].name == "nu" else _spread(problem.low[k], problem.high[k], count)
              if count > 1 and np.isfinite(problem.high[k]) else [start[k]] for k in loose]
    out = []
    for row in itertools.product(*values):
        theta = start.copy()
        theta[loose] = row
        out.append(theta)
    return out


def _atoms(problem: _Problem) -> list[Array]:
    """A vector (K,) of the exponents at which a sum of many terms with no negative modulus fits best: those of terms
    next to each other as one, the strongest."""
    exponents = np.r_[-_ATOMS[::-1], _ATOMS]
    kind: Any = type(problem.first)
    nu, none = getattr(problem.first, "nu", 0.5), np.zeros(0, dtype=bool)
    single = _Problem(problem.curves, kind(1.0, 2.0, nu), none, none)
    at = np.column_stack([np.ones_like(exponents), exponents, np.full(exponents.size, nu)])
    columns = _models(single, at).T
    usable = np.all(np.isfinite(columns), axis=0)
    size = np.zeros(exponents.size)
    length = np.linalg.norm(columns[:, usable], axis=0)
    size[usable] = lsq_linear(columns[:, usable] / length, problem.stress, (0, np.inf), "bvls").x
    size[size < 1e-9 * size.max()] = 0.0
    groups = np.split(np.arange(exponents.size), np.flatnonzero(size == 0))
    merged = sorted(((size[g].sum(), float(size[g] @ exponents[g] / size[g].sum())) for g in groups if size[g].sum()),
                    reverse=True)
    start, named = vector(problem.first) / problem.sizes, expanded(problem.first)
    terms = [k for k, (p, _) in enumerate(named) if p.each_term and not problem.linear[k]]
    start[terms[:len(merged)]] = [alpha for _, alpha in merged[:len(terms)]]
    return [start]


def _spread(low: float, high: float, count: int) -> Array:
    """Values between bounds, equal ratios where both are positive; never 0, which no exponent may be."""
    if low > 0:
        return np.geomspace(low, high, count + 2)[1:-1]
    return np.linspace(low, high, count + 2 + count % 2)[1:-1]


def _projected(problem: _Problem, theta: Array) -> tuple[Array, Array] | None:
    """theta with the best moduli, and the weighted residuals; None where there is no such law."""
    linear, stress = problem.free & problem.linear, problem.stress
    models = _models(problem, theta + np.vstack([np.zeros(theta.size), np.eye(theta.size)[linear]]))
    columns = (models[1:] - models[0]).T
    if not np.all(np.isfinite(columns)):
        return None
    solutions = [] if np.all(problem.low[linear] == 0) else [np.linalg.lstsq(columns, stress, rcond=None)[0]]
    length = np.linalg.norm(columns, axis=0)
    length[length == 0] = 1.0
    positive = lsq_linear(columns / length, stress, (0, np.inf), "bvls").x / length
    rest = models[0] - columns @ theta[linear] - stress
    for moduli in (*solutions, positive):  # where mu_0 is not positive, the best of no negative modulus
        at = theta.copy()
        at[linear] = moduli
        miss = rest + columns @ moduli if problem.first.incompressible and problem.exists(at) else problem.miss(at)
        if float(np.sum(miss**2)) < _NO_LAW:
            return at, miss
    return None


def _projected_slopes(problem: _Problem, theta: Array, moving: NDArray[np.bool_]) -> Array:
    """(n, q) slopes of the projected residuals by the `moving` parameters: those at fixed moduli, without what moduli
    that are not 0 follow. Source: Kaufman, BIT 15 (1975) 49, DOI 10.1007/BF01932995."""
    linear, one = problem.free & problem.linear, np.eye(theta.size)
    step = np.where(theta[moving] + _STEP > problem.high[moving], -_STEP, _STEP)
    models = _models(problem, theta + np.vstack([
        np.zeros(theta.size), one[linear & (theta != 0)], step[:, None] * one[moving]]))
    slopes = (models[-step.size:] - models[0]).T / step
    space, _ = np.linalg.qr((models[1:-step.size] - models[0]).T)
    return np.nan_to_num(slopes - space @ (space.T @ slopes), posinf=0.0, neginf=0.0)


def _models(problem: _Problem, thetas: Array) -> Array:
    """(D, n) weighted stresses at thetas (D, K); not finite where there is no such law or state."""
    laws = LawStack(problem.first, thetas * problem.sizes)
    out = []
    for curve in problem.curves:
        kind, e = curve.experiment.kind, curve.experiment.strain
        history = stacked_second_piola(laws, kind, e)
        history = history if curve.kernel is None else np.einsum("nm,dmc->dnc", curve.kernel, history)
        out.append(curve.factor * np.sum(push_forward(kind, e) * history, axis=-1) / curve.scale_Pa)
    return np.hstack(out)


def _refined(problem: _Problem, theta: Array) -> _Found:
    projected = problem.first.incompressible and problem.linear.any()  # then the stress is linear in the moduli
    free = problem.free & ~problem.linear if projected else problem.free
    if not free.any():
        return _Found(problem.law(theta), float(np.sum(problem.miss(theta) ** 2)), 1, np.full(theta.size, np.nan))
    low, high = problem.low[free], problem.high[free]
    inside = np.clip(theta[free], np.nextafter(low, high), np.nextafter(high, low))

    def full(values: Array) -> Array:
        out = theta.copy()
        out[free] = values
        return out

    held: dict[bytes, tuple[Array, Array]] = {}

    def moved(values: Array) -> tuple[Array, Array]:
        at = full(values)
        if (key := at.tobytes()) not in held:
            best = _projected(problem, at) if projected else None
            held[key] = (at, problem.miss(at)) if best is None else best
        return held[key]

    slopes: Any = (lambda values: _projected_slopes(problem, moved(values)[0], free)) if projected else "2-point"
    found = least_squares(lambda values: moved(values)[1], inside, slopes, bounds=(low, high), x_scale="jac",
                          xtol=1e-8, ftol=1e-8, gtol=1e-10, max_nfev=_EVALUATIONS)
    at = moved(found.x)[0]
    return _Found(problem.law(at), float(np.sum(found.fun**2)), int(found.nfev), np.full(theta.size, np.nan))


def _by_lmfit(curves: tuple[Curve, ...], given: Mapping[str, float], found: _Found) -> _Found:
    """The fit by lmfit from the best of the search, with its standard errors; a linear one as it is."""
    law, sizes, named = found.law, units(found.law), expanded(found.law)
    problem = _Problem(curves, law, np.array([p.name not in given for p, _ in named]),
                       np.array([p.name in law.linear_parameters for p, _ in named]))
    if not np.any(problem.free & ~problem.linear) and law.incompressible:
        return found
    import lmfit  # takes as long to import as all the rest

    parameters = lmfit.Parameters()
    low, high = (np.where(problem.free, ends, away) for ends, away in ((problem.low, -np.inf), (problem.high, np.inf)))
    for k, (_, name) in enumerate(named):
        value = float(np.clip(vector(law)[k] / sizes[k], low[k], high[k]))
        parameters.add(name, value, vary=bool(problem.free[k]), min=low[k], max=high[k])
    with np.errstate(invalid="ignore", divide="ignore"):  # correlations where nothing is left to explain
        fitted = lmfit.minimize(lambda p: problem.miss(np.array([p[name].value for _, name in named])), parameters,
                                method="least_squares", xtol=1e-12, ftol=1e-14, gtol=1e-14)
    values = [fitted.params[name] for _, name in named]  # pyright: ignore[reportAttributeAccessIssue]
    theta = np.array([v.value for v in values])
    errors = np.array([v.stderr if v.vary and v.stderr else np.nan for v in values]) * sizes
    return _Found(problem.law(theta), float(np.sum(problem.miss(theta) ** 2)),
                  found.evaluations + int(fitted.nfev), errors)  # pyright: ignore[reportAttributeAccessIssue]


def _standard_errors(problem: _Problem, theta: Array, cost: float) -> Array:
    """(K,) of a linear fit: residuals independent and of one size, as lmfit takes them."""
    out, rows = np.full(theta.size, np.nan), np.eye(theta.size)[problem.free]
    slopes = np.stack([problem.miss(theta + row) - problem.miss(theta) for row in rows], axis=-1)
    spare = max(slopes.shape[0] - slopes.shape[1], 1)
    out[problem.free] = np.sqrt(np.diag(np.linalg.pinv(slopes.T @ slopes)) * cost / spare)
    return out * problem.sizes


def _at_bound(value: float, bounds: tuple[float, float], size: float) -> bool:
    return min(abs(value - end) for end in bounds) <= _AT_BOUND * size


def _sentence(law: Law, given: Mapping[str, float], kept: Sequence[str]) -> str:
    said = f"The law is {law.name}, its parameters found by least squares within their bounds"
    said += f", {', '.join(f'{name} = {value:g}' for name, value in given.items())} given" if given else ""
    return said + (f"; {', '.join(kept)} ended on a bound of the search." if kept else ".")
