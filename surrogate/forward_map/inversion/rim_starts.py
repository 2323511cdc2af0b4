"""Where to start from for touches near the rim: foreseen touches, each moved by one damped step to the frame."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from surrogate.forward_map.forward_map import ForwardMap, linearise, place
from surrogate.forward_map.ring_symmetry import fold
from touchcal.arrays import Array, Index
from touchcal.jit import compiled

# Radii, diameters and loads of the foreseen touches; radii are even in log(SOFT - radius), over the disc's.
RADII, DIAMETERS, LOADS, SOFT = 14, 9, 20, 1.06
# Spacing of their angles, rad, most of them in a sector, and those across each of its borders.
ANGLE, MOST_ANGLES, ACROSS = np.pi / 64, 16, 2
# Step of the place, mm, and of log d that the map is nearly linear over, that of g being the spacing of the loads; part
# of a signal's norm that it bends by over one, and the longest step.
PLACE_MM, LOG_D, BENT, LONGEST = 3.0, 0.1, 0.05, 1.5
FORESEEN, FRAMES = 256, 32  # touches foreseen and frames compared at once, to bound the memory


@dataclass(frozen=True, eq=False)
class Foreseen:
    """Touches near the rim in one sector, in order of their loads, and what the map foresees of them."""

    unknown: Array  # (m, 4) as (x, y, log d, g)
    unit: Array  # (4,) unit of steps from them
    norm: Array  # (m,) norm of the signal, V
    axes: NDArray[np.float32]  # (readings, k) orthonormal readings that span all these, to rounding
    direction: NDArray[np.float32]  # (m, k) signal over its squared norm, along the axes
    # (m, 4, 4) root L of the inverse L L' of the damped products of the slopes over the norm
    root: Array
    slope: NDArray[np.float32]  # (m 4, k) slopes by the units over the squared norm, along the axes, times L'
    along: Array  # (m, 4) what the signal itself has of these


def rim_starts(forward: ForwardMap, signal: Array, place_mm: Array, bands: int) -> Array:
    """(n, bands, 4) touches (x, y, log d, g), in each band of loads the one whose signal comes closest to (n, readings)
    by one step, for frames located at places (n, 2)."""
    known, symmetry = _foreseen(forward), forward.correction.rim.symmetry
    _, chosen = fold(symmetry, place(forward.ring, place_mm))
    whole = signal @ forward.correction.rim.fill.T
    folded = (symmetry.readings[chosen] @ whole[..., None])[..., 0].astype(np.float32)
    touch = np.concatenate([_closest(known, folded[i:i + FRAMES], bands) for i in range(0, len(folded), FRAMES)])
    z = (touch[..., 0] + 1j * touch[..., 1]) / symmetry.turn[chosen, None]
    z = np.asarray(np.where(symmetry.mirrored[chosen, None], z.conj(), z), np.complex128)
    return np.concatenate([z.real[..., None], z.imag[..., None], touch[..., 2:]], axis=2)


def _closest(known: Foreseen, signal: NDArray[np.float32], bands: int) -> Array:
    ends = np.cumsum([0, *map(len, np.array_split(np.arange(len(known.norm)), bands))])
    square, seen = np.einsum("nr,nr->n", signal, signal), signal @ known.axes
    toward = seen @ known.slope.T
    best = _least(square, seen @ known.direction.T, toward, known.along, known.norm, ends)
    rows = np.arange(len(signal))[:, None]
    left = toward.reshape(len(signal), -1, 4)[rows, best] - known.along[best]
    step = (known.root[best] @ left[..., None])[..., 0]
    return known.unknown[best] + np.clip(step, -LONGEST, LONGEST) * known.unit


@compiled
def _least(square: NDArray[np.float32], over: NDArray[np.float32], toward: NDArray[np.float32], along: Array,
           norm: Array, ends: Index) -> Index:
    """(n, bands) touch that leaves least of each signal, by its square (n,), what it has of directions (n, m) and of
    slopes (n, m 4)."""
    best = np.zeros((len(square), len(ends) - 1), np.int64)
    for i in range(len(square)):
        for k in range(len(ends) - 1):
            least = np.inf
            for j in range(ends[k], ends[k + 1]):
                left = 1 - 2 * over[i, j]
                for p in range(4):
                    left -= (toward[i, 4 * j + p] - along[j, p]) ** 2
                left = square[i] + left * norm[j] ** 2
                if left < least:
                    least, best[i, k] = left, j
    return best


@lru_cache(maxsize=8)
def _foreseen(forward: ForwardMap) -> Foreseen:
    unknown, spacing = _touches(forward)
    unit = np.array([PLACE_MM, PLACE_MM, LOG_D, spacing])
    parts = [_seen(forward, unknown[i:i + FORESEEN], unit) for i in range(0, len(unknown), FORESEEN)]
    direction, norm, slope, along, root = (np.concatenate(part) for part in zip(*parts, strict=True))
    spanned, axes = np.linalg.eigh(direction.T @ direction + slope.T @ slope)
    axes = axes[:, spanned > np.finfo(np.float32).eps ** 2 * spanned[-1]]
    return Foreseen(unknown, unit, norm, axes.astype(np.float32), (direction / norm[:, None] @ axes).astype(np.float32),
                    root, (slope / np.repeat(norm, 4)[:, None] @ axes).astype(np.float32), along)


def _seen(forward: ForwardMap, unknown: Array, unit: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Direction, norm, slopes times the root of their damped inverse, these along the direction, and that root."""
    found = linearise(forward, unknown, np.zeros((len(unknown), len(forward.strengths))))
    fill = forward.correction.rim.fill
    signal, slope = found.signal_V @ fill.T, np.swapaxes(fill @ found.jacobian, 1, 2)
    norm = np.linalg.norm(signal, axis=1)
    signal, slope = signal / norm[:, None], slope * unit[:, None] / norm[:, None, None]
    root = np.linalg.cholesky(np.linalg.inv(slope @ slope.transpose(0, 2, 1) + BENT**2 * np.eye(4)))
    slope = root.transpose(0, 2, 1) @ slope
    return signal, norm, slope.reshape(-1, slope.shape[2]), (slope @ signal[..., None])[..., 0], root


def _touches(forward: ForwardMap) -> tuple[Array, float]:
    """Touches (m, 4) as (x, y, log d, g) in order of their loads, and the spacing of these."""
    (_, d_lo, f_lo), (reach, d_hi, f_hi) = forward.bounds
    lightest, heaviest = (np.arcsinh(f / (d**2 * forward.p0)) for f, d in ((f_lo, d_hi), (f_hi, d_lo)))
    load = np.linspace(lightest, heaviest, LOADS + 2)[1:-1]
    sector = 2 * np.pi / len(forward.correction.rim.symmetry.turn)
    count = min(max(round(sector / ANGLE), 1), MOST_ANGLES)
    angle = (np.arange(-ACROSS, count + ACROSS) + 0.5) * sector / count
    inner, outer = np.log(SOFT - forward.interior), np.log(SOFT - reach / forward.ring.radius_mm)
    radius = forward.ring.radius_mm * (SOFT - np.exp(np.linspace(inner, outer, RADII)))
    log_d = np.log(np.linspace(d_lo, d_hi, DIAMETERS))
    load, radius, angle, log_d = (grid.ravel() for grid in np.meshgrid(load, radius, angle, log_d, indexing="ij"))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), log_d, load]), float(np.ptp(load)) / LOADS
