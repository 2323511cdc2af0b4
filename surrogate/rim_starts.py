"""Where to start from for touches near the rim: the most alike of a few touches that the forward map foresees."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from surrogate.forward_map import INTERIOR, ForwardMap, linearise

Array = NDArray[np.float64]

# Radii, angles within a half-sector, diameters and loads of the foreseen touches.
RADII, ANGLES, DIAMETERS, LOADS = 9, 4, 3, 12


def rim_starts(forward: ForwardMap, signal: Array, bands: int) -> Array:
    """(n, bands, 4) touches (x, y, log d, g), in each band of loads the one whose signal is closest to (n, readings).

    Each frame is turned and mirrored by every symmetry of the ring, so that one half-sector serves the whole rim.
    """
    unknown, foreseen = _foreseen(forward)
    symmetry = forward.rim.symmetry
    images = np.einsum("mij,nj->nmi", symmetry.readings, signal @ forward.rim.fill.T, optimize=True)
    groups = np.array_split(np.argsort(unknown[:, 3], kind="stable"), bands)
    out = np.empty((len(signal), bands, 4))
    for k, group in enumerate(groups):
        distance = np.sum(foreseen[group] ** 2, axis=1) - 2 * images @ foreseen[group].T
        best = distance.reshape(len(signal), -1).argmin(axis=1)
        which, row = best // len(group), group[best % len(group)]
        z = (unknown[row, 0] + 1j * unknown[row, 1]) / symmetry.turn[which]
        z = np.where(symmetry.mirrored[which], z.conj(), z)
        out[:, k] = np.column_stack([z.real, z.imag, unknown[row, 2:]])
    return out


@lru_cache(maxsize=8)
def _foreseen(forward: ForwardMap) -> tuple[Array, Array]:
    """Touches (m, 4) as (x, y, log d, g) and their signals (m, all readings of the ring)."""
    (_, d_lo, f_lo), (reach, d_hi, f_hi) = forward.bounds
    least = INTERIOR * forward.ring.radius_mm
    log_d = np.log(np.linspace(d_lo, d_hi, DIAMETERS))
    lightest, heaviest = (np.arcsinh(f / (d**2 * forward.p0)) for f, d in ((f_lo, d_hi), (f_hi, d_lo)))
    loads = np.linspace(lightest, heaviest, LOADS + 2)[1:-1]
    sector = np.pi / max(int(np.sum(~forward.rim.symmetry.mirrored)), 1)
    angles = (np.arange(ANGLES) + 0.5) * sector / ANGLES
    radius, angle, log_d, load = (grid.ravel() for grid in np.meshgrid(np.linspace(least, reach, RADII), angles, log_d,
                                                                       loads, indexing="ij"))
    unknown = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), log_d, load])
    return unknown, linearise(forward, unknown).signal_V @ forward.rim.fill.T
