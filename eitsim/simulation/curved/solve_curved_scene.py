"""One scene on a curved body, end to end: plan, mechanics, skin and electrics, and the same touches on a flat layer."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.curved.adapted_sheet import SheetReadings, skin_mesh
from eitsim.electrics.curved.facets import Facets
from eitsim.electrics.curved.skin_file import curved_skin_fields, write_curved_skin
from eitsim.electrics.curved.solve_curved import READINGS, contact_impedances, prepared
from eitsim.electrics.curved.touched_sheet import ContactEnd, solve_touched, strained_outside
from eitsim.mechanics.axisymmetric.elastic_holds import stand_ins
from eitsim.mechanics.axisymmetric.hold import kept
from eitsim.mechanics.curved.moved_touches import MovedTable
from eitsim.scene.curved.curved_body import CurvedBody
from eitsim.scene.curved.curved_scene import CurvedScene
from eitsim.scene.curved_skin import CurvedSkin
from eitsim.scene.drive import protocol, read_out
from eitsim.scene.results import Moment, Plan, Readings, Result, SpaceField, Touch, of_strain
from eitsim.scene.scene import Punch
from eitsim.sheet.sheet_conductance import untouched_conductance
from eitsim.simulation.curved.curved_plan import curved_plan
from eitsim.simulation.curved.moved_tables import moved
from eitsim.simulation.material import Material, material_of
from eitsim.simulation.outcome import solved, stopped
from eitsim.simulation.routes.on_surface import Pressed, alone_on_flat, pressed
from eitsim.simulation.validity import check_positive
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from touchcal.arrays import Array
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s
from touchcal.parallel.one_thread import ONE_THREAD
from touchcal.run_cost import cost_from_here

ELECTRICS_SHARE = 0.2  # Part of the requested signal error, or of the touches' own where more, for electrics.


@ONE_THREAD
def solve_curved_scene(scene: CurvedScene, card: MaterialCard | Material, *, exact: bool = False,
                       table: MovedTable | None = None, compared: bool = True) -> Result:
    """Solve a scene on a curved body; a refusal or a failure of a solver is the result's outcome, which its message
    explains. exact: on finer meshes, without a table; table: touches that are taken to their place where it serves;
    compared: with the same touches on a flat layer. ValueError where the card lacks a part that the scene needs."""
    cost = cost_from_here()
    material = material_of(scene.flat, card)
    _ = material.skin  # ValueError where the card lacks it
    plan = curved_plan(scene, material)
    result = Result("refused", plan, message=plan.refusal) if plan.refusal else _solved(
        scene, material, plan, exact, None if exact else table, compared)
    return replace(result, cost=cost())


def _solved(scene: CurvedScene, material: Material, plan: Plan, exact: bool, table: MovedTable | None, compared: bool
            ) -> Result:
    try:
        stored = None if table is None else moved(scene, material.law, table)
        states = _over_time(scene, material, exact) if stored is None else [(0.0, stored)]
        readings = [_readings(scene, material, pressed) for _, pressed in states]
    except NotConverged as error:
        return stopped(plan, error)
    except ValueError as error:
        return Result("refused", plan, message=str(error))
    moments = tuple(Moment(t, pressed.touches, each) for (t, pressed), each in zip(states, readings, strict=True))
    result = solved(scene, plan, states[-1][1].touches, readings[-1], moments if scene.hold.time_s else ())
    return replace(result, surface=states[-1][1].field, as_if_flat=alone_on_flat(scene, material) if compared else ())


def _over_time(scene: CurvedScene, material: Material, exact: bool) -> list[tuple[float, Pressed]]:
    """The touches at every time, s; at 0 without a hold."""
    law, hold = material.law, scene.hold
    if not hold.time_s:
        return [(0.0, pressed(scene, law, scene.punches, exact))]
    if hold.keeps_deformation:
        state = pressed(scene, law, scene.punches, exact)
        each = [kept(material.series, hold, touch) for touch in state.touches]
        return [(moment[0][0], replace(state, touches=tuple(touch for _, touch in moment)))
                for moment in zip(*each, strict=True)]
    moments = stand_ins(law, material.series, scene.body.flat, scene.punches, hold)
    first, out = moments[0], []
    loaded = pressed(scene, law, _under([punch.force_N and force for punch, force in zip(
        scene.punches, first.force_N.tolist(), strict=True)], scene.punches), exact)
    state = loaded
    for k, moment in enumerate(moments):
        if k and hold.control == "force":
            grown = (moment.force_N / first.force_N).tolist()
            state = pressed(scene, law, _under([touch.force_N * by for touch, by in zip(
                loaded.touches, grown, strict=True)], scene.punches), exact)
        out.append((moment.time_s, replace(state, touches=moment.held(state.touches))))
    return out


def _under(forces_N: Sequence[float | None], punches: Sequence[Punch]) -> tuple[Punch, ...]:
    """The punches under forces; at their depth where none is given."""
    return tuple(punch if force is None else replace(punch, force_N=force, depth_m=None)
                 for punch, force in zip(punches, forces_N, strict=True))


def _readings(scene: CurvedScene, material: Material, state: Pressed) -> Readings:
    begun, law = cpu_s(), material.skin
    check_positive(law, scene.skin.strain, state.touches)
    found = touched_sheet(scene, law, state.touches, state.field)
    baseline, signal = (read_out(scene.drive, z) for z in (
        found.impedance_Ohm, found.touched_Ohm - found.impedance_Ohm))
    return Readings(baseline + signal, baseline, signal, found.touched_Ohm, found.signal_error or 0.0,
                    strained_outside(found.mesh, OnSurfaceField(scene, state.field), scene.skin, law),
                    len(found.mesh.nodes_m) + found.mesh.count - 1, cpu_s() - begun, "mesh")


def touched_sheet(scene: CurvedScene, law: Conductivity, touches: Sequence[Touch], field: SpaceField) -> SheetReadings:
    """The scene's sheet untouched and under touches, as exact as the scene asks for or as the touches are."""
    worst = max(scene.accuracy.signal, *(of_strain(touch.signal_errors, scene.skin.strain) for touch in touches))
    sheet = scene.sheet(untouched_conductance(law, scene.skin))
    places = scene.body.surface.nearest(scene.places_m)[0].tolist()
    ends = [ContactEnd(tuple(place), max(touch.contact_radius_m, punch.fillet_m), punch.fillet_m)
            for place, touch, punch in zip(places, touches, scene.punches, strict=True)]
    return solve_touched(_untouched(scene.body, tuple(scene.electrodes.items())), contact_impedances(sheet), scene.skin,
                         law, OnSurfaceField(scene, field), ends, READINGS, ELECTRICS_SHARE * worst)


@lru_cache(maxsize=4)
def _untouched(body: CurvedBody, electrodes: tuple[tuple[str, Any], ...]) -> Facets:
    """The sheet of a body with its electrodes cut out."""
    return prepared(CurvedSkin(body.triangles, 1.0, **dict(electrodes)))


def write_skin(scene: CurvedScene, result: Result, law: Conductivity, path: Path, patterns: Sequence[int] | None = None
               ) -> None:
    """Write the fields of `curved_skin_fields` of a result as a VTU file, on triangles as exact as its readings;
    ValueError for an unknown pattern."""
    assert result.surface is not None, "only solved scenes have a surface"
    sheet = scene.sheet(untouched_conductance(law, scene.skin))
    rows = protocol(scene.drive, sheet.count).currents_A
    if unknown := [k for k in patterns or () if not 0 <= k < len(rows)]:
        raise ValueError(f"pattern {unknown[0]} is none of 0 to {len(rows) - 1}; patterns are counted from 0.")
    found = touched_sheet(scene, law, result.touches, result.surface)
    write_curved_skin(path, *curved_skin_fields(
        skin_mesh(found.facets, sheet.count), contact_impedances(sheet), scene.skin, law,
        OnSurfaceField(scene, result.surface),
        {k: rows[k] for k in (range(len(rows)) if patterns is None else patterns)}))


@dataclass(frozen=True, eq=False)
class OnSurfaceField:
    """A field at the places of a body's surface that are nearest to points of its triangles."""

    scene: CurvedScene
    field: SpaceField

    def near(self, points_m: Array) -> NDArray[np.bool_]:
        """As of `SpaceField`."""
        return self.field.near(points_m)

    def deformation_gradient(self, points_m: Array) -> Array:
        """As of `SpaceField`."""
        near, out = self.near(points_m), np.tile(np.eye(3), (len(points_m), 1, 1))
        out[near] = self.field.deformation_gradient(self.scene.body.surface.nearest(points_m[near])[0])
        return out

    def displacement(self, points_m: Array) -> Array:
        """As of `SpaceField`."""
        near, out = self.near(points_m), np.zeros_like(points_m)
        out[near] = self.field.displacement(self.scene.body.surface.nearest(points_m[near])[0])
        return out
