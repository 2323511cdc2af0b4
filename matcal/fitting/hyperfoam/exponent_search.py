"""Best moduli and exponents over curves for one nu: the exponents that may be searched, and the bound on the moduli."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from matcal.fitting.hyperfoam.constrained_moduli import MOST, bounded_moduli, within_bounds
from matcal.fitting.hyperfoam.curves import Curve, reached, weighted_design, weighted_stress
from matcal.fitting.hyperfoam.design_table import Table, tabulate
from matcal.fitting.hyperfoam.variable_projection import TOLERANCE, Exponents, Optimum, Solve, least_moduli, minimise
from touchcal.arrays import Array

# largest |exponent| searched, largest |alpha ln lambda| and |alpha beta ln J| that a column may reach
_HIGHEST, _LARGEST_POWER, _LARGEST_VOLUME_POWER = 25.0, 40.0, 200.0
# least exponent where only shear is fitted
_LOWEST_SHEAR = 0.05
# |ln lambda| times the least distance of two exponents: nearer ones look alike over the curves
_LEAST_POWER_GAP = 0.3
# most terms for which the least distance leaves room
_MOST_TERMS = 8
# starts of the search under the bound on the moduli
_BOUNDED_STARTS = 3


@dataclass(frozen=True)
class Problem:
    """Curves with one nu, ready to be searched."""

    # what is fitted
    curves: tuple[Curve, ...]
    # of every term
    nu: float
    # exponents that may be taken
    allowed: Exponents
    # the weighted design on a short basis
    table: Table


def pose(curves: Sequence[Curve], nu: float) -> Problem:
    """The problem of fitting `curves` with one nu."""
    allowed = allowed_exponents(curves, nu)
    return Problem(tuple(curves), nu, allowed, tabulate(curves, nu, (allowed.low, allowed.high)))


def allowed_exponents(curves: Sequence[Curve], nu: float = 0.0) -> Exponents:
    """Exponents searched: |alpha| to 25, but no column beyond e^40, and no two that look alike over the stretches
    reached; positive for shear alone, which is even in each exponent."""
    least, largest = reached(curves)
    reach = max(-least, largest, 1e-3)
    most = min(_HIGHEST, _LARGEST_VOLUME_POWER / max(abs(nu / (1 - 2 * nu)) * _volume_reach(curves), 1e-3))
    shear_alone = {c.experiment.kind for c in curves} == {"shear"}
    low = _LOWEST_SHEAR if shear_alone else -min(most, _LARGEST_POWER / max(-least, 1e-3))
    high = min(most, _LARGEST_POWER / max(largest, 1e-3))
    return Exponents(low, high, min(_LEAST_POWER_GAP / reach, (high - low) / _MOST_TERMS))


def best_law(problem: Problem, order: int, starts: int, more: Sequence[Array] = ()) -> Optimum:
    """Least squares of `order` terms from the best `starts` grid combinations and `more`, with |mu_i| <= MOST mu_0."""
    free = search(problem, order, starts, least_moduli, more)
    if np.abs(free.mu_Pa).max() <= MOST * free.mu_Pa.sum():
        return free
    held = search(problem, order, min(starts, _BOUNDED_STARTS), bounded_moduli, [free.alpha, *more])
    return replace(held, unbounded=(free.cost, float(free.mu_Pa.sum())))


def search(problem: Problem, order: int, starts: int, solve: Solve, more: Sequence[Array] = (),
           tolerance: float = TOLERANCE) -> Optimum:
    """Best of the starts, searched on the table and evaluated with the exact design."""
    table = problem.table
    found = minimise(table.design, table.slope, table.target, order, problem.allowed, starts, solve, more,
                     tolerance, within_bounds if solve is bounded_moduli else None)
    design, stress = weighted_design(problem.curves, found.alpha, problem.nu), weighted_stress(problem.curves)
    mu = solve(design, stress, found.alpha)
    return replace(found, mu_Pa=mu, cost=float(np.sum((design @ mu - stress) ** 2)))


def _volume_reach(curves: Sequence[Curve]) -> float:
    return max((float(np.abs(np.log(c.experiment.strain)).max()) for c in curves
                if c.experiment.kind == "volumetric"), default=0.0)
