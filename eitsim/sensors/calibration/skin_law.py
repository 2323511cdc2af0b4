"""What labelled presses may change of a material card for one skin, and what presses then change of its readings.

The coefficients a of a skin's law become exp(s) a, those of a cubic exp(s) (a_1, a_2 + b_2 f / e_r^2, a_3 + b_3 f /
e_r^3), with f the r.m.s. of c / c_0 - 1 over the strains of the card's fit, of which e_r is the largest; the foam's
moduli are times exp(m), and all presses lie further along x and y. Of a layer that conducts in its volume the thickness
and, where it is piezoresistive, its coefficients change (`scene.fitted_layer`). Signals at a thickness are polynomials
through those at three, each with touches of its own.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.load_paths.table import lagrange_weights
from eitsim.mechanics.load_paths.types import Table
from eitsim.scene.fitted_layer import ACROSS, PIEZO, THICKNESS, fitted_layer
from eitsim.scene.results import Touch
from eitsim.scene.scene import Accuracy, Punch, Scene, Skin
from eitsim.sensors.labels import PLACE, Labels, unit_of
from eitsim.simulation.choose import served
from eitsim.simulation.layer_paths import LayerPaths, layer_paths
from eitsim.simulation.material import Material, material_of
from eitsim.simulation.reuse import shape_for, table_for
from eitsim.simulation.simulate import readings_of
from matcal.card import MaterialCard
from matcal.laws.conduction_laws import CUBIC, conduction_law
from matcal.laws.conductivity import Conductivity
from matcal.laws.law import scaled
from touchcal.arrays import Array, Index

AMPLITUDE, MODULUS, SHAPES = "ln_law_amplitude", "ln_modulus_factor", ("law_shape_2", "law_shape_3")
OFFSETS = ("press_offset_x_mm", "press_offset_y_mm")
# Group of parameters -> prior standard deviation of each about 0, in the order in which a fit tries to free them
PRIORS = {"place": dict.fromkeys(OFFSETS, 1.0), "amplitude": {AMPLITUDE: 0.3}, "modulus": {MODULUS: 0.2},
          "shape": dict.fromkeys(SHAPES, 0.2)}
# The same of a piezoresistive layer, in the place of a card's law, and of a layer's thickness, its least and most.
_PIEZO = {"amplitude": {PIEZO: 0.3}, "shape": {ACROSS: 0.2}}
THICKNESS_SD, _THICKNESS_SDS = 0.05, (0.005, 0.1)
_NODE = 2.0  # standard deviations of the thickness at which touches are solved, either way
# Label -> least and most that a press has, and what the label is
_EXPECTED = {"d_mm": (0.5, 100.0, "the punch's diameter"), "F_N": (1e-3, 1e3, "the force"),
             "depth_mm": (0.02, 100.0, "the depth")}
_MOST_DIAMETERS = 3  # punches whose load paths are solved one by one; more are served as a range
# Accuracy of the presses' scenes, at which all are solved in one way, so that differences by parameters are smooth; and
# the one by which presses near the rim are left out: half of it is what the rim may change of a signal, which load
# paths leave out.
_SIGNAL, _NEAR_RIM = 0.05, 0.08


# Logarithm of a layer's thickness over that of its file -> touches at it; 0 alone of a coating
Paths = Mapping[float, Table | LayerPaths]


@dataclass(frozen=True, eq=False)
class SkinPresses:
    """Labelled presses that stored load paths serve, on the calibrated sensor."""

    scene: Scene  # the calibrated sensor's
    punches: tuple[Punch, ...]  # (k,)
    rows: Index  # (k,) which of the labels they are
    too_deep: Index  # of the others, those deeper than load paths are stored; the rest lie near the rim
    card: MaterialCard
    paths: Paths

    @property
    def groups(self) -> dict[str, dict[str, float]]:
        """PRIORS of what these presses depend on: moduli have no part in presses to a depth but where a soft base keeps
        its own, and a law that is no cubic, or without a range of strains, keeps its shape; thickness is a layer's."""
        law, skin = _skin_of(self.card), self.scene.skin
        piezo = skin.strain == "piezoresistive"
        idle = {"modulus": not skin.base_m and any(punch.force_N is None for punch in self.punches),
                "shape": not piezo and (law.kind != CUBIC or not any(law.strain_range))}
        own = {group: sds for group, sds in (PRIORS | (_PIEZO if piezo else {})).items() if not idle.get(group, False)}
        return own | ({"thickness": {THICKNESS: max(self.paths) / _NODE}} if skin.fills else {})

    def signals(self, values: Mapping[str, float]) -> Array:
        """(k, m) V what the presses change of the readings; ValueError where load paths do not reach one of them, or
        the conductivity is not positive."""
        thicker = values.get(THICKNESS, 0.0)
        nodes = [*self.paths] if thicker else [0.0]
        weights = lagrange_weights(np.array(nodes), thicker)
        return np.einsum("n,nkm->km", weights, [self._signals({**values, THICKNESS: node}) for node in nodes])

    def _signals(self, values: Mapping[str, float]) -> Array:
        """`signals` at a thickness of the paths."""
        card, layer = changed(self.card, values), self.scene.skin.fills
        return np.array([readings_of(scene, (touch,), material_of(scene, card).skin, exact=layer).signal_V.ravel()
                         for scene, touch in self.touches(values)])

    def touches(self, values: Mapping[str, float]) -> Iterator[tuple[Scene, Touch]]:
        """Each press's scene and touch, at a thickness of the paths; ValueError as `signals`."""
        skinned = replace(self.scene, skin=fitted_skin(self.scene.skin, values))
        material, paths = material_of(skinned, changed(self.card, values)), self.paths[values.get(THICKNESS, 0.0)]
        x, y = (1e-3 * values.get(name, 0.0) for name in OFFSETS)
        for punch in self.punches:
            moved = replace(punch, x_m=punch.x_m + x, y_m=punch.y_m + y)
            scene = replace(skinned, punches=(moved,))
            if (touch := _touch(paths, scene, material)) is None:
                raise ValueError(f"the press at {1e3 * moved.x_m:.4g}, {1e3 * moved.y_m:.4g} mm is deeper than load "
                                 "paths reach, or too near the rim, for the skin that the others suggest.")
            yield scene, touch


def skin_presses(scene: Scene, card: MaterialCard, labels: Labels, places_m: Array, paths: Paths | None = None,
                 thickness_sd: float = THICKNESS_SD) -> SkinPresses:
    """The presses of labels with d_mm and F_N or depth_mm at places (n, 2) in the sensor's coordinates, those of flat
    punches as a scene's by default; ValueError naming a label or a part of the card or skin that is missing.

    Presses near the rim, or deeper than load paths go, are left out. paths: of the same labels at other places;
    thickness_sd: of a layer's thickness, relative.
    """
    scene = replace(scene, accuracy=Accuracy(_SIGNAL))
    held = held_label(labels)
    check_skin(card)
    check_thickness_sd(thickness_sd)
    diameter, size = (labels.values[:, labels.names.index(name)] for name in ("d_mm", held))
    made = [Punch(x, y, 1e-3 * d, force_N=value) if held == "F_N" else Punch(x, y, 1e-3 * d, depth_m=1e-3 * value)
            for (x, y), d, value in zip(places_m.tolist(), diameter.tolist(), size.tolist(), strict=True)]
    ends = (-_NODE * thickness_sd, 0.0, _NODE * thickness_sd) if scene.skin.fills else (0.0,)
    scenes = {end: replace(scene, skin=fitted_skin(scene.skin, {THICKNESS: end})) for end in ends}
    paths = paths or {end: _paths(one, material_of(one, card), made) for end, one in scenes.items()}

    def reached(punch: Punch) -> bool:
        return all(_touch(paths[end], replace(one, punches=(punch,)), material_of(one, card)) is not None
                   for end, one in scenes.items())

    rows = [k for k, punch in enumerate(made) if reached(punch)]
    deep = [k for k, punch in enumerate(made) if k not in rows and not reached(replace(punch, x_m=0.0, y_m=0.0))]
    return SkinPresses(scene, tuple(made[k] for k in rows), np.array(rows, dtype=np.intp),
                       np.array(deep, dtype=np.intp), card, paths)


def _paths(scene: Scene, material: Material, punches: Sequence[Punch]) -> Table | LayerPaths:
    """What touches are taken from: paths of a layer with its inside, or a stored table of the surface."""
    if scene.skin.fills:
        return layer_paths(scene, material, punches)
    sizes = sorted({punch.diameter_m for punch in punches})
    spans = len(sizes) > _MOST_DIAMETERS
    shape = shape_for(replace(scene, punches=tuple(punches)), material.law, [sizes[0], sizes[-1]] if spans else sizes,
                      spans)
    return table_for(shape)[0]


def held_label(labels: Labels) -> str:
    """F_N or depth_mm, which of them the presses are held at; ValueError, naming the touch where it is one's, for
    labels that say not enough, both, or what no press has."""
    held = [name for name in ("F_N", "depth_mm") if name in labels.names]
    if any(name not in labels.names for name in (*PLACE, "d_mm")) or not held:
        raise ValueError(f"the labels are {', '.join(labels.names)}; the skin's law needs {' and '.join(PLACE)}, d_mm "
                         "of the punch, and F_N or depth_mm. Add them, or leave out --card: the size of the signal "
                         "needs places alone.")
    if len(held) > 1:
        raise ValueError("the labels hold both F_N and depth_mm, and a press is modelled by one of them. Leave out the "
                         "column that was measured worse; without F_N the foam's moduli are not fitted.")
    for name in ("d_mm", *held):
        low, high, what = _EXPECTED[name]
        values = labels.values[:, labels.names.index(name)]
        for touch, value in zip(labels.touch.tolist(), values.tolist(), strict=True):
            if not low <= value <= high:
                raise ValueError(f"touch '{touch}': {name} is {value:g}, expected {what} from {low:g} to {high:g} "
                                 f"{unit_of(name)}. Correct it or its unit, or leave the row out.")
    return held[0]


def check_skin(card: MaterialCard) -> None:
    """ValueError where a card has no conductivity."""
    _skin_of(card)


def check_thickness_sd(relative: float) -> None:
    """ValueError for a standard deviation of a layer's thickness that signals at three thicknesses do not serve."""
    low, high = _THICKNESS_SDS
    if not low <= relative <= high:
        raise ValueError(f"the standard deviation of a layer's thickness is {relative:g} of it, expected {low:g} to "
                         f"{high:g}. Give that of the layer that thickness_mm in [skin] was measured on.")


def changed(card: MaterialCard, values: Mapping[str, float]) -> MaterialCard:
    """The card with a skin's law and moduli, c0 as it is; values that are not there are 0."""
    law = _skin_of(card)
    low, high = law.strain_range
    strain, largest = np.linspace(low, high, 101), max(abs(low), abs(high))
    size = float(np.sqrt(np.mean((conduction_law(law.kind).ratio(law.a, strain) - 1) ** 2)))
    shift = np.zeros_like(law.a)
    if law.kind == CUBIC and largest:
        shift[1:] = [values.get(name, 0.0) * size / largest**order for order, name in enumerate(SHAPES, start=2)]
    a = math.exp(values.get(AMPLITUDE, 0.0)) * (law.a + shift)
    foam = card.law
    stiffer = foam and scaled(foam, math.exp(values.get(MODULUS, 0.0)))
    return replace(card, law=stiffer, conductivity=replace(law, a=a))


def fitted_skin(skin: Skin, values: Mapping[str, float]) -> Skin:
    """A skin with a layer's fitted thickness and coefficients; values that are not there are 0."""
    if not skin.fills:
        return skin
    thickness_m, along, across = fitted_layer(skin.thickness_m, skin.along, skin.across, values)
    return replace(skin, thickness_m=thickness_m, along=along, across=across)


def _touch(paths: Table | LayerPaths, scene: Scene, material: Material) -> Touch | None:
    """The touch of a scene by load paths; None where they do not reach it, or edges matter."""
    scene = replace(scene, accuracy=Accuracy(_NEAR_RIM))
    if isinstance(paths, LayerPaths):
        return paths.touch(scene, material)
    return served(paths, material.law, scene)[0]


def _skin_of(card: MaterialCard) -> Conductivity:
    if card.conductivity is None:
        raise ValueError(f"card '{card.name}' has no conductivity, whose change with strain labelled presses scale. "
                         "Fit the card again with a conductivity test.")
    return card.conductivity
