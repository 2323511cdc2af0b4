"""How the coordinates of labels lie on the sensor: their centre, turn and direction, by what presses explain."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from touchcal.arrays import Array

_INSIDE = 0.97  # part of the radius within which all places must lie
_TURNS = 64
_MOST = 100  # presses that the search takes, spread evenly
# A frame of labels that is that of the sensor file is kept unless another leaves less than this part of what it leaves.
_CLEARLY = 0.9


@dataclass(frozen=True)
class Placement:
    """Where the sensor lies in the coordinates of the labels."""

    centre_m: tuple[float, float] = (0.0, 0.0)
    turn_rad: float = 0.0  # by which places about the centre are turned into the sensor's coordinates
    mirrored: bool = False  # whether y counts the other way first

    def placed(self, places_m: Array) -> Array:
        """(k, 2) places in the sensor's coordinates, m."""
        point = (places_m - np.array(self.centre_m)) @ np.array([1.0, 1j])
        point = (point.conj() if self.mirrored else point) * np.exp(1j * self.turn_rad)
        return np.column_stack([point.real, point.imag])


def placement(places_m: Array, signal: Array, shape_of: Callable[[Array], Array], radius_m: float) -> Placement:
    """The placement of labelled presses that leaves least of their signals (k, m); shape_of: places (k, 2), m -> (k, m)
    what small touches there change.

    The labels' own frame is kept where all places lie inside the disc and no other explains the signals clearly better.
    ValueError where the places do not fit into the disc.
    """
    rows = np.unique(np.linspace(0, len(places_m) - 1, _MOST).astype(int))
    places, seen = places_m[rows], signal[rows]
    middle = (places_m.min(axis=0) + places_m.max(axis=0)) / 2
    reach = float(np.hypot(*(places_m - middle).T).max())
    if reach > _INSIDE * radius_m:
        raise ValueError(f"places reach {reach * 1e3:.3g} mm from the middle of their range, and radius_mm in [body] "
                         f"is {radius_m * 1e3:g}; correct one of them.")

    def left(one: Placement) -> float:
        at = one.placed(places)
        if np.hypot(*at.T).max() > radius_m:
            return np.inf
        shape = shape_of(at)
        size = np.sum(seen * shape, axis=1) / np.sum(shape**2, axis=1)
        return float(np.sum((seen - size[:, None] * shape) ** 2) / np.sum(seen**2))

    centre = (float(middle[0]), float(middle[1]))
    turned = [Placement(centre, 2 * np.pi * k / _TURNS, mirrored) for mirrored in (False, True) for k in range(_TURNS)]
    best = min(turned, key=left)

    def moved(change: Array) -> Placement:
        return Placement((centre[0] + 0.1 * radius_m * change[0], centre[1] + 0.1 * radius_m * change[1]),
                         best.turn_rad + change[2] * np.pi / _TURNS, best.mirrored)

    found = moved(minimize(lambda change: left(moved(change)), np.zeros(3), method="Nelder-Mead",
                           options={"initial_simplex": np.vstack([np.zeros(3), np.eye(3)]), "xatol": 1e-2,
                                    "fatol": 1e-6, "maxfev": 200}).x)
    own = Placement()
    inside = np.hypot(*own.placed(places_m).T).max() <= _INSIDE * radius_m
    if inside and left(found) > _CLEARLY * left(own):
        return own
    away = np.hypot(*found.placed(places_m).T)
    if away.max() > radius_m:
        x, y = 1e3 * places_m[int(np.argmax(away))]
        raise ValueError(f"the press at {x:.4g}, {y:.4g} mm lies {away.max() * 1e3:.3g} mm from the sensor's "
                         f"middle, where the others place it, and radius_mm in [body] is {radius_m * 1e3:g}; correct "
                         "its label.")
    return found
