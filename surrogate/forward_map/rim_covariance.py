"""The map's error near an edge: how large it is, and how readings share it, estimated from touches left out.

On a disc readings share it as they do in the half-sector that all touches are folded into. Near straight edges of an
outline, which has no such symmetry, errors lie along products of the fields' series about the punch
(`surrogate.forward_map.polarization`), as the distance to the edge says, and a rest.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from surrogate.forward_map.ring_symmetry import Symmetry, fold
from touchcal.arrays import Array, Complex, Index, Mask

# Bins of the gap between punch and rim, by the part of the rows that lie closer, and of the load in each.
CLOSER, LOADS = (0.02, 0.06, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875), 3
FEWEST = 15  # fewest rows of a bin
# Directions of the error in a bin, and the least part of its square that is believed to lie in none of them.
DIRECTIONS, REST = 16, 0.01


@dataclass(frozen=True, eq=False)
class RimError:
    """Errors of signals, over the size of the signal, in bins of the gap and the load."""

    symmetry: Symmetry
    # (bins,) gap over the disc's radius, (bins, LOADS) load g, and the error, which half the touches stay below
    gap: Array
    load: Array
    error: Array
    # (maps, bins, readings, DIRECTIONS) directions that errors of touches that each map folds share, over the norm of
    # these, and (bins,) what part of its square they leave
    shared: Array
    rest: Array
    # (bins, q, q) root of the covariance of errors of unit norm along the axes of the products of the series; of a disc
    # none
    answer: Array | None = None

    @property
    def directions(self) -> int:
        """Directions that errors of one touch share."""
        return min(self.shared.shape[2:]) if self.answer is None else self.answer.shape[2]

    @cached_property
    def principal(self) -> tuple[Array, Array]:
        """(maps, bins, readings, DIRECTIONS) axes of unit norm of the shared errors, and their standard deviations."""
        axes, sd, _ = np.linalg.svd(self.shared, full_matrices=False)
        return np.asarray(axes, np.float64), np.asarray(sd, np.float64)


def zero_correction(symmetry: Symmetry) -> RimError:
    """No errors but the series'."""
    readings = symmetry.readings.shape[1]
    return RimError(symmetry, np.zeros(0), np.zeros((0, LOADS)), np.zeros((0, LOADS)),
                    np.zeros((len(symmetry.turn), 0, readings, 0)), np.zeros(0))


def learned_from(symmetry: Symmetry, z: Complex, gap: Array, load: Array, error: Array) -> RimError:
    """From places z, gaps and loads g (n,) of touches that the map was not learned from, and the errors (n, readings)
    of their signals over the sizes of these."""
    folded = np.einsum("nij,nj->ni", symmetry.readings[fold(symmetry, z)[1]], error)
    bins, norm = _bins(gap), _norm(error)
    unit = folded / norm[:, None]
    shared, rest = (np.stack(part) for part in zip(*(_shared(unit[b]) for b in bins), strict=True))
    back = np.asarray(np.linalg.pinv(symmetry.readings, rcond=1e-9), np.float64)
    return RimError(symmetry, *_sizes(bins, gap, load, norm), back[:, None] @ shared, rest)


def learned_from_coefficients(symmetry: Symmetry, gap: Array, load: Array, error: Array, coefficients: Array,
                              left: Array) -> RimError:
    """From gaps and loads g (n,) of such touches, their errors (n, readings), these along the axes of the
    products of the series (n, q), and what they leave (n, readings)."""
    bins, norm = _bins(gap), _norm(error)
    unit = coefficients / norm[:, None]
    rest = np.sum(left**2, axis=1) / norm**2
    roots = [np.linalg.svd(unit[b] / np.sqrt(len(b)), full_matrices=False)[1:] for b in bins]
    root = np.zeros((len(bins), unit.shape[1], unit.shape[1]))
    for k, (values, axes) in enumerate(roots):
        root[k, :, :len(values)] = axes.T * values
    silent = np.zeros((len(symmetry.turn), len(bins), error.shape[1], 0))
    return RimError(symmetry, *_sizes(bins, gap, load, norm), silent,
                    np.array([max(float(rest[b].mean()), REST) for b in bins]), root)


def _bins(gap: Array) -> list[Index]:
    return np.split(np.argsort(gap), _ends(len(gap)))


def _norm(error: Array) -> Array:
    return np.maximum(np.linalg.norm(error, axis=1), np.finfo(float).tiny)


def _sizes(bins: list[Index], gap: Array, load: Array, norm: Array) -> tuple[Array, Array, Array]:
    """Mean gaps (bins,), and mean loads and median errors (bins, LOADS)."""
    each = [[b[part] for part in np.array_split(np.argsort(load[b]), LOADS)] for b in bins]
    return (np.array([gap[b].mean() for b in bins]),
            np.array([[load[b].mean() for b in parts] for parts in each]),
            np.array([[np.median(norm[b]) for b in parts] for parts in each]))


def _ends(rows: int) -> list[int]:
    ends = [0]
    for end in np.round(np.multiply(CLOSER, rows)).astype(int).tolist():
        ends += [end] if min(end - ends[-1], rows - end) >= FEWEST else []
    return ends[1:]


def _shared(unit: Array) -> tuple[Array, float]:
    """Principal directions (readings, DIRECTIONS) of errors (n, readings) of unit norm, times their standard
    deviations, and what part of the squared norm they leave."""
    _, values, axes = np.linalg.svd(unit / np.sqrt(len(unit)), full_matrices=False)
    count = min(len(axes), DIRECTIONS)
    kept = np.zeros((DIRECTIONS, unit.shape[1]))
    kept[:count] = values[:count, None] * axes[:count]
    return kept.T, max(float(np.sum(values[count:] ** 2)), REST)


def size_at(of: RimError, gap: Array, load: Array) -> Array:
    """(n,) error of the signal over its size, its median, at gaps and loads g (n,)."""
    loads, errors = (np.column_stack([np.interp(gap, of.gap, column) for column in table.T])
                     for table in (of.load, of.error))
    return np.array([np.interp(*one) for one in zip(load, loads, errors, strict=True)])


def spread(of: RimError, z: Complex, gap: Array) -> tuple[Array, Array, Array]:
    """Where errors at places z (n,) and gaps (n,) lie, over their norm: axes (n, readings, DIRECTIONS) of unit norm and
    standard deviations (n, DIRECTIONS) along them, and the part (n,) of the squared norm that is left."""
    nearest = np.abs(gap[:, None] - of.gap).argmin(axis=1)
    axes, sd = of.principal
    chosen = fold(of.symmetry, z)[1]
    return axes[chosen, nearest], sd[chosen, nearest], of.rest[nearest]


def spread_of_answer(of: RimError, design: Array, gap: Array) -> tuple[Array, Array, Array]:
    """As `spread`, where a touch's signals by the products of the series are `design` (n, readings, q)."""
    assert of.answer is not None
    nearest = np.abs(gap[:, None] - of.gap).argmin(axis=1)
    turn, sd, _ = np.linalg.svd(of.answer[nearest])
    return axes_of(design) @ turn, np.asarray(sd, np.float64), of.rest[nearest]


def axes_of(design: Array) -> Array:
    """(n, readings, q) orthonormal axes of designs (n, readings, q), one after another, each along its column."""
    axes, triangle = np.linalg.qr(design)
    return np.asarray(axes * np.sign(np.einsum("npp->np", triangle))[:, None], np.float64)


def without(of: RimError, kept: Mask) -> RimError:
    """The errors of the readings that are kept, over the size of all."""
    return replace(of, shared=of.shared[:, :, kept])
