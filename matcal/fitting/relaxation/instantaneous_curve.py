"""The instantaneous curve of a relaxation test as columns whose sizes are fitted, so that no hold leans on another.

With a law its curve is cut at the strains that are held, and each piece has its own size: several holds compare their
courses and not their levels, which a small error of the law would pass off as slow relaxation. Without a law the ramp's
own stress shapes the curve, a cubic spline through the origin; a ramp of few samples has no shape of its own, so the
curve is straight between the strains that are held, and what a bent one would change is a doubt.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from matcal.laws.deformation_modes import second_piola
from matcal.laws.law import Law
from touchcal.arrays import Array

_MOST, _EACH = 10, 4  # most free sizes of a spline, and the samples on ramps that each needs
_LEVEL = 0.02  # share of the largest strain within which two holds are at one level


def of_law(law: Law, strain: Array, held: NDArray[np.bool_]) -> Array:
    """(n, K) second Piola-Kirchhoff stress of a law at strains (n,), cut at the K levels that are held; its sum is the
    law's own."""
    sign = _sign(strain)
    travel = sign * strain
    levels = _levels(travel, held)[:-1]
    pieces = [_stress(law, sign * np.minimum(travel, high)) for high in np.r_[levels, np.inf]]
    above = [np.where(travel > low, piece - _stress(law, np.array([sign * low])), 0.0)
             for low, piece in zip(levels, pieces[1:], strict=True)]
    return np.stack([pieces[0], *above], axis=1)


def of_ramp(strain: Array, held: NDArray[np.bool_], samples: NDArray[np.intp]) -> tuple[Array, bool]:
    """(n, K) columns of a curve through the origin at strains (n,), and whether the ramps' `samples` shape it."""
    travel = _sign(strain) * strain
    levels = _levels(travel, held)
    ramp = np.unique(travel[samples][~held[samples] & (travel[samples] > 0)])
    count = min(_MOST, ramp.size // _EACH)
    if count < max(3, levels.size):
        return _straight(travel, levels), False
    inner = np.quantile(ramp, np.linspace(0, 1, count - 1)[1:-1])
    last = float(travel.max())
    knots = np.r_[np.zeros(4), inner, np.full(4, last)]
    return np.asarray(BSpline.design_matrix(np.clip(travel, 0.0, last), knots, 3).toarray())[:, 1:], True


def bent(columns: Array) -> Array:
    """(n, K) straight pieces that rise steeply at first and then ever less, as foams do before they densify."""
    return np.sqrt(np.maximum(columns, 0.0) * columns.max(axis=0))


def runs(held: NDArray[np.bool_], strain: Array) -> list[slice]:
    """The holds, one slice each: neighbours that are held (n,) at one level of strain (n,)."""
    jump = np.abs(np.diff(strain)) > _LEVEL * np.ptp(strain)
    cuts = np.r_[0, np.flatnonzero((held[1:] != held[:-1]) | jump) + 1, held.size]
    return [slice(int(a), int(b)) for a, b in pairwise(cuts) if held[a]]


def _levels(travel: Array, held: NDArray[np.bool_]) -> Array:
    """Strains that are held, from small to large, neighbours at one level taken together at the larger."""
    out: list[float] = []
    for level in sorted(float(travel[run].max()) for run in runs(held, travel)):
        if out and level - out[-1] < _LEVEL * float(travel.max()):
            out[-1] = level
        else:
            out.append(level)
    return np.array(out)


def _straight(travel: Array, levels: Array) -> Array:
    knots = np.r_[0.0, levels[:-1]]
    return np.stack([np.clip(travel, low, high) - low
                     for low, high in zip(knots, np.r_[knots[1:], np.inf], strict=True)], axis=1)


def _stress(law: Law, strain: Array) -> Array:
    return np.asarray(second_piola(law, "uniaxial", strain)[:, 0])


def _sign(strain: Array) -> float:
    return float(np.sign(strain[np.argmax(np.abs(strain))])) or 1.0
