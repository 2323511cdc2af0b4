"""Punches smaller or larger than the trained ones: what a signal allows of them, and whether it asks for one.

Diameters of a training are seldom all that will be met. Outside their range the map is extrapolated, its own error
growing as that of its processes does, and the prior of a punch falls by e with each SOFT of log d. Those that the
signal then allows belong to the intervals of d and F. Where no trained punch is within the profile likelihood's
interval of COVERAGE about the likeliest one of all, a touch is by another punch (a likelihood ratio at an end of the
range: Self, Liang, J. Am. Stat. Assoc. 82 (1987) 605).

A smaller punch presses harder than any trained one under the same force, and there the map errs by more than its
processes state. So the signal is taken to rule it out no more than it does the smallest trained one, and its force is
where the likeliest forces of the trained diameters go on, straight or bent as they are in logarithms.
"""

from functools import lru_cache

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion.diameter_force_posterior import Posterior, Table, make_table, posterior, table_of
from surrogate.forward_map.inversion.multipole_location import Located
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array, Mask

SOFT = 0.5  # log d outside the range over which the prior falls by e
REACH, STEPS = 0.7, 17  # log d up to which punches on either side are tried, and how many
COURSE, FEWEST = 0.2, 3  # log d above the least trained one over which forces go on below it, and fewest diameters


@lru_cache(maxsize=8)
def outside_table(forward: ForwardMap) -> Table | None:
    """The table of smaller and larger punches; None where punches are known, or have one diameter, which teaches
    nothing of others."""
    (d_lo, d_hi), inner = forward.bounds[:, 1], make_table(forward)
    if inner.known or len(inner.d_mm) == 1:
        return None
    off = REACH * (np.arange(STEPS) + 1) / STEPS
    d, log_part = np.r_[d_lo * np.exp(-off), d_hi * np.exp(off)], -np.r_[off, off] / SOFT
    part = np.exp(log_part) / np.exp(log_part).sum()
    return table_of(forward, d, 0, part, log_part + inner.log_diameter.max())


def outside(forward: ForwardMap, located: Located, inner: Posterior) -> Posterior | None:
    """What located touches allow of punches outside the training range, next to those inside."""
    table = outside_table(forward)
    return None if table is None else posterior(table, located, inner)


def asked_for(inner: Posterior, outer: Posterior) -> Mask:
    """(n,) whether no trained punch is a likely one."""
    return inner.deviance - outer.deviance > normal(COVERAGE) ** 2


def smallest(forward: ForwardMap, inner: Posterior) -> Array | None:
    """(n, 2, 2) d, mm, and F, N, of the smallest punch that belongs to the interval of each frame, where the forces go
    on straight and bent, in logarithms, among those of the training; NaN where the least trained one does not."""
    if outside_table(forward) is None:
        return None
    log_d = np.log(inner.table.d_mm / inner.table.d_mm[0])
    near = log_d <= max(COURSE, log_d[min(FEWEST, len(log_d)) - 1])
    powers = np.column_stack([log_d, log_d**2])
    slope, bend = np.linalg.pinv(powers[near]) @ np.log(inner.profile_N / inner.profile_N[:, :1]).T[near]
    left = normal(COVERAGE) ** 2 - (inner.profile[:, 0] - inner.deviance)
    off = -np.clip(np.where(left > 0, left, np.nan) * SOFT / 2, 0.0, REACH)
    log_F = np.log(inner.profile_N[:, :1]) + np.stack([slope * off, slope * off + bend * off**2], axis=1)
    force_N = np.clip(np.exp(log_F), *forward.bounds[:, 2])
    return np.stack(np.broadcast_arrays(inner.table.d_mm[0] * np.exp(off)[:, None], force_N), axis=2)
