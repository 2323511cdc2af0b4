"""One fitted nu for all terms: the least cost at each nu with everything else free, and the best nu of each order.

That profile may have several valleys, and the order and nu trade against each other, so every valley of a coarse grid
is descended in exponents and nu together, the moduli being solved for.
Source: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, DOI 10.1137/0710036 (variable projection).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from matcal.fitting.hyperfoam.curves import Curve, weighted_design, weighted_stress
from matcal.fitting.hyperfoam.exponent_search import Problem, best_law, pose, search
from matcal.fitting.hyperfoam.poisson import NU_BOUNDS, lateral_cost, lateral_residual
from matcal.fitting.hyperfoam.variable_projection import Optimum, exponents, least_moduli
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array

# values of nu tried first, starts at each and the step at which they stop, valleys that are descended
_COARSE, _FEW, _LOOSE, _VALLEYS = 13, 3, 1e-4, 3
# a profile: nodes at first, nodes at most, cost above the least (in units) up to which it is resolved, step between
# nodes in roots of that cost, least distance of two nodes; turns of records and law at most, and the move of a
# correction, in its standard deviations, that ends them
_FIRST, _MOST, _FAR, _STEP, _LEAST_STEP, _TURNS, _STILL = 9, 45, 14.0, 0.8, 1e-6, 6, 0.05
# (records, law) -> the records as that law wants them, and by how many standard deviations one of them moved at most
Settle = Callable[[tuple[Curve, ...], Hyperfoam], tuple[tuple[Curve, ...], float]]


@dataclass(frozen=True)
class Profile:
    """The least cost over everything else at K values of nu."""

    nu: Array  # (K,) increasing
    cost: Array  # (K,) sum of squares of weighted stress and lateral strain
    laws: tuple[Hyperfoam, ...]  # the best law at each
    records: tuple[tuple[Curve, ...], ...]  # the curves as each wants them


@dataclass(frozen=True)
class _Held:
    """The best law with one nu."""

    cost: float
    law: Hyperfoam
    records: tuple[Curve, ...]


def with_coarse_nu(curves: Sequence[Curve]) -> tuple[Problem, ...]:
    """The problem at each coarse nu, for the searches of all orders."""
    return tuple(pose(curves, float(nu)) for nu in np.linspace(*NU_BOUNDS, _COARSE))


def best_at_any_nu(coarse: Sequence[Problem], order: int, starts: int) -> tuple[Problem, Optimum]:
    """The best law of `order` terms over nu within its bounds as well, and the problem with its nu."""
    curves = coarse[0].curves
    found = [search(p, order, _FEW, least_moduli, tolerance=_LOOSE) for p in coarse]
    cost = np.array([o.cost + lateral_of(curves, p.nu) for p, o in zip(coarse, found, strict=True)])
    around = np.r_[np.inf, cost, np.inf]
    valleys = np.flatnonzero((cost <= around[:-2]) & (cost <= around[2:]))
    lowest = valleys[np.argsort(cost[valleys])][:_VALLEYS]
    ends = [_descended(coarse[k], found[k].alpha) for k in lowest]
    _, nu, alpha = min(ends, key=lambda end: end[0])
    problem = pose(curves, nu)
    best = best_law(problem, order, starts, [alpha])
    if best.cost < (1 - 1e-6) * search(problem, order, 0, least_moduli, [alpha]).cost:  # another valley of exponents
        problem = pose(curves, _descended(problem, best.alpha)[1])
        best = best_law(problem, order, starts, [best.alpha])
    return problem, best


def lateral_of(curves: Sequence[Curve], nu: float) -> float:
    """Sum of squares of the lateral strains at one nu for all terms."""
    return lateral_cost(curves, _plain(nu))


def profile(curves: Sequence[Curve], law: Hyperfoam, unit: float, settle: Settle,
            price: Callable[[tuple[Curve, ...]], float]) -> Profile:
    """The profile of the order of `law`, the best one, over all of NU_BOUNDS, with nodes where the cost is within
    `_FAR` units of the least so close that its root changes by `_STEP` between them. Each nu has its own corrections of
    the records, at their `price`: the valley bends with them."""
    order = law.alpha.size
    held: dict[float, _Held] = {}

    def add(nu: float, starts: int, more: Sequence[Array], records: tuple[Curve, ...]) -> None:
        found = best_law(pose(records, nu), order, starts, more)
        for _ in range(_TURNS):
            settled, most = settle(records, _with_nu(law, found, nu))
            if most < _STILL:
                break
            records, found = settled, best_law(pose(settled, nu), order, 0, [found.alpha])
        held[nu] = _Held(found.cost + lateral_of(records, nu) + price(records), _with_nu(law, found, nu), records)

    add(float(law.nu[0]), 0, [law.alpha], tuple(curves))
    for nu in np.linspace(*NU_BOUNDS, _FIRST):
        add(float(nu), 2, [law.alpha], tuple(curves))
    while len(held) < _MOST and (widest := _unresolved(held, unit)) is not None:
        a, b = (held[v] for v in widest)
        add(sum(widest) / 2, 1, [a.law.alpha, b.law.alpha], min(a, b, key=lambda node: node.cost).records)
    nodes = [held[nu] for nu in sorted(held)]
    return Profile(np.array(sorted(held)), np.array([node.cost for node in nodes]), tuple(node.law for node in nodes),
                   tuple(node.records for node in nodes))


def _unresolved(held: dict[float, _Held], unit: float) -> tuple[float, float] | None:
    """The pair of neighbouring nu between which the root of the cost changes most, where that matters; None where none
    is left."""
    nu = np.array(sorted(held))
    cost = np.array([held[v].cost for v in nu])
    least = int(np.argmin(cost))
    root = np.sqrt(np.maximum(cost - cost[least], 0.0) / unit)
    change = np.abs(np.diff(np.where(np.arange(nu.size) < least, -root, root)))
    matters = (np.minimum(root[:-1], root[1:]) ** 2 < _FAR) & (np.diff(nu) > _LEAST_STEP) & (change > _STEP)
    if not matters.any():
        return None
    k = int(np.argmax(np.where(matters, change, -1.0)))
    return float(nu[k]), float(nu[k + 1])


def _descended(problem: Problem, alpha: Array) -> tuple[float, float, Array]:
    """(cost, nu, alpha) at the bottom of the valley in exponents and nu that holds `alpha` and the problem's nu."""
    curves, allowed, target = problem.curves, problem.allowed, weighted_stress(problem.curves)

    def residual(point: Array) -> Array:
        nu, own = float(point[-1]), exponents(point[:-1], allowed)
        matrix = weighted_design(curves, own, nu)
        miss = matrix @ least_moduli(matrix, target, own) - target
        return np.r_[miss, lateral_residual(curves, _plain(nu))]

    order = alpha.size
    lowest = np.r_[allowed.low, np.full(order - 1, allowed.gap), NU_BOUNDS[0]]
    highest = np.r_[allowed.high, np.full(order - 1, allowed.high - allowed.low), NU_BOUNDS[1]]
    start = np.clip(np.r_[np.diff(alpha, prepend=0.0), problem.nu], lowest + 1e-6, highest - 1e-6)
    out: Any = least_squares(residual, start, bounds=(lowest, highest), x_scale="jac", xtol=1e-10, ftol=1e-12,
                             gtol=1e-14, max_nfev=200)
    return 2 * float(out.cost), float(out.x[-1]), exponents(out.x[:-1], allowed)


def _with_nu(law: Hyperfoam, found: Optimum, nu: float) -> Hyperfoam:
    return replace(law, mu_Pa=found.mu_Pa, alpha=found.alpha, nu=np.full(found.alpha.size, nu))


def _plain(nu: float) -> Hyperfoam:
    return Hyperfoam(np.ones(1), np.ones(1), np.full(1, nu))
