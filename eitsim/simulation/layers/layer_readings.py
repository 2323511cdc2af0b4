"""Readings of a touched layer that conducts in its volume: as a sheet of its resultants, or in its volume."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eitsim.electrics.cem.ring_scattering import reaches
from eitsim.electrics.forward.skins import skin_of
from eitsim.electrics.forward.solve_forward import Touches, solve
from eitsim.scene.channels import channel_changes
from eitsim.scene.curved.curved_scene import AnyScene
from eitsim.scene.drive import protocol
from eitsim.scene.electrodes import among_all, contact_impedances, present
from eitsim.scene.results import Readings, Touch
from eitsim.scene.scene import Electrodes, Scene
from eitsim.sheet.layer_conductivity import sheet_law, sheet_skin
from eitsim.sheet.sheet_conductance import extrapolated_share, untouched_conductance
from eitsim.simulation.layers.layer_section import LayerSection, in_volume, layer_section, sheet_error, sheet_of
from eitsim.simulation.layers.touched_layer import layer_change
from matcal.laws.conductivity import Conductivity
from touchcal.arrays import Array
from touchcal.jit import cpu_s

# Part of the requested signal error up to which the sheet of a layer's resultants serves; what the sheet's first
# moments miss of its error, over them; and the error of the volume's own mesh (benchmarks/layers.py).
SHEET_SHARE, UNSEEN, SECTION = 0.5, 1.5, 1e-3
# Layers through the thickness of a solution in three dimensions, and of the rougher one that shows its error; level of
# the mesh of their plane.
_LAYERS, _ROUGHLY, _LEVEL = 5, 3, 1
PLANE = 6e-3  # Error of dV by that mesh of the plane: above all that were measured next to the volume's own solution.


@dataclass(frozen=True, eq=False)
class TouchedLayer:
    """A scene's layer under its solved touches."""

    scene: Scene
    touches: Sequence[Touch]
    law: Conductivity

    @cached_property
    def sections(self) -> list[LayerSection]:
        """The layer under each touch; NotPositive where its conductivity is not positive, ValueError where the inside
        of a touch is not kept."""
        if any(touch.section is None for touch in self.touches):
            raise ValueError("a layer that conducts in its volume needs the inside of every touch, which touches of a "
                             "load path or a creeping hold do not keep; solve the touch itself.")
        return [layer_section(touch, self.scene.skin, self.law) for touch in self.touches]

    @cached_property
    def sheets(self) -> Touches:
        """The touches on a sheet that conducts what the layer's resultants do."""
        return tuple((punch, sheet_of(layer, touch)) for punch, layer, touch in zip(
            self.scene.punches, self.sections, self.touches, strict=True))

    @cached_property
    def sheet_error(self) -> float:
        """How far dV of the sheet may be off that of the volume, relative."""
        reach = reaches(self.scene.body, self.sheets)
        return UNSEEN * max(sheet_error(layer, sheet, punch, self.scene.skin, self.law, room) for layer, (punch, sheet),
                            room in zip(self.sections, self.sheets, reach, strict=True))

    def volumes(self) -> Touches:
        """The touches on the sheet, which scatter what the volume does."""
        return tuple((punch, in_volume(layer, sheet)) for layer, (punch, sheet) in zip(
            self.sections, self.sheets, strict=True))

    @property
    def outside(self) -> float:
        """Part of the layer that is strained outside the fit of its conductivity."""
        volume = np.pi * self.scene.body.edge.size_m**2 * self.scene.skin.thickness_m
        found = sum(float(np.sum(layer.volumes_m3[layer.outside])) for layer in self.sections)
        return min(found / volume, 1.0)

    def outside_share(self) -> float:
        """Part of what touches change of the conductivity that comes from where it is strained outside its fit."""
        far = sum(float(np.sum(layer.changes[layer.outside])) for layer in self.sections)
        whole = sum(float(np.sum(layer.changes)) for layer in self.sections)
        return far / whole if whole else 0.0


def share_extrapolated(scene: AnyScene, touches: Sequence[Touch], law: Conductivity) -> float:
    """Share of the signal that comes from where the skin is strained outside the fit of its conductivity."""
    if isinstance(scene, Scene) and scene.skin.fills:
        return TouchedLayer(scene, touches, law).outside_share()
    return extrapolated_share(touches, scene.skin, law)


def layer_readings(scene: Scene, touches: Sequence[Touch], law: Conductivity, signal: float, *, exact: bool = False
                   ) -> Readings:
    """Readings of a touched layer, dV to a relative error `signal` where that can be reached.

    With electrodes over the whole rim the untouched layer is the sheet, and touches are solved as a sheet of resultants
    where what that misses is at most SHEET_SHARE of `signal`, else, or exactly, by what their volume scatters. With
    others both the untouched and the touched layer are solved in three dimensions on one mesh. NotPositive where the
    conductivity is not positive.
    """
    start, layer = cpu_s(), TouchedLayer(scene, touches, law)
    in_plane = exact or layer.sheet_error > SHEET_SHARE * signal
    line = scene.electrodes.along_edge
    found = solve(scene.body, sheet_skin(scene.skin), scene.electrodes, scene.drive,
                  layer.volumes() if in_plane and line else layer.sheets, sheet_law(law), channels=scene.channels,
                  signal=signal, method="multipole" if in_plane and line else "auto")
    missed = SECTION if in_plane else layer.sheet_error
    found = replace(found, signal_error=found.signal_error + missed, skin_fraction_extrapolated=layer.outside,
                    method=f"{found.method}, {'volume' if in_plane else 'sheet'}")
    if not scene.electrodes.over_thickness:
        found = _in_three_dimensions(layer, found)
    return replace(found, cpu_s=cpu_s() - start)


def _in_three_dimensions(layer: TouchedLayer, flat: Readings) -> Readings:
    """Readings on one mesh of the volume; what fewer layers change, and what the mesh of the plane makes of the sheet's
    dV, is the error."""
    scene, given = layer.scene, layer.scene.electrodes
    kept = present(given)
    pairs = tuple(zip(scene.punches, layer.touches, strict=True))
    mesh = skin_of(scene.body, kept, untouched_conductance(layer.law, scene.skin)).touched_mesh(layer.sheets, _LEVEL)
    between = layer_heights(given, scene.skin.thickness_m)
    place, z = ("rim" if given.along_edge else given.side), contact_impedances(kept)
    if given.along_edge:
        z = z * (between[1] - between[0])
    (rest, change), (_, rough) = (layer_change(mesh, scene.skin, layer.law, pairs, z, layers=layers, place=place,
                                               between_m=between) for layers in (_LAYERS, _ROUGHLY))
    asked = protocol(scene.drive, given.count)

    def read(before: Array, by: Array) -> Array:
        return channel_changes(asked, scene.channels, *(among_all(given, one) for one in (before, before + by, by)))

    baseline, dv, roughly = read(np.zeros_like(rest), rest), read(rest, change), read(rest, rough)
    size = float(np.linalg.norm(np.nan_to_num(dv)))
    error = float(np.linalg.norm(np.nan_to_num(dv - roughly))) / size + PLANE
    return replace(flat, touched_V=baseline + dv, baseline_V=baseline, signal_V=dv,
                   impedance_Ohm=among_all(given, rest + change), signal_error=error, method="volume")


def layer_heights(electrodes: Electrodes, thickness_m: float) -> tuple[float, float]:
    """Heights, m, the top at 0, between which line electrodes cover the rim."""
    if electrodes.over_thickness:
        return -thickness_m, 0.0
    return electrodes.low_m - thickness_m, electrodes.high_m - thickness_m
