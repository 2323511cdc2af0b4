"""Skins that answer a press with readings: the simulator from its tables, or the model's own map."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from eitsim.electrics.forward.gridded_fields import QUANTITIES
from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.mechanics.load_paths.types import Table
from eitsim.scene.results import Touch
from eitsim.scene.scene import Scene, read_scene
from eitsim.sheet.sheet_conductance import untouched_conductance
from eitsim.simulation.choose import served
from eitsim.simulation.material import Material, material_of
from eitsim.simulation.reuse import shape_for, table_for
from eitsim.simulation.simulate import readings_of
from matcal.card import read_card
from matcal.laws.conductivity import conductivity
from surrogate.bounds.dataset_bound import example_of
from surrogate.data.baseline_frame import OTHER_BASELINE, relative_difference
from surrogate.data.sensor_ring import radial, ring_of, same_ring
from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.learners.forward import TouchInversion
from surrogate.live.controls import Controls, Limits
from surrogate.live.pictured import edges_of
from surrogate.model.simulated.touch_map import forward_of
from surrogate.model.trained import TrainedModel, trained_radius_mm
from touchcal.arrays import Array

# SweepSamples of a field from the axis of a punch outwards, and how far over its radius.
SAMPLES, ABOUT = 49, 6.0
MOST_DIAMETERS, CHOICE = 12, 5  # most diameters that are taken for those of known punches, else so many in equal steps
# Usual noise over the RMS of the untouched readings, 80 dB; most noise, and most drift in a minute, over the usual one
USUAL_NOISE, MOST_OF_USUAL = 1e-4, 10.0
FIELDS = ("strain", "conductivity")


@dataclass(frozen=True, eq=False)
class Pressed:
    """What a press makes of the skin."""

    signal_V: Array  # (readings,) V
    fields: dict[str, Any]  # profiles of fields about the punch, as the page draws them; empty where none is known
    problem: str = ""  # why there is no answer to this press; the signal is 0 then


class Skin(Protocol):
    """Something that can be pressed."""

    @property
    def baseline_V(self) -> Array:
        """(readings,) of the untouched skin, V."""
        ...

    def pressed(self, controls: Controls) -> Pressed:
        """The answer to a press."""
        ...


@dataclass(frozen=True, eq=False)
class LearnedSkin:
    """The map that a forward model has learned: it answers as its reader believes."""

    forward: ForwardMap
    baseline_V: Array

    def pressed(self, controls: Controls) -> Pressed:
        """The map's signal."""
        touch = np.array([[controls.x_mm, controls.y_mm, controls.diameter_mm, controls.force_N]])
        return Pressed(linearise(self.forward, to_unknown(touch, self.forward.p0)).signal_V[0], {})


@dataclass(frozen=True, eq=False)
class SimulatedSkin:
    """The simulator with load paths from a table, some 10 ms a press."""

    scene: Scene  # the sensor and one punch
    material: Material
    table: Table
    baseline_V: Array

    def pressed(self, controls: Controls) -> Pressed:
        """The simulator's signal and fields, however exact the stored path is; a problem where none serves the press,
        which would take seconds to solve."""
        punch = replace(self.scene.punches[0], x_m=controls.x_mm / 1e3, y_m=controls.y_mm / 1e3, depth_m=None,
                        diameter_m=controls.diameter_mm / 1e3, force_N=controls.force_N)
        scene = replace(self.scene, punches=(punch,))
        nothing = np.zeros_like(self.baseline_V)
        (touch,) = served(self.table, self.material.law, scene)
        if touch is None:
            return Pressed(nothing, {}, "no stored load path serves this press: it is too close to "
                                        f"{scene.body.edge.name}, too light or too deep")
        try:
            readings = readings_of(scene, (touch,), self.material.skin, exact=False)
        except ValueError as error:
            return Pressed(nothing, {}, f"not simulated: {error}")
        return Pressed(readings.signal_V.ravel(), _profiles(scene, touch, self.material))


def _profiles(scene: Scene, touch: Touch, material: Material) -> dict[str, Any]:
    """Fields of an axisymmetric touch along a line from the punch's axis through the disc's centre, each over its
    largest size."""
    (punch,) = scene.punches
    reach_m = ABOUT * punch.diameter_m / 2
    inwards = math.atan2(-punch.y_m, -punch.x_m)
    along = np.linspace(0.0, reach_m, SAMPLES)
    points = np.column_stack([punch.x_m + along * math.cos(inwards), punch.y_m + along * math.sin(inwards)])
    strain = QUANTITIES["strain"].values(points, ((punch, touch),), scene, material.skin)
    change = conductivity(material.skin, strain) / material.skin.c0_S_per_m - 1
    made: dict[str, Any] = {"reach_mm": reach_m * 1e3}
    for name, values in zip(FIELDS, (strain, change), strict=True):
        largest = max(float(np.abs(values).max()), np.finfo(float).tiny)
        made[name] = {"largest": largest, "parts": np.round(values / largest, 3).tolist()}
    return made


def learned_skin(model: TrainedModel) -> LearnedSkin:
    """The skin of a forward model; ValueError for another method."""
    return LearnedSkin(forward_of(model), model.baseline_V)


def simulated_skin(model: TrainedModel, card_path: Path, data: Path | None = None, scene_path: Path | None = None,
                   each: Callable[[Iterable[Any]], Iterable[Any]] = lambda items: items) -> SimulatedSkin:
    """The simulator of a card and the sensor of a data set's design, a scene file, or else the usual one.

    `each` goes through load paths that are solved where none are stored. ValueError where the sensor is not that of
    the model.
    """
    scene = example_of(data) if data is not None else Scene() if scene_path is None else read_scene(scene_path)
    material, pressable = material_of(scene, read_card(card_path)), limits_of(model)
    baseline = _untouched(scene, material, model)
    d = [one / 1e3 for one in pressable.diameters_mm]
    varied = len(known_diameters(model)) > 0
    shape = shape_for(scene, material.law, d if varied else [d[0], d[-1]], not varied and len(d) > 1)
    table, _ = table_for(shape, lambda function, items: map(function, each(items)))
    return SimulatedSkin(scene, material, table, baseline)


def _untouched(scene: Scene, material: Material, model: TrainedModel) -> Array:
    """(readings,) of the untouched sensor of a scene, V; ValueError where it is not that of the model."""
    fix = "Give the --data or --scene, and the card, that the model was trained with."
    # the foreseen modes aside
    if not same_ring(replace(ring_of(scene), modes=model.ring.modes), model.ring):
        raise ValueError(f"the scene's body, electrodes or drive are not those that the model was trained on. {fix}")
    readings = untouched_readings(scene, untouched_conductance(material.skin, scene.skin))
    if (off := relative_difference(readings, model.baseline_V)) > OTHER_BASELINE:
        raise ValueError(f"the untouched sensor's readings differ by {off:.0%} from the training's. {fix}")
    return readings


def usual_noise_V(model: TrainedModel) -> float:
    """Noise of the readings of a skin that is pressed, unless another is given, V."""
    return USUAL_NOISE * float(np.sqrt(np.mean(model.baseline_V**2)))


def known_diameters(model: TrainedModel) -> Array:
    """Diameters of the punches that calibrating rows share, mm; none where these are many."""
    if "d" not in model.names:
        return np.zeros(0)
    found = np.unique(model.calibration.target[:, model.names.index("d")])
    return found if len(found) <= MOST_DIAMETERS else np.zeros(0)


def limits_of(model: TrainedModel) -> Limits:
    """What may be pressed on the skin of a model: what it was trained on. ValueError where it does not read x0, y0, d
    and F."""
    missing = [name for name in ("x0", "y0", "d", "F") if name not in model.names]
    if missing:
        raise ValueError(f"the model does not read {', '.join(missing)}, which the page shows. Train with `outputs` "
                         "all.")
    k = {name: model.names.index(name) for name in ("x0", "y0", "d", "F")}
    lowest, highest = model.trained.lowest, model.trained.highest
    noise = 1e3 * MOST_OF_USUAL * usual_noise_V(model)
    d = known_diameters(model)
    d = d if len(d) else np.linspace(lowest[k["d"]], highest[k["d"]], CHOICE)
    edges, gap = edges_of(model), _gap_mm(model)
    inner = edges.middle_mm
    if edges.refuses(inner, float(d.max()), gap):
        inner = (float(model.ring.origin_mm[0]), float(model.ring.origin_mm[1]))
    return Limits(edges, gap, inner, tuple(np.round(d, 6).tolist()), float(highest[k["F"]]), noise, noise)


def _gap_mm(model: TrainedModel) -> float:
    """Least distance of trained touches to the edges; of a disc by the calibrating ones and the range of each
    coordinate, of a skin with an outline by those that taught a map, else by the calibrating ones."""
    ring = model.ring
    if ring.sheet is not None and isinstance(model.learner, TouchInversion):
        return ring.radius_mm - float(model.learner.forward.bounds[1, 0])
    if ring.sheet is not None:
        places = model.calibration.target[:, [model.names.index(name) for name in ("x0", "y0")]]
        return max(float(ring.radius_mm * (1 - radial(ring, places).max())), 0.0)
    return max(ring.radius_mm - trained_radius_mm(model), 0.0)
