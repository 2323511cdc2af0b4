"""Learning signals near the edge of a disc, or near a straight edge of an outline: the skin's answer, a step, the error
of all, and on a disc what electrodes add."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.edge_frame import edge_frame
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import electrode_correction, multipole_series, polarization, rim_covariance, rim_zone
from surrogate.forward_map.electrode_correction import RimEffect
from surrogate.forward_map.rim_covariance import RimError
from surrogate.forward_map.rim_zone import Zones
from surrogate.forward_map.ring_symmetry import Symmetry
from surrogate.statistics import change_point
from surrogate.statistics.coefficient_process import SharedProcess
from touchcal.arrays import Array, Complex, Index, Mask

BATCH = 256  # rows whose effect is worked out together, to bound the memory
FOLDS = 4  # parts of the touches, each of which shows the error of what the others teach


@dataclass(frozen=True, eq=False)
class Rows:
    """Touches near the rim, and what is to be learned of their signals."""

    z: Complex  # (n,) place over the ring's radius
    punch: Array  # (n, 2) log d and load g
    gap: Array  # (n,) gap to the rim over the radius
    left: Array  # (n, readings) what is left of the signals for the rim: what the series leaves, or the whole, V
    strength: Array  # (n,) size of the strengths, V
    size: Array  # (n,) norm of the signal of a dipole of that strength, V

    def some(self, kept: Mask) -> Rows:
        """Those that are kept."""
        return Rows(*(getattr(self, name)[kept] for name in self.__dataclass_fields__))


@dataclass(frozen=True, eq=False)
class FittedCorrection:
    """What the rim adds to the series, or what takes its place there."""

    polarization: SharedProcess
    rim: RimEffect
    error: RimError
    replaces: bool  # whether it takes the place of the series
    step: float  # gap over the disc's radius where what made the data changes its method; change_point.NONE without


def zero_correction(ring: Ring) -> FittedCorrection:
    """Nothing."""
    rim = electrode_correction.zero_correction(ring)
    return FittedCorrection(polarization.zero_correction(), rim, rim_covariance.zero_correction(rim.symmetry),
                            False, change_point.NONE)


def without(correction: FittedCorrection, ring: Ring, kept: Mask) -> FittedCorrection:
    """The same for the readings of a ring that are kept."""
    return replace(correction, rim=electrode_correction.without(correction.rim, ring, kept),
                   error=rim_covariance.without(correction.error, kept))


def fit(ring: Ring, field: Array, rows: Rows, signal_V: Array, zones: Zones,
        step: float | None = None) -> tuple[FittedCorrection, Array]:
    """Learn from touches and their signals (n, readings), V; the effect of electrodes and an error only where enough of
    them lie near the rim. What the series leaves is learned, or the whole signal where that errs less. step: gap over
    the radius where what made the data changes its method, if that is known. With it the errors (near, readings), V, of
    the touches near the rim, each as the others foresee it; none where nothing is learned."""
    kept = edge_frame(ring, rows.z).radial > zones.learned[0]
    near = rows.some(kept)
    fewest, part = _fewest(_touches(near.z, near.punch)), folds(near.z, near.punch)
    if fewest < _least(ring):
        return zero_correction(ring), np.zeros((0, signal_V.shape[1]))
    answers = fewest >= polarization.MIN_ROWS
    whole = replace(near, left=signal_V[kept])
    replaces = answers and _size(_asked(ring, field, whole, change_point.NONE, answers, part == 0)) < _size(
        _asked(ring, field, near, change_point.NONE, answers, part == 0))
    learned = whole if replaces else near
    _, left = _answer(ring, field, learned, change_point.NONE, answers)
    where = electrode_correction.step_of(ring, near.z, near.punch, near.gap, left,
                                         near.size) if step is None else step
    answer, rim = _both(ring, field, learned, where, answers)
    error = np.empty_like(near.left)
    for k in range(FOLDS):
        asked = part == k
        counts = rim_zone.part_at(edge_frame(ring, near.z[asked]).radial, zones.learned)[:, None]
        error[asked] = (1 - counts) * near.left[asked] / near.size[asked, None] + counts * _asked(
            ring, field, learned, where, answers, asked)
    learned_error = error_of(ring, field, rim.symmetry, near.z, near.punch, near.gap, error)
    return FittedCorrection(answer, rim, learned_error, replaces, where), error * near.size[:, None]


def error_of(ring: Ring, field: Array, symmetry: Symmetry, z: Complex, punch: Array, gap: Array,
             error: Array) -> RimError:
    """From places (n,), (log d, g) (n, 2), gaps (n,) and errors (n, readings) of touches that others foresee, over
    their sizes."""
    if ring.sheet is None:
        return rim_covariance.learned_from(symmetry, z, gap, punch[:, 1], error)
    coefficients, left = np.empty((len(error), polarization.ERROR * (2 * polarization.ERROR + 1))), np.empty_like(error)
    for rows in np.array_split(np.arange(len(error)), len(error) // BATCH + 1):
        fields = multipole_series.electrode_fields(ring, field, z[rows], polarization.ERROR)
        axes = rim_covariance.axes_of(polarization.products(ring, fields, z[rows], punch[rows, 0]))
        coefficients[rows] = (axes.transpose(0, 2, 1) @ error[rows, :, None])[..., 0]
        left[rows] = error[rows] - multipole_series.combined(axes, coefficients[rows])
    return rim_covariance.learned_from_coefficients(symmetry, gap, punch[:, 1], error, coefficients, left)


def folds(z: Complex, punch: Array) -> Index:
    """(n,) which of FOLDS parts each touch at z (n,) by a punch (n, 2) belongs to, all rows of one touch to one."""
    return _touches(z, punch) % FOLDS


def _size(error: Array) -> float:
    """Geometric mean of the norms of errors (n, readings)."""
    return float(np.exp(np.mean(np.log(np.linalg.norm(error, axis=1)))))


def taught(ring: Ring, z: Complex, punch: Array, zones: Zones) -> bool:
    """Whether touches at z (n,) by punches (n, 2) are enough for anything to be learned of the edge."""
    near = edge_frame(ring, z).radial > zones.learned[0]
    return _fewest(_touches(z[near], punch[near])) >= _least(ring)


def _least(ring: Ring) -> int:
    """Fewest touches that teach anything: of a disc what electrodes add, of a straight edge the skin's answer."""
    return electrode_correction.MIN_ROWS if ring.sheet is None else polarization.MIN_ROWS


def teaches(correction: FittedCorrection) -> bool:
    """Whether there is any."""
    return electrode_correction.teaches(correction.rim) or len(correction.polarization.nodes) > 0


def _fewest(touch: Index) -> float:
    """Different touches that teach while one part of them is held out."""
    return (1 - 1 / FOLDS) * len(np.unique(touch))


def _touches(z: Complex, punch: Array) -> Index:
    """(n,) which different touch each row is of; a sweep may solve one with several cards."""
    touches = np.column_stack([z.real, z.imag, punch]).round(9)
    return np.unique(touches, axis=0, return_inverse=True)[1].ravel()


def _both(ring: Ring, field: Array, near: Rows, where: float, answers: bool) -> tuple[SharedProcess, RimEffect]:
    answer, left = _answer(ring, field, near, where, answers)
    if ring.sheet is not None:
        return answer, electrode_correction.zero_correction(ring)
    side = change_point.side(near.gap, where)
    return answer, electrode_correction.fit(ring, near.z, near.punch, side, left, near.size)


def _asked(ring: Ring, field: Array, near: Rows, where: float, answers: bool, part: Mask) -> Array:
    """(asked, readings) errors of what is learned for the rows of a part (n,), over their sizes, by the others."""
    asked = near.some(part)
    answer, rim = _both(ring, field, near.some(~part), where, answers)
    left = _leaves(ring, field, asked, answer, where) / asked.size[:, None]
    if not electrode_correction.teaches(rim):
        return left
    return left - electrode_correction.effect(rim, ring, asked.z, asked.punch,
                                              change_point.side(asked.gap, where)).value


def _answer(ring: Ring, field: Array, near: Rows, where: float, answers: bool) -> tuple[SharedProcess, Array]:
    """The polarization, and what it leaves."""
    if not answers:
        return polarization.zero_correction(), near.left
    side = change_point.side(near.gap, where)
    answer = polarization.fit(ring, field, near.z, near.punch, side, near.left, near.strength, near.size)
    return answer, _leaves(ring, field, near, answer, where)


def _leaves(ring: Ring, field: Array, near: Rows, answer: SharedProcess, where: float) -> Array:
    """(n, readings) what the polarization leaves, V."""
    left, side = near.left.copy(), change_point.side(near.gap, where)
    orders = polarization.orders_of(answer.weights.shape[1]) + 1
    if not len(answer.nodes):
        return left
    for rows in np.array_split(np.arange(len(near.z)), len(near.z) // BATCH + 1):
        fields = multipole_series.electrode_fields(ring, field, near.z[rows], orders)
        effect = polarization.effect(answer, ring, fields, edge_frame(ring, near.z[rows]), near.punch[rows], side[rows])
        left[rows] -= effect.value * near.strength[rows, None]
    return left
