"""Dipole response of an axisymmetric sheet: the leading term of a touch's signal far from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def dipole(radius: Array, radial: Array, hoop: Array) -> float:
    """Polarisability alpha, length^2: outside, the potential of a uniform field is (r + alpha/r) cos(theta).

    Sheet conductances radial and hoop (n,) over that of the sheet outside, at increasing radii (n,) > 0, taken
    constant between neighbours; the first holds from the axis on. In a ring of conductances a, b the admittance
    y = a r phi'/phi obeys dy/dln r = b - y^2/a, a tanh between its stationary values +- sqrt(a b).
    """
    a, b = (radial[1:] + radial[:-1]) / 2, (hoop[1:] + hoop[:-1]) / 2
    rest, turn = np.sqrt(a * b), np.tanh(np.sqrt(b / a) * np.diff(np.log(radius)))
    y = float(np.sqrt(radial[0] * hoop[0]))
    for stationary, t in zip(rest, turn, strict=True):
        y = stationary * (y + stationary * t) / (stationary + y * t)
    return float(radius[-1]**2 * (1 - y) / (1 + y))
