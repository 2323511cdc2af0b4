"""Harmonics about the axis of an axisymmetric sheet, ring by ring; the first leads a touch's signal far from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def admittance(core: Array, stationary: Array, meridian: Array, radii_m: Array) -> Array:
    """Admittance Y = rho s u'/u (orders,) of harmonics u at the outermost of radii (n + 1,) > 0, m, from that at the
    first, `core` (orders,).

    Ring j between radii j and j + 1 has the meridional conductance s_j (n,) and the stationary admittances k
    (orders, n): there Y' = k (Y + k h)/(k + Y h) with h = tanh(k ln(rho'/rho)/s).
    """
    h = np.tanh(stationary / meridian * np.log(radii_m[1:] / radii_m[:-1]))
    y = core
    for k, hk in zip(stationary.T, h.T, strict=True):
        y = k * (y + k * hk) / (k + y * hk)
    return y


def dipole(radius: Array, radial: Array, hoop: Array) -> float:
    """Polarisability alpha, length^2: outside, the potential of a uniform field is (r + alpha/r) cos(theta).

    Sheet conductances radial and hoop (n,) over that of the sheet outside, at increasing radii (n,) > 0, taken
    constant between neighbours; the first holds from the axis on.
    """
    a, b = (radial[1:] + radial[:-1]) / 2, (hoop[1:] + hoop[:-1]) / 2
    core = np.sqrt(radial[:1] * hoop[:1])
    y = float(admittance(core, np.sqrt(a * b)[None], a, radius)[0])
    return float(radius[-1]**2 * (1 - y) / (1 + y))
