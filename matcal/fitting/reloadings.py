"""What unloading and loading again below the largest strain lose, cycle by cycle, of the whole path of a test."""

from itertools import pairwise

import numpy as np

from matcal.reduction.experiment import StrainPath
from touchcal.arrays import Array

_AGAIN = 0.2  # share of the largest strain that counts as a turn
_POINTS = 50  # strains at which two branches are compared


def lost_by_reloading(path: StrainPath, stress_Pa: Array) -> list[tuple[float, float]]:
    """Work, Pa, that a stress (n,) along the path loses between each unloading and the loading after it, as far as both
    reach on one side of rest, and the work that the measured stress of that loading puts in there."""
    size, out = np.abs(path.strain), []
    for (top, low), (_, again) in list(pairwise(pairwise(_turns(size))))[::2]:
        strain = np.linspace(size[low], min(size[top], size[again]), _POINTS)
        down, up = np.arange(low, top - 1, -1), np.arange(low, again + 1)
        put = np.trapezoid(_at(strain, size[up], np.abs(path.stress_Pa[up])), strain)
        signed = np.sign(path.strain) * stress_Pa
        lost = np.trapezoid(_at(strain, size[up], signed[up]) - _at(strain, size[down], signed[down]), strain)
        if put > 0 and path.strain[top] * path.strain[again] > 0:
            out.append((float(lost), float(put)))
    return out


def _at(strain: Array, of: Array, values: Array) -> Array:
    order = np.argsort(of, kind="stable")
    return np.interp(strain, of[order], values[order])


def _turns(size: Array) -> list[int]:
    """Samples at which strains (n,) turn back by a share of the largest: an upper one first, then lower and upper."""
    least, turns, best, rising = _AGAIN * float(size.max()), [], 0, True
    for k, now in enumerate(size.tolist()):
        if (now > size[best]) == rising:
            best = k
        elif abs(now - size[best]) > least:
            turns.append(best)
            best, rising = k, not rising
    return [*turns, best]
