"""Where a specimen begins to carry load, and what the load cell reads before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

# strain over which the load is fitted, and half width of the toe that is left out of the fit, both of the length
_REACH, _TOE = 0.10, 0.005
# load = zero + a u + b u^2 + c u^3 beyond contact
_DEGREE = 3
# what a cubic misses of a foam's curve, as an error of the contact, of the length (measured on the synthetic files)
_SHAPE_ERROR = 5e-4


@dataclass(frozen=True)
class Contact:
    """The start of the specimen's own deformation."""

    # travel at which an ideal, flat specimen would have been touched, m
    travel_m: float
    # its standard deviation: the noise of the load and the shape of the curve, m
    sd_m: float
    # load reading without specimen, N
    zero_N: float


def find_contact(travel: Array, load: Array, rest: int, length_m: float, latest_m: float) -> Contact:
    """The change point of load = zero + polynomial(travel - contact) over the first tenth of strain.

    `travel` (n,), m, of the specimen's end and `load` (n,), N, through the loading, of which the first `rest` samples
    stand still. A specimen that is not quite flat lands gradually, so moving samples within 0.5 % of strain of the
    contact are left out (toe compensation); which they are follows from the contact of the round before. The contact
    is looked for between 0 and `latest_m`.
    """
    travel = np.concatenate([np.full(rest, -np.inf), travel[rest:]])
    at = latest_m / 2
    for _ in range(5):
        used = (travel < at + _REACH * length_m) & (np.abs(travel - at) > _TOE * length_m)
        before, at = at, _change_point(travel[used], load[used], length_m, latest_m)
        if abs(at - before) < 1e-5 * length_m:
            break
    variance, coefficients, basis = _fit(at, travel[used], load[used], length_m)
    sd = np.hypot(_standard_deviation(variance, coefficients, basis, length_m), _SHAPE_ERROR * length_m)
    return Contact(at, float(sd), float(coefficients[0]))


def _change_point(travel: Array, load: Array, length_m: float, latest_m: float) -> float:
    grid = np.linspace(0.0, latest_m, 25)
    best = int(np.argmin([_fit(at, travel, load, length_m)[0] for at in grid]))
    found: Any = minimize_scalar(lambda at: _fit(at, travel, load, length_m)[0], method="bounded",
                            options={"xatol": 1e-7 * length_m},
                            bounds=(float(grid[max(best - 1, 0)]), float(grid[min(best + 1, grid.size - 1)])))
    return float(found.x)


def _fit(at: float, travel: Array, load: Array, length_m: float) -> tuple[float, Array, Array]:
    """Mean squared residual, coefficients (zero first) and basis."""
    u = np.maximum(travel - at, 0.0) / (_REACH * length_m)
    basis = u[:, None] ** np.arange(_DEGREE + 1)
    coefficients: Array = np.linalg.lstsq(basis, load, rcond=None)[0].astype(float)
    return float(np.mean((load - basis @ coefficients) ** 2)), coefficients, basis


def _standard_deviation(variance: float, coefficients: Array, basis: Array, length_m: float) -> float:
    """Of the change point, m, by linearising: its column d load/d contact joins those of the polynomial."""
    power = np.arange(1, _DEGREE + 1)
    slope = -(basis[:, :-1] * (basis[:, 1:2] > 0)) @ (power * coefficients[1:]) / (_REACH * length_m)
    jacobian = np.column_stack([basis, slope * length_m])
    return float(length_m * np.sqrt(variance * np.linalg.inv(jacobian.T @ jacobian)[-1, -1]))
