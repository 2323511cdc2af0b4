"""How the reading of any four electrodes changes with a touch anywhere on the skin: every drive from one solution.

A reading is w'Zc of currents c and weights w that each sum to 0, so that its derivatives by a touch follow from those
of the transfer impedances of all electrodes against the first.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from eitsim.electrics.mesh.p2_triangles import HALVINGS
from eitsim.scene.drive import Drive
from eitsim.scene.edges.outline_electrodes import patch_loops
from eitsim.scene.electrodes import there
from eitsim.scene.polygons import centroid_m, edge_distance_m, inside, squared_distance
from eitsim.scene.scene import Accuracy, Scene
from eitsim.simulation.derivatives.readings import scene_sensitivity
from matcal.card import MaterialCard
from touchcal.arrays import Array, Index

UNKNOWNS = ("x_mm", "y_mm", "F_N", "d_mm")
PLACES = 24  # touches that are solved, evenly over the area; a second of CPU time each
# Least distance of the punch's edge from the rim, over the radius of the disc; the skin's mesh refines towards none.
GAP = 0.01
_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
# Least distance of the punch's edge from edges of an outline, thicknesses, and from electrodes on the surface: contacts
# reach a little farther than the punch.
_EDGE = 0.25
_PLASTIC = 1.324717957244746  # its powers spread points evenly over a square (Roberts' sequence R2)


@dataclass(frozen=True, eq=False)
class TouchSlopes:
    """What voltages between the electrodes and the first become, by touches; V at the current of the scene's drive."""

    place_mm: Array  # (places, 2) of the touches, mm
    by: Array  # (places, N, N, 4) derivatives of voltage k for the current into l by UNKNOWNS, V a unit
    untouched_V: Array  # (N, N) these voltages without a touch, V


def touch_slopes(scene: Scene, card: MaterialCard, *, within_m: float | None = None, places: int = PLACES,
                 each: Callable[[Iterable[int]], Iterable[int]] = iter) -> TouchSlopes:
    """The scene's punch at places of a disc of radius within_m, as far as it fits where that is None; on an outline at
    those of `outline_places_m`.

    A ring that looks the same from each electrode to the next turns every place into one for each electrode, on a disc.
    What edges change of the mechanics is left out. ValueError where the scene has not one punch under a force, an
    electrode is missing, or the punch does not fit; else as scene_sensitivity.
    """
    if len(scene.punches) != 1 or scene.punches[0].force_N is None:
        raise ValueError("a design is for one touch under a force; give one [punch] with force_N.")
    if not there(scene.electrodes).all():
        raise ValueError("electrodes are missing in [electrodes]; give the count and angles_deg of those that are "
                         "there.")
    punch, count = scene.punches[0], scene.electrodes.count
    place_m = outline_places_m(scene, places, within_m) if scene.body.has_outline else _on_disc_m(
        scene, places, within_m)
    against_first = np.eye(count)[1:] - np.eye(count)[0]
    asked = replace(scene, drive=Drive(scene.drive.current_A, currents=against_first, measurements=against_first),
                    accuracy=Accuracy(math.inf))
    by, untouched = np.zeros((places, count, count, len(UNKNOWNS))), np.zeros((count, count))
    for k in each(range(places)):
        moved = replace(punch, x_m=float(place_m[k, 0]), y_m=float(place_m[k, 1]))
        found = scene_sensitivity(replace(asked, punches=(moved,)), card, halvings=HALVINGS - 1)
        columns = [found.parameters.index(name) for name in UNKNOWNS]
        by[k, 1:, 1:] = found.signal_by[:, columns].reshape(count - 1, count - 1, -1)
        untouched[1:, 1:] = (found.touched_V - found.signal_V).reshape(count - 1, count - 1)
    solved = TouchSlopes(place_m * 1e3, by, untouched)
    if scene.body.edge.turns(scene.electrodes) == 1:
        return solved
    return _turned(solved, -1 if scene.electrodes.clockwise else 1)


def _on_disc_m(scene: Scene, places: int, within_m: float | None) -> Array:
    """Places (n, 2), m, evenly over the area of a disc; ValueError where the punch does not fit."""
    punch = scene.punches[0]
    room = (1 - GAP) * scene.body.radius_m - punch.diameter_m / 2
    reach = room if within_m is None else within_m
    if not 0 < reach <= room:
        raise ValueError(f"touches within {reach * 1e3:g} mm of the centre do not fit: a punch of "
                         f"{punch.diameter_m * 1e3:g} mm may be up to {room * 1e3:.4g} mm from it.")
    number = np.arange(places) + 0.5
    radius, angle = reach * np.sqrt(number / places), _GOLDEN_ANGLE * number
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def outline_places_m(scene: Scene, places: int, within_m: float | None = None) -> Array:
    """Places (n, 2), m, evenly over an outline where the punch lies on the skin and on no electrode, within a distance
    of the centroid where that is given; ValueError where there are none."""
    outline, reach = scene.body.outline, scene.punches[0].diameter_m / 2 + _EDGE * scene.body.thickness_m
    low, high = outline.loops[0].min(axis=0), outline.loops[0].max(axis=0)
    number = np.arange(200 * places)[:, None]
    at = low + (0.5 + number / _PLASTIC ** np.array([1, 2])) % 1 * (high - low)
    free = edge_distance_m(outline, at) >= reach
    if within_m is not None:
        free &= np.linalg.norm(at - centroid_m(outline), axis=1) <= within_m
    for loop in patch_loops(scene.electrodes):
        ends = np.roll(loop, -1, axis=0)
        free &= ~inside(at, loop, ends) & (squared_distance(at[:, None], loop, ends).min(axis=1) >= reach**2)
    if not free.any():
        raise ValueError(f"a punch of {2e3 * (reach - _EDGE * scene.body.thickness_m):g} mm finds no place that keeps "
                         f"{_EDGE:g} of the foam's thickness from edges and electrodes. "
                         "Make it smaller, or --within-mm larger.")
    return at[free][:places]


def _turned(solved: TouchSlopes, way: int) -> TouchSlopes:
    """With every place turned by each electrode of an even ring, counted counter-clockwise or, -1, clockwise; the
    slopes by x and y turn as a vector."""
    count = len(solved.untouched_V)
    place, by = [], []
    for k in range(count):
        angle, before = way * 2 * np.pi * k / count, (np.arange(count) - k) % count
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        moved = solved.by[:, before][:, :, before]
        place.append(solved.place_mm @ turn.T)
        by.append(np.concatenate([moved[..., :2] @ turn.T, moved[..., 2:]], axis=-1))
    return TouchSlopes(np.concatenate(place), np.concatenate(by), solved.untouched_V)


def reading_slopes(slopes: TouchSlopes, pairs: Index) -> Array:
    """(places, readings, 4) derivatives of readings (readings, 4) by source, sink, plus and minus, V a unit."""
    source, sink, plus, minus = pairs.T
    return (slopes.by[:, plus, source] - slopes.by[:, plus, sink]
            - slopes.by[:, minus, source] + slopes.by[:, minus, sink])


def untouched_V(slopes: TouchSlopes, pairs: Index) -> Array:
    """(readings,) untouched readings, V."""
    source, sink, plus, minus = pairs.T
    z = slopes.untouched_V
    return z[plus, source] - z[plus, sink] - z[minus, source] + z[minus, sink]
