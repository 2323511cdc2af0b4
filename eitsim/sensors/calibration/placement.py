"""How the coordinates of labels lie on the sensor: their centre, turn and direction, by what presses explain."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from eitsim.scene.scene import Body, from_edge_m
from touchcal.arrays import Array

_FROM_EDGE = 0.03  # part of the radius that all places must keep from the rim of a disc
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


def placement(places_m: Array, signal: Array, shape_of: Callable[[Array], Array], body: Body) -> Placement:
    """The placement of labelled presses that leaves least of their signals (k, m); shape_of: places (k, 2), m -> (k, m)
    what small touches there change.

    The labels' own frame is kept where all places lie on the skin and no other explains the signals clearly better.
    ValueError where the places do not fit on the skin.
    """
    rows, radius_m = np.unique(np.linspace(0, len(places_m) - 1, _MOST).astype(int)), body.edge.size_m
    places, seen = places_m[rows], signal[rows]
    middle, target = _middle(places_m), _middle(np.array(body.edge.box_m))
    reach = float(np.hypot(*(places_m - middle).T).max())
    is_disc = body.edge.is_round
    if is_disc and reach > (1 - _FROM_EDGE) * radius_m:
        raise ValueError(f"places reach {reach * 1e3:.3g} mm from the middle of their range, and radius_mm in [body] "
                         f"is {radius_m * 1e3:g}; correct one of them.")

    def left(one: Placement) -> float:
        at = one.placed(places)
        if from_edge_m(body, at).min() < 0:
            return np.inf
        shape = shape_of(at)
        size = np.sum(seen * shape, axis=1) / np.sum(shape**2, axis=1)
        return float(np.sum((seen - size[:, None] * shape) ** 2) / np.sum(seen**2))

    turned = [_about(middle, target, 2 * np.pi * k / _TURNS, mirrored) for mirrored in (False, True)
              for k in range(_TURNS)]
    own = Placement()
    best = min(turned if is_disc else [*turned, own], key=left)
    if not np.isfinite(left(best)):
        raise ValueError("the labelled places do not fit on the skin, however they are turned; correct them, or the "
                         "outline in [body].")

    def moved(change: Array) -> Placement:
        return Placement((best.centre_m[0] + 0.1 * radius_m * change[0], best.centre_m[1] + 0.1 * radius_m * change[1]),
                         best.turn_rad + change[2] * np.pi / _TURNS, best.mirrored)

    found = moved(minimize(lambda change: left(moved(change)), np.zeros(3), method="Nelder-Mead",
                           options={"initial_simplex": np.vstack([np.zeros(3), np.eye(3)]), "xatol": 1e-2,
                                    "fatol": 1e-6, "maxfev": 200}).x)
    inside = from_edge_m(body, own.placed(places_m)).min() >= (_FROM_EDGE * radius_m if is_disc else 0)
    if inside and left(found) > _CLEARLY * left(own):
        return own
    within = from_edge_m(body, found.placed(places_m))
    if within.min() < 0:
        x, y = 1e3 * places_m[int(np.argmin(within))]
        raise ValueError(f"the press at {x:.4g}, {y:.4g} mm lies {-within.min() * 1e3:.3g} mm off the skin, where the "
                         "others place it; correct its label, or the size of the skin in [body].")
    return found


def _middle(points: Array) -> Array:
    return (points.min(axis=0) + points.max(axis=0)) / 2


def _about(middle: Array, target: Array, turn: float, mirrored: bool) -> Placement:
    """The placement of such a turn and direction that puts one point, m, at another."""
    away = (target @ np.array([1.0, 1j])) * np.exp(-1j * turn)
    away = np.conj(away) if mirrored else away
    return Placement((float(middle[0] - away.real), float(middle[1] - away.imag)), turn, mirrored)
