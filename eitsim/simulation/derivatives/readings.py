"""Derivatives of a scene's readings by its touches, its card's parameters and its contact impedances.

dV/dp = -int grad w . dS/dp . grad u on one mesh (`eitsim.electrics.cem.adjoint`), u the touched field, w that of the
measuring electrodes. Exact: c0 and contact impedances. dS/dp is a central difference of the conductance field, never of
voltages, for all others (`eitsim.simulation.derivatives.conductance_variation`): of the field moved with its punch for
x and y; of that of the touch's tangent (`eitsim.simulation.derivatives.tangent`) for force, depth, diameter and the
foam's law; for a_1, a_2, a_3, in which the field is linear, it is exact but for rounding. Near the rim, what it changes
is solved anew for each side of a parameter.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitsim.electrics.cem.adjoint import impedance_by_contact, impedance_by_field, readings_by
from eitsim.electrics.cem.assembly import Array, centred, dissection, potentials, quadrature_points
from eitsim.electrics.forward.skins import skin_of
from eitsim.electrics.mesh.p2_triangles import HALVINGS, uniform_refinement
from eitsim.mechanics.solid.volume_projection import projects
from eitsim.scene.drive import read_out, voltage_columns
from eitsim.scene.electrodes import among_all, contact_impedances, present, there
from eitsim.scene.scene import Scene
from eitsim.sheet.sheet_conductance import touched_conductance, untouched_conductance
from eitsim.simulation.choose import choose, choose_ways
from eitsim.simulation.derivatives.conductance_variation import conductance_change, variations
from eitsim.simulation.derivatives.tangent import settled
from eitsim.simulation.material import material_of
from eitsim.simulation.words import refusal
from matcal.card import MaterialCard
from touchcal.csv_numbers import cells


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Readings and their derivatives; readings pattern-major."""

    parameters: tuple[str, ...]  # (p,) names of the parameters as in a data set, units in them
    # (readings,) touched, V, and what the touches change of it, V; NaN where an electrode without contact is needed
    touched_V: Array
    signal_V: Array
    # (readings, p) derivatives of both, V a unit
    touched_by: Array
    signal_by: Array


def scene_sensitivity(scene: Scene, card: MaterialCard, *, halvings: int = HALVINGS) -> Sensitivity:
    """Derivatives of a scene's readings; its touches are solved on the default mesh of the foam.

    Parameters: those of variation.variations, c0_S_per_m, and z_k_Ohm_m or, of patches, z_k_Ohm_m2, the contact
    impedance of electrode k from 0. On an outline the mesh is that of readings halved once less: on a disc given as 400
    corners those of a touch and of laws are within 0.02 % of the disc's, by z_k within 0.9 %. On a disc the mesh is
    that of readings with thinner rings, halved so often. On the default one they are within 0.3 % of those on a finer
    one, but for those by z_k, whose currents crowd at the electrodes' ends: 63 of 64 are within 1.2 %, the last, with
    blunt triangles there, is 3.1 % off, its dV 1.5 % (against an integral equation on the rim and a finer mesh;
    benchmarks/sensitivity.py). Near the rim (14 mm, 1 N, a gap of 20 mm) they differ from central differences of scenes
    solved anew by 0.5 (x), 1.7 (y), 0.9 (d) and 0.6 % (F, of steps of 0.0075 N; 2.2 and 3.6 % of twice and four times
    those, whose own errors grow).
    ValueError where the plan refuses the scene, with friction, with a punch that leans or conducts, for touches solved
    together or near the edge of an outline, for a contact that reaches an electrode on the surface, and for a hold;
    NotConverged where the mechanics does not converge.
    """
    material = material_of(scene, card)
    chosen = choose(scene, material, bodies=False)
    if chosen.why is not None:
        raise ValueError(refusal(chosen.why))
    check_differentiable(scene)
    if projects(material.law) and any(way.case.near for way in chosen.ways):
        raise ValueError("sensitivities are not built for a touch near an edge of what nearly keeps its volume. "
                         "Move the punch inwards, or ask for less accuracy (a larger signal in [accuracy]).")
    law, skin_law = material.law, material.skin
    bases = [settled(law, scene.body, way.case.punch, near_rim=way.case.near) for way in chosen.ways]
    touches = tuple((base.punch, base.touch) for base in bases)
    electrodes = present(scene.electrodes)
    free = untouched_conductance(skin_law, scene.skin)
    skin = skin_of(scene.body, electrodes, free)
    rooms, (mesh, halved) = skin.rooms_m(touches), skin.sensitivity_mesh(touches)
    for _ in range(halvings - halved):
        mesh = uniform_refinement(mesh)
    z = contact_impedances(electrodes)
    field = touched_conductance(quadrature_points(mesh), touches, scene.skin, skin_law)
    rest = np.broadcast_to(free * np.eye(2), field.shape)
    order = dissection(mesh)
    touched, untouched = (potentials(mesh, sheet, z, order=order) for sheet in (field, rest))
    by_field = {v.name: impedance_by_field(mesh, touched, conductance_change(mesh, scene.skin, v))
                for v in variations(mesh.nodes_m, bases, skin_law, rooms)}
    both = [np.concatenate([impedance_by_field(mesh, u, sheet / skin_law.c0_S_per_m)[None],
                            impedance_by_contact(mesh, u, z)]) for u, sheet in ((touched, field), (untouched, rest))]
    by_touch, whole, baseline = (
        readings_by(scene.drive, np.stack([among_all(scene.electrodes, one) for one in part]))
        for part in (by_field.values(), *both))
    voltages, before = (read_out(scene.drive, among_all(scene.electrodes, centred(mesh, u)[len(mesh.nodes_m):])).ravel()
                        for u in (touched, untouched))
    unit = electrodes.impedance_key.removeprefix("contact_impedance_")
    contacts = (f"z_{k}_{unit}" for k in np.flatnonzero(there(scene.electrodes)))
    return Sensitivity((*by_field, "c0_S_per_m", *contacts), voltages, voltages - before,
                       np.hstack([by_touch, whole]), np.hstack([by_touch, whole - baseline]))


def write_sensitivity(sensitivity: Sensitivity, path: Path) -> None:
    """A CSV of one row a reading, touched as v_000, v_001, ..., then what the touches change as dv_000, ...; columns
    reading, value_V and one a parameter: the derivative, V over the parameter's unit; empty where an electrode is
    missing."""
    blocks = (("v", sensitivity.touched_V, sensitivity.touched_by), ("dv", sensitivity.signal_V, sensitivity.signal_by))
    with open(path, "w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["reading", "value_V", *sensitivity.parameters])
        for prefix, values, slopes in blocks:
            rows.writerows([name, *row] for name, row in zip(
                voltage_columns(len(values), prefix), cells(np.column_stack([values, slopes])), strict=True))


def check_differentiable(scene: Scene) -> None:
    """ValueError with the reason where a scene that can be solved has no derivatives here, and with what has."""
    if problem := _problem(scene):
        raise ValueError(f"sensitivities are not built for {problem}")


def _problem(scene: Scene) -> str:
    if scene.skin.fills:
        return ("a layer that conducts in its volume, whose readings depend on strain inside it; give "
                "kind = \"coating\" in [skin], or differences of two runs.")
    ways, clusters = choose_ways(scene, bodies=False)
    if scene.body.has_outline and any(way.case.near for way in ways):
        return ("a touch near the edge of an outline, where their meshes do not resolve what the edge changes: of a "
                "punch 12 mm from one those by place were 4 and 13 % off. Move the punch inwards, or ask for less "
                "accuracy (a larger signal in [accuracy]), which leaves edges out.")
    if scene.hold.time_s:
        return "a hold; leave out time_s in [hold]."
    if clusters:
        return "touches solved together; give one [punch], or move them further from each other."
    if scene.channels.there:
        return "calibrated channels; give [electrodes] without calibrated, or leave out [channels]."
    for punch in scene.punches:
        if not punch.axisymmetric:
            return "a punch that leans or has a shape; leave out tilt_deg and shape in [punch]."
        if punch.friction != "none":
            return f"friction = \"{punch.friction}\" in [punch], where the touch depends on its way; leave it out."
        if punch.conductor:
            return ("conductor = true in [punch], where readings depend on the end of the contact, which moves on the "
                    "foam's mesh in steps; leave it out.")
    return ""
