"""What electrodes add to the signal of a touch near them, beyond series and polarization, learned in one half-sector of
the ring."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from surrogate import matern
from surrogate.matern import Matern
from surrogate.polarization import FROM, Effect
from surrogate.ring import Ring
from surrogate.symmetry import Symmetry, filled_from, fold, symmetry_of

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Fewest rows that teach it, and most of them that are kept as nodes, their images across the half-sector not counted.
MIN_ROWS, MAX_ROWS = 60, 2400
# How far across the borders of the half-sector images of rows are kept as nodes, over the disc's radius.
ACROSS = 0.03
# Part of the effect's energy that the kept components may leave out.
LEFT_OUT = 1e-4
# Distances to the rim are felt as log(SOFT - |z|); lengths along it count ALONG times.
SOFT, ALONG = 1.06, 5.0
# Bins of the radius, and of the load in each, in which the error is told.
BINS, LOADS = 8, 3


@dataclass(frozen=True, eq=False)
class RimEffect:
    """effect = strength of the dipole x norm of its pattern x directions @ y(log d, g, place in the half-sector)."""

    symmetry: Symmetry
    # (maps, readings, components) directions of the effect at touches that each map folds
    directions: Array
    process: Matern
    # (bins,) radius over the disc's, (bins, LOADS) load g, and the RMS error of the signal by the other rows, over its
    # norm
    radius: Array
    load: Array
    error: Array
    # (all readings of the ring, readings) all of them by those that frames have
    fill: Array


def none_of(ring: Ring) -> RimEffect:
    """No effect anywhere."""
    identity = Symmetry(np.ones(1, complex), np.zeros(1, bool), np.eye(len(ring.read))[None])
    process = Matern(np.zeros((0, 4)), np.ones(4), np.zeros((0, 0)))
    return RimEffect(identity, np.zeros((1, len(ring.read), 0)), process, np.zeros(0),
                     np.zeros((0, LOADS)), np.zeros((0, LOADS)), np.eye(len(ring.read)))


def learn(ring: Ring, z: Complex, punch: Array, residual: Array, size: Array, norm: Array) -> RimEffect:
    """Learn from places z (n,), (log d, g) (n, 2), what the series leaves (n, readings) of signals of these norms (n,),
    and the dipole's strength times the norm of its pattern (n,); no effect where too few touches lie near the rim."""
    near = np.flatnonzero(np.abs(z) > FROM)
    if len(near) < MIN_ROWS:
        return none_of(ring)
    near = near[np.linspace(0, len(near) - 1, min(len(near), MAX_ROWS)).round().astype(int)]
    symmetry = symmetry_of(ring)
    place, chosen = fold(symmetry, z[near])
    folded = np.einsum("nij,nj->ni", symmetry.readings[chosen], residual[near]) / size[near, None]
    place, of, folded = _with_images(symmetry, place, folded)
    _, values, axes = np.linalg.svd(folded, full_matrices=False)
    left = 1 - np.cumsum(values**2) / np.sum(values**2)
    axes = axes[:int(np.argmax(left < LEFT_OUT)) + 1]
    process, left_out = matern.fit(_inputs(place, punch[near][of]), folded @ axes.T)
    own = left_out[:len(near)] @ axes + folded[:len(near)] - folded[:len(near)] @ axes.T @ axes
    radius, load, error = _by_bin(np.abs(z[near]), punch[near, 1],
                                  np.linalg.norm(own, axis=1) * np.abs(size[near]) / norm[near])
    back = np.asarray(np.linalg.pinv(symmetry.readings, rcond=1e-9), np.float64)
    return RimEffect(symmetry, back @ axes.T, process, radius, load, error, np.eye(len(ring.read)))


def effect(rim: RimEffect, z: Complex, punch: Array) -> Effect:
    """The effect over the dipole's strength and the norm of its pattern, at places z (n,) that it reaches and
    (log d, g) (n, 2)."""
    place, chosen = fold(rim.symmetry, z)
    mean, by_input = matern.predict(rim.process, _inputs(place, punch))
    turn = rim.symmetry.turn[chosen]
    by_y = np.where(rim.symmetry.mirrored[chosen], -1j, 1j) * turn
    along = np.stack([_input_slope(place, turn), _input_slope(place, by_y)], axis=2)
    slope = np.concatenate([np.einsum("nki,nij->nkj", by_input[..., 2:], along), by_input[..., :2]], axis=2)
    directions = rim.directions[chosen]
    return Effect((directions @ mean[..., None])[..., 0], directions @ slope)


def without(rim: RimEffect, ring: Ring, kept: NDArray[np.bool_]) -> RimEffect:
    """The effect on the readings of a ring that are kept."""
    return replace(rim, directions=rim.directions[:, kept], fill=filled_from(ring, kept))


def reaches(rim: RimEffect, z: Complex) -> NDArray[np.bool_]:
    """(n,) whether a touch is close enough to the rim for the effect."""
    return (np.abs(z) > FROM) & (len(rim.process.nodes) > 0)


def error_at(rim: RimEffect, z: Complex, load: Array, interior: float) -> Array:
    """(n,) RMS error of the signal over its norm at places z and loads g (n,), that of the interior where no effect is
    learned."""
    if not len(rim.radius):
        return np.full(len(z), interior)
    loads, errors = (np.column_stack([np.interp(np.abs(z), rim.radius, column) for column in table.T])
                     for table in (rim.load, rim.error))
    error = np.array([np.interp(*one) for one in zip(load, loads, errors, strict=True)])
    return np.where(np.abs(z) > FROM, np.maximum(error, interior), interior)


def _inputs(place: Complex, punch: Array) -> Array:
    radius = np.abs(place)
    return np.column_stack([punch, np.log(SOFT - radius), ALONG * np.angle(place) * radius])


def _input_slope(place: Complex, step: Complex) -> Array:
    """(n, 2) change of the inputs of the place along a step."""
    radius, angle = np.abs(place), np.angle(place)
    forward = step * place.conj() / radius
    return np.column_stack([-forward.real / (SOFT - radius), ALONG * (angle * forward.real + forward.imag)])


def _with_images(symmetry: Symmetry, place: Complex, folded: Array) -> tuple[Complex, NDArray[np.intp], Array]:
    """Rows and their mirror images just across the borders of the half-sector; which row each is of."""
    places, rows, signals = [place], [np.arange(len(place))], [folded]
    for turn, readings in zip(symmetry.turn[symmetry.mirrored], symmetry.readings[symmetry.mirrored], strict=True):
        image = turn * place.conj()
        close = np.flatnonzero((np.abs(image - place) < 2 * ACROSS) & (np.abs(image - place) > 0))
        places.append(image[close])
        rows.append(close)
        signals.append(folded[close] @ readings.T)
    return np.concatenate(places), np.concatenate(rows), np.concatenate(signals)


def _by_bin(radius: Array, load: Array, error: Array) -> tuple[Array, Array, Array]:
    """Mean radius (bins,), mean load and RMS error (bins, LOADS) of rows in bins of equal count."""
    bins = np.array_split(np.argsort(radius), BINS)
    each = [[b[part] for part in np.array_split(np.argsort(load[b]), LOADS)] for b in bins]
    return (np.array([radius[b].mean() for b in bins]), np.array([[load[b].mean() for b in parts] for parts in each]),
            np.array([[np.sqrt(np.mean(error[b] ** 2)) for b in parts] for parts in each]))
