"""Touches of any number of rigid punches on a layer of any outline, solved together in three dimensions.

Each is solved alone first, axisymmetric on an endless layer; their sum is the start, and their contacts' ends say
where the mesh must be fine. The layer is solved on two meshes; from the difference come the errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.contact.punch_shape import PunchShape
from eitsim.mechanics.general.layer import layer_surface
from eitsim.mechanics.general.layer.lone_touches import LoneTouch
from eitsim.mechanics.general.mesh_errors import Corrected, CorrectedField, corrected, problem_alone
from eitsim.mechanics.general.meshing.bodies import NO_BODIES, Bodies
from eitsim.mechanics.general.meshing.layer_layout import FLAT, Layout
from eitsim.mechanics.general.meshing.levels import COARSE, ROUGH, Level
from eitsim.mechanics.general.solved_layer import equilibrium, lone_touches, problem
from eitsim.mechanics.general.touch_of_field import touch_about
from eitsim.numerics.work_budget import bounded
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Punch
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.jit import cpu_s

# Error of the finer mesh over the difference of both, for depths and for signals.
_DEPTH_LEFT, _SIGNAL_LEFT = 0.5, 1.0
# Floors of both: 2 and 5 mm from an edge depths are within 0.1 % of an independent program; 8 mm from one dV by the
# principal strain is within 1.3 % of `solve_near_rim`, on FINE within 0.5 %.
_DEPTH_FLOOR = 1e-3
# Floor of signals, and the part of what edges and other punches change that is their floor.
_SIGNAL_FLOOR, _OF_CHANGE = 1e-2, 0.06
# Part of what edges and other punches change that the way of loading may alter where a punch rubs, as near a rim.
_WAY = 0.1
# Factorisations on the finer mesh whose work the touches may take: usual ones take 20 to 40.
_FACTORISATIONS = 100
# Bytes of a number of the factors and of an element's matrix, with what is kept of both at a time; and what the program
# takes itself.
_BYTES_ENTRY, _BYTES_ELEMENT, _BYTES_BASE = 12, 60_000, 300e6
# Operations per second, iterations of a usual touch with edges and others and of each punch alone, and CPU time of an
# element in one of them, s.
_PER_SECOND, _ITERATIONS, _ALONE, _ELEMENT_S = 3e10, 14, 7, 1e-4


@dataclass(frozen=True, eq=False)
class GeneralSolution:
    """Touches solved together."""

    touches: tuple[Touch, ...]  # one a punch; their arrays are means over the angle
    corrected: Corrected  # the layer on the finer mesh, with the field of its whole surface
    coarser: Corrected  # the same on the coarser mesh, by which errors are estimated
    cpu_s: float

    @property
    def field(self) -> CorrectedField:
        """How the whole surface is deformed."""
        return self.corrected.field

    @property
    def unknowns(self) -> int:
        """Of the finer mesh, and of those of each punch alone."""
        return self.corrected.unknowns


@dataclass(frozen=True)
class Cost:
    """What a solution takes, predicted from its meshes."""

    unknowns: int
    memory_bytes: float
    cpu_s: float


def solve_general(law: Law, body: Body, punches: Sequence[Punch], *, level: Level = COARSE, coarser: Level = ROUGH,
                  bonded: bool = False, bodies: Bodies = NO_BODIES, layout: Layout = FLAT,
                  shapes: Sequence[PunchShape | None] = ()) -> GeneralSolution:
    """Equilibrium of a layer, its bottom fixed and its sides free or bonded, with what is bonded to it, under rigid
    punches; flat or laid into space, then with the body's edge and the punches' x and y by coordinates of the layout.
    A punch that rubs holds the layer where it does so alone (`layer.grips`). Shapes (punches,), m, stand in place of
    the punches' profiles, which then are about what they are, for the start and the mesh.

    ValueError where a punch overhangs an edge or another punch; NotConverged where no equilibrium is found.
    """
    started, lone = cpu_s(), lone_touches(law, body, punches, layout)
    models = [problem(law, body, punches, lone, each, bonded, bodies, layout, shapes) for each in (coarser, level)]
    with bounded(_FACTORISATIONS, models[-1].mesh.unknowns):
        first = equilibrium(models[0], lone, body.thickness_m)
        rough = corrected(first, lone, coarser)
        fine = corrected(equilibrium(models[1], lone, body.thickness_m, first), lone, level)
    changed = _changed(fine)
    depth_errors, signal_errors, strain_errors = _errors(rough, fine, punches, changed)
    by_friction = _errors_of_friction(fine, lone, changed)
    depth_errors, signal_errors = depth_errors + by_friction[0], signal_errors + by_friction[1]
    spent = cpu_s() - started
    touches = [replace(touch_about(k, fine, rough, law, body), signal_errors=signal_errors, depth_error=float(error),
                       strain_errors=strain_errors, cpu_s=spent / len(punches),
                       slip_fraction=None if one.rubbed is None else one.rubbed.slip_fraction)
               for k, (one, error) in enumerate(zip(lone, depth_errors, strict=True))]
    return GeneralSolution(tuple(touches), fine, rough, spent)


def predicted_cost(law: Law, body: Body, punches: Sequence[Punch], *, level: Level = COARSE, coarser: Level = ROUGH,
                   layout: Layout = FLAT) -> Cost:
    """What `solve_general` takes, from the lone touches and the order of elimination, without solving."""
    lone = lone_touches(law, body, punches, layout)
    whole = [problem(law, body, punches, lone, each, layout=layout) for each in (coarser, level)]
    alone = [problem_alone(model, k, each, one.curvature) for model, each in zip(whole, (coarser, level), strict=True)
             for k, one in enumerate(lone)]
    fine = whole[-1]
    memory = _BYTES_BASE + _BYTES_ENTRY * fine.tree.entries + _BYTES_ELEMENT * len(fine.mesh.elements)
    together, each = (sum(model.tree.operations / _PER_SECOND + _ELEMENT_S * len(model.mesh.elements) for model in some)
                      for some in (whole, alone))
    unknowns = fine.mesh.unknowns + sum(model.mesh.unknowns for model in alone[-len(punches):])
    return Cost(unknowns, memory, _ITERATIONS * together + _ALONE * each)


def _changed(fine: Corrected) -> Array:
    """(3,) What edges and other punches change of the signals, relative, by scene.STRAINS."""
    points, areas = layer_surface.surface_points(fine.solved.field)
    whole, alone = (layer_surface.nominal_moments(field, points, areas) for field in (fine.field, fine.field.exact))
    return np.linalg.norm(whole - alone, axis=(1, 2)) / np.linalg.norm(whole, axis=(1, 2))


def _errors(rough: Corrected, fine: Corrected, punches: Sequence[Punch], changed: Array
            ) -> tuple[Array, Array, Array]:
    """Relative errors (punches,) of depths, or of forces at given depths, and (3,) of signals and of strains, by
    scene.STRAINS."""
    held = np.array([punch.force_N is None for punch in punches])
    depth = np.abs(np.where(held, rough.forces / fine.forces, rough.depths / fine.depths) - 1)
    points, areas = layer_surface.surface_points(fine.solved.field)
    moments = [layer_surface.nominal_moments(each.field, points, areas) for each in (rough, fine)]
    strains = [layer_surface.strains_at(each.field, points) for each in (rough, fine)]
    signal = [float(np.linalg.norm(a - b) / np.linalg.norm(b)) for a, b in zip(*moments, strict=True)]
    missed = [float(np.sqrt(areas @ (a - b) ** 2 / (areas @ b**2))) for a, b in zip(*strains, strict=True)]
    floor = np.maximum(_OF_CHANGE * changed, _SIGNAL_FLOOR)
    return (np.maximum(_DEPTH_LEFT * depth, _DEPTH_FLOOR), np.maximum(_SIGNAL_LEFT * np.array(signal), floor),
            np.array(missed))


def _errors_of_friction(fine: Corrected, lone: Sequence[LoneTouch], changed: Array) -> tuple[Array, Array]:
    """What friction adds to the errors (punches,) of depths and (3,) of signals: those of its increments about each
    punch alone, and what the way of loading may alter of what edges and other punches change."""
    rubbed = [one.rubbed for one in lone if one.rubbed is not None]
    if not rubbed:
        return np.zeros(len(lone)), np.zeros(len(STRAINS))
    depths = [0.0 if one.rubbed is None else one.rubbed.depth_error + _WAY * abs(depth / one.state.depth - 1)
              for depth, one in zip(fine.depths.tolist(), lone, strict=True)]
    return np.array(depths), np.max([touch.signal_errors for touch in rubbed], axis=0) + _WAY * changed
