"""Where to start from for touches near the rim: foreseen touches, each moved by one damped step to the frame."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from surrogate.forward_map.forward_map import ForwardMap, linearise, place
from surrogate.forward_map.ring_symmetry import fold
from touchcal.arrays import Array

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
    direction: NDArray[np.float32]  # (m, readings) signal over its norm
    norm: Array  # (m,) that norm, V
    slope: NDArray[np.float32]  # (m 4, readings) its slopes by the units over that norm
    along: Array  # (m, 4) these along the direction
    damped: Array  # (m, 4, 4) inverse of the slopes' products, damped


def rim_starts(forward: ForwardMap, signal: Array, place_mm: Array, bands: int) -> Array:
    """(n, bands, 4) touches (x, y, log d, g), in each band of loads the one whose signal comes closest to (n, readings)
    by one step, for frames located at places (n, 2)."""
    known, symmetry = _foreseen(forward), forward.beside.rim.symmetry
    _, chosen = fold(symmetry, place(forward.ring, place_mm))
    folded = (symmetry.readings[chosen] @ (signal @ forward.beside.rim.fill.T)[..., None])[..., 0].astype(np.float32)
    touch = np.concatenate([_closest(known, folded[i:i + FRAMES], bands) for i in range(0, len(folded), FRAMES)])
    z = (touch[..., 0] + 1j * touch[..., 1]) / symmetry.turn[chosen, None]
    z = np.asarray(np.where(symmetry.mirrored[chosen, None], z.conj(), z), np.complex128)
    return np.concatenate([z.real[..., None], z.imag[..., None], touch[..., 2:]], axis=2)


def _closest(known: Foreseen, signal: NDArray[np.float32], bands: int) -> Array:
    n, m = len(signal), len(known.norm)
    over = signal @ known.direction.T / known.norm
    toward = (signal @ known.slope.T).reshape(n, m, 4) / known.norm[:, None] - known.along
    step = (known.damped @ toward[..., None])[..., 0]
    left = np.sum(signal**2, axis=1)[:, None] / known.norm**2 - 2 * over + 1 - np.sum(toward * step, axis=2)
    left *= known.norm**2
    out = np.empty((n, bands, 4))
    for k, group in enumerate(np.array_split(np.arange(m), bands)):
        best = group[left[:, group].argmin(axis=1)]
        out[:, k] = known.unknown[best] + np.clip(step[np.arange(n), best], -LONGEST, LONGEST) * known.unit
    return out


@lru_cache(maxsize=8)
def _foreseen(forward: ForwardMap) -> Foreseen:
    unknown, spacing = _touches(forward)
    unit = np.array([PLACE_MM, PLACE_MM, LOG_D, spacing])
    parts = [_seen(forward, unknown[i:i + FORESEEN], unit) for i in range(0, len(unknown), FORESEEN)]
    direction, norm, slope, along, damped = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Foreseen(unknown, unit, direction, norm, slope, along, damped)


def _seen(forward: ForwardMap, unknown: Array, unit: Array) -> tuple[NDArray[np.float32], Array, NDArray[np.float32],
                                                                     Array, Array]:
    """Direction, norm, slopes, these along the direction, and their damped inverse."""
    found = linearise(forward, unknown)
    fill = forward.beside.rim.fill
    signal, slope = found.signal_V @ fill.T, np.swapaxes(fill @ found.jacobian, 1, 2)
    norm = np.linalg.norm(signal, axis=1)
    signal, slope = signal / norm[:, None], slope * unit[:, None] / norm[:, None, None]
    damped = np.linalg.inv(slope @ slope.transpose(0, 2, 1) + BENT**2 * np.eye(4))
    return (signal.astype(np.float32), norm, slope.reshape(-1, slope.shape[2]).astype(np.float32),
            (slope @ signal[..., None])[..., 0], damped)


def _touches(forward: ForwardMap) -> tuple[Array, float]:
    """Touches (m, 4) as (x, y, log d, g) in order of their loads, and the spacing of these."""
    (_, d_lo, f_lo), (reach, d_hi, f_hi) = forward.bounds
    lightest, heaviest = (np.arcsinh(f / (d**2 * forward.p0)) for f, d in ((f_lo, d_hi), (f_hi, d_lo)))
    load = np.linspace(lightest, heaviest, LOADS + 2)[1:-1]
    sector = 2 * np.pi / len(forward.beside.rim.symmetry.turn)
    count = min(max(round(sector / ANGLE), 1), MOST_ANGLES)
    angle = (np.arange(-ACROSS, count + ACROSS) + 0.5) * sector / count
    inner, outer = np.log(SOFT - forward.interior), np.log(SOFT - reach / forward.ring.radius_mm)
    radius = forward.ring.radius_mm * (SOFT - np.exp(np.linspace(inner, outer, RADII)))
    log_d = np.log(np.linspace(d_lo, d_hi, DIAMETERS))
    load, radius, angle, log_d = (grid.ravel() for grid in np.meshgrid(load, radius, angle, log_d, indexing="ij"))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), log_d, load]), float(np.ptp(load)) / LOADS
