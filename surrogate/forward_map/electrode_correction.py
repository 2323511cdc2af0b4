"""What electrodes add to the signal of a touch near them that series and polarization lack, by one half-sector."""

from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map.polarization import Effect, half_width, log_gap
from surrogate.forward_map.ring_symmetry import Symmetry, filled_from, fold, symmetry_of
from surrogate.statistics import change_point, matern_process
from surrogate.statistics.gaussian_process import spread_evenly
from surrogate.statistics.matern_process import Matern
from touchcal.arrays import Array, Complex, Index, Mask

# Fewest rows that teach it, and most of them that are kept as nodes, their images across the half-sector not counted.
MIN_ROWS, MAX_ROWS = 60, 2400
# How far across the borders of the half-sector images of rows are kept as nodes, over the disc's radius.
ACROSS = 0.03
LEFT_OUT = 1e-4  # part of the effect's energy that the kept components may leave out
# Distances of the centre to the rim are felt as log(SOFT - |z|), next to the punch's own gap; lengths along it count
# ALONG times.
SOFT, ALONG = 1.06, 5.0
# Inputs that distinguish a step along the gap from what changes fast with them: all before the gap itself.
OF_STEP = 4


@dataclass(frozen=True, eq=False)
class RimEffect:
    """effect = size of the strengths x norm of the dipole's pattern x directions @ y(log d, g, place in the
    half-sector, gap, side of the step)."""

    symmetry: Symmetry
    directions: Array  # (maps, readings, components) directions of the effect at touches that each map folds
    process: Matern
    whole: Ring  # the ring with all readings, whose patterns' norms the effect is over
    fill: Array  # (all readings of the ring, readings) all of them by those that frames have


def zero_correction(ring: Ring) -> RimEffect:
    """No effect anywhere."""
    identity = Symmetry(np.ones(1, complex), np.zeros(1, bool), np.eye(len(ring.read))[None])
    process = Matern(np.zeros((0, 6)), np.ones(6), np.zeros((0, 0)))
    return RimEffect(identity, np.zeros((1, len(ring.read), 0)), process, ring, np.eye(len(ring.read)))


def fit(ring: Ring, z: Complex, punch: Array, side: Array, residual: Array, size: Array) -> RimEffect:
    """Learn from places z (n,), (log d, g) (n, 2), sides of the step (n,), what the series leaves (n, readings) of
    signals, and the size of the strengths times the norm of the dipole's pattern (n,)."""
    near = spread_evenly(len(z), MAX_ROWS)
    symmetry = symmetry_of(ring)
    place, folded = _folded(symmetry, z[near], residual[near] / size[near, None])
    place, of, folded = _with_images(symmetry, place, folded)
    axes = _axes(folded)
    process = matern_process.fit(_inputs(ring, place, punch[near][of], side[near][of]), folded @ axes.T)
    back = np.asarray(np.linalg.pinv(symmetry.readings, rcond=1e-9), np.float64)
    return RimEffect(symmetry, back @ axes.T, process, ring, np.eye(len(ring.read)))


def step_of(ring: Ring, z: Complex, punch: Array, gap: Array, residual: Array, size: Array) -> float:
    """Gap, among those (n,) of the touches, at which what made the data changes its method; NONE where none is seen."""
    near = spread_evenly(len(z), MAX_ROWS)
    place, folded = _folded(symmetry_of(ring), z[near], residual[near] / size[near, None])
    inputs = _inputs(ring, place, punch[near], np.zeros(len(near)))[:, :OF_STEP]
    quantities = folded @ _axes(folded).T
    lengths, noise = matern_process.hyperparameters(inputs, quantities)
    return change_point.locate(inputs / lengths, quantities[:, :matern_process.MAX_QUANTITIES], gap[near], noise)


def _folded(symmetry: Symmetry, z: Complex, signal: Array) -> tuple[Complex, Array]:
    place, chosen = fold(symmetry, z)
    return place, np.einsum("nij,nj->ni", symmetry.readings[chosen], signal)


def _axes(folded: Array) -> Array:
    """(components, readings) directions that leave out at most LEFT_OUT of the energy."""
    _, values, axes = np.linalg.svd(folded, full_matrices=False)
    left = 1 - np.cumsum(values**2) / np.sum(values**2)
    return axes[:int(np.argmax(left < LEFT_OUT)) + 1]


def effect(rim: RimEffect, ring: Ring, z: Complex, punch: Array, side: Array,
           dipole: tuple[Array, Array] | None = None) -> Effect:
    """The effect over the size of the strengths, at places z (n,) that it reaches, (log d, g) (n, 2) and sides of the
    step (n,), where the dipole's pattern has these norms (n,) and slopes (n, 2) of them; over that norm without."""
    place, chosen = fold(rim.symmetry, z)
    mean, by_input = matern_process.predict(rim.process, _inputs(ring, place, punch, side), OF_STEP + 1)
    half = half_width(ring, punch[:, 0])
    felt = log_gap(np.abs(place), half)[1]
    turn = rim.symmetry.turn[chosen]
    by_y = np.where(rim.symmetry.mirrored[chosen], -1j, 1j) * turn
    along = np.stack([_input_slope(place, felt, turn), _input_slope(place, felt, by_y)], axis=2)
    whole = np.concatenate([mean[..., None], by_input[..., 2:5] @ along, by_input[..., :2]], axis=2)
    whole[..., 3] -= by_input[..., 4] * (felt * half)[:, None]
    if dipole is not None:
        whole *= dipole[0][:, None, None]
        whole[..., 1:3] += mean[..., None] * dipole[1][:, None]
    parts = np.empty((len(place), rim.directions.shape[1], 5))
    for one in np.unique(chosen):  # so that no directions are copied
        rows = chosen == one
        parts[rows] = rim.directions[one] @ whole[rows]
    return Effect(parts)


def without(rim: RimEffect, ring: Ring, kept: Mask) -> RimEffect:
    """The effect on the readings of a ring that are kept."""
    return replace(rim, directions=rim.directions[:, kept], fill=filled_from(ring, kept))


def teaches(rim: RimEffect) -> bool:
    """Whether there is an effect."""
    return len(rim.process.nodes) > 0


def _inputs(ring: Ring, place: Complex, punch: Array, side: Array) -> Array:
    radius, gap = np.abs(place), log_gap(np.abs(place), half_width(ring, punch[:, 0]))[0]
    return np.column_stack([punch, np.log(SOFT - radius), ALONG * np.angle(place) * radius, gap, side])


def _input_slope(place: Complex, felt: Array, step: Complex) -> Array:
    """(n, 3) change of the inputs of the place along a step, where the gap is felt (n,)."""
    radius, angle = np.abs(place), np.angle(place)
    forward = step * place.conj() / radius
    return np.column_stack([-forward.real / (SOFT - radius), ALONG * (angle * forward.real + forward.imag),
                            -felt * forward.real])


def _with_images(symmetry: Symmetry, place: Complex, folded: Array) -> tuple[Complex, Index, Array]:
    """Rows with their mirror images just across the borders of the half-sector, and which row each is of."""
    places, rows, signals = [place], [np.arange(len(place))], [folded]
    for turn, readings in zip(symmetry.turn[symmetry.mirrored], symmetry.readings[symmetry.mirrored], strict=True):
        image = turn * place.conj()
        close = np.flatnonzero((np.abs(image - place) < 2 * ACROSS) & (np.abs(image - place) > 0))
        places.append(image[close])
        rows.append(close)
        signals.append(folded[close] @ readings.T)
    return np.concatenate(places), np.concatenate(rows), np.concatenate(signals)
