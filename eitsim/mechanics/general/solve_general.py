"""Touches of any number of rigid punches on a layer of any outline, solved together in three dimensions.

Each is solved alone first, axisymmetric on an endless layer; their sum is the start, and their contacts' ends say
where the mesh must be fine. The layer is solved on two meshes; from the difference come the errors.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.contact.punch_shape import PunchShape
from eitsim.mechanics.general.layer import layer_surface
from eitsim.mechanics.general.layer.equilibrium_of_many import LayerProblem
from eitsim.mechanics.general.layer.lone_touches import LoneTouch
from eitsim.mechanics.general.mesh_errors import Corrected, CorrectedField, corrected, problem_alone
from eitsim.mechanics.general.meshing.bodies import NO_BODIES, Bodies
from eitsim.mechanics.general.meshing.layer_layout import FLAT, Layout
from eitsim.mechanics.general.meshing.levels import COARSE, FINE, ROUGH, Level
from eitsim.mechanics.general.solved_layer import Solved, equilibrium, lone_touches, problem
from eitsim.mechanics.general.touch_of_field import touch_about
from eitsim.numerics.work_budget import bounded
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Punch
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s

# Error of the finer mesh over the difference of both, for depths and for signals.
_DEPTH_LEFT, _SIGNAL_LEFT = 0.5, 1.0
# Part of the mesh's errors of signals that the finest level is expected to leave: what sensors read of COARSE and FINE
# was 0.2 to 0.4 times what they read of ROUGH and COARSE in two scenes, and 1.7 times in a third, near an edge.
_FINEST_LEAVES = 0.4
# Floors of both: 2 and 5 mm from an edge depths are within 0.1 % of an independent program; 8 mm from one dV by the
# principal strain is within 1.3 % of `solve_near_rim`, on FINE within 0.5 %.
_DEPTH_FLOOR = 1e-3
# Floor of signals, and the part of what edges and other punches change that is their floor.
SIGNAL_FLOOR, _OF_CHANGE = 1e-2, 0.06
# Part of what edges and other punches change that the way of loading may alter where a punch rubs, as near a rim. Ten
# touches by Coulomb's law, loaded in 16 steps on ROUGH, differ by 0.01 to 0.12 of it under the strain in plane under
# flat punches and cones, one by 0.4, but two spheres next to a rim by 0.4 and 0.8: up to 1 % of the signal.
_WAY = 0.1
# Predicted CPU time, s, up to which touches are solved on the finest level for the requested errors.
MOST_S = 100.0
# Factorisations on the finer mesh whose work the touches may take: usual ones take 5 to 20.
_FACTORISATIONS = 100
# Operations per second, factorisations and iterations of a usual touch with edges and others, CPU time of an element in
# an iteration, s, and the part of all this that each punch alone takes.
_PER_SECOND, _FACTORED, _ITERATIONS, _ELEMENT_S, _ALONE = 4e10, 5, 12, 2e-4, 0.45


@dataclass(frozen=True, eq=False)
class PressedLayer:
    """A layer, its bottom fixed and its sides free, with what is bonded to it, under rigid punches; as of
    `solve_general`."""

    law: Law
    body: Body
    punches: tuple[Punch, ...]
    bodies: Bodies
    layout: Layout
    shapes: tuple[PunchShape | None, ...]
    lone: tuple[LoneTouch, ...]

    @property
    def roughly(self) -> "PressedLayer":
        """With shapes on every second line of their grids, as coarser meshes see them."""
        return replace(self, shapes=tuple(shape and shape.coarser for shape in self.shapes))

    def on(self, level: Level) -> LayerProblem:
        """Its problem on a mesh."""
        return problem(self.law, self.body, self.punches, self.lone, level, self.bodies, self.layout, self.shapes)

    def solved(self, model: LayerProblem, start: Solved | None, level: Level) -> Corrected:
        """Its equilibrium on the mesh of a level. NotConverged where none is found."""
        return corrected(equilibrium(model, self.lone, self.body.thickness_m, start), self.lone, level)


@dataclass(frozen=True, eq=False)
class GeneralSolution:
    """Touches solved together."""

    touches: tuple[Touch, ...]  # one a punch; their arrays are means over the angle
    corrected: Corrected  # the layer on the finer mesh, with the field of its whole surface
    coarser: Corrected  # the same on the coarser mesh, by which errors are estimated
    cpu_s: float
    by_friction: Array  # (3,) part of the errors of signals, by scene.STRAINS, that friction leaves
    of: PressedLayer
    level: Level  # of the finer mesh

    @property
    def field(self) -> CorrectedField:
        """How the whole surface is deformed."""
        return self.corrected.field

    @property
    def unknowns(self) -> int:
        """Of the finer mesh, and of those of each punch alone."""
        return self.corrected.unknowns


@dataclass(frozen=True, eq=False)
class _Errors:
    """Relative errors by two meshes."""

    depths: Array  # (punches,) of depths, or of forces at given depths
    signals: Array  # (3,) by scene.STRAINS
    friction: Array  # (3,) part of them that friction's increments and way of loading leave
    strains: Array  # (3,)


def solve_general(law: Law, body: Body, punches: Sequence[Punch], *, level: Level = COARSE, coarser: Level = ROUGH,
                  bodies: Bodies = NO_BODIES, layout: Layout = FLAT, shapes: Sequence[PunchShape | None] = (),
                  near: CorrectedField | None = None) -> GeneralSolution:
    """Equilibrium of a layer, its bottom fixed and its sides free, with what is bonded to it, under rigid punches; flat
    or laid into space, then with the body's edge and the punches' x and y by coordinates of the layout.
    A punch that rubs holds the layer where it does so alone (`layer.grips`). Shapes (punches,), m, stand in place of
    the punches' profiles, which then are about what they are, for the start and the mesh; on the coarser mesh on every
    second line of their grids. near: the field under about these loads, to start from.

    ValueError where a punch overhangs an edge or another punch; NotConverged where no equilibrium is found.
    """
    started = cpu_s()
    lone = lone_touches(law, body, punches, layout)
    of = PressedLayer(law, body, tuple(punches), bodies, layout, tuple(shapes), lone)
    first, model = of.roughly.on(coarser), of.on(level)
    with bounded(_FACTORISATIONS, model.mesh.unknowns):
        rough = of.solved(first, near and near.solved, coarser)
        fine = of.solved(model, rough.solved, level)
    return _compared(of, rough, fine, level, cpu_s() - started)


def solved_finer(found: GeneralSolution, errors: Array, requested: Array, finest: Level = FINE
                 ) -> GeneralSolution | None:
    """The same on the finest level, compared with the finer mesh that it has, where errors (3,) of the signals, by
    scene.STRAINS, exceed those requested, what it is expected to leave of the mesh's part would do, and it takes less
    than MOST_S; None where not, or where it finds no equilibrium."""
    expected, started = found.by_friction + _FINEST_LEAVES * (errors - found.by_friction), cpu_s()
    helps = (errors > requested) & (expected <= requested)
    if not np.any(helps) or finest.element >= found.level.element:
        return None
    of, rough, finest = found.of, found.corrected, replace(finest, reach=max(finest.reach, found.level.reach))
    model = of.on(finest)
    if predicted_cpu_s([model], [finest], of.lone) >= MOST_S:
        return None
    with suppress(NotConverged), bounded(_FACTORISATIONS // 2, model.mesh.unknowns):
        if any(of.shapes):
            rough = of.solved(of.roughly.on(found.level), rough.solved, found.level)
        fine = of.solved(model, found.corrected.solved, finest)
        return _compared(of, rough, fine, finest, found.cpu_s + cpu_s() - started)
    return None


def _compared(of: PressedLayer, rough: Corrected, fine: Corrected, level: Level, spent: float) -> GeneralSolution:
    """The touches on the mesh of a level, with errors by a coarser one. NotConverged where a shape sinks in."""
    for k, shape in enumerate(of.shapes):
        if shape is not None and fine.depths[k] * of.body.thickness_m > shape.height:
            raise NotConverged(f"punch {k} (from 0) sinks in as a whole: its shape is {1e3 * shape.height:.3g} mm "
                               "high.")
    errors = _errors(rough, fine, of.punches, of.lone, level.element / COARSE.element)
    touches = [replace(touch_about(k, fine, rough, of.law, of.body), signal_errors=errors.signals,
                       depth_error=float(error), strain_errors=errors.strains, cpu_s=spent / len(of.punches),
                       slip_fraction=None if one.rubbed is None else one.rubbed.slip_fraction)
               for k, (one, error) in enumerate(zip(of.lone, errors.depths, strict=True))]
    return GeneralSolution(tuple(touches), fine, rough, spent, errors.friction, of, level)


def predicted_cpu_s(whole: Sequence[LayerProblem], levels: Sequence[Level], lone: Sequence[LoneTouch]) -> float:
    """CPU seconds that problems on meshes of these levels take, with each punch alone on them, by the order of
    elimination."""
    alone = [problem_alone(model, k, each, one.curvature) for model, each in zip(whole, levels, strict=True)
             for k, one in enumerate(lone)]
    together, each = (sum(_FACTORED * model.tree.operations / _PER_SECOND
                          + _ITERATIONS * _ELEMENT_S * len(model.mesh.elements) for model in some)
                      for some in (whole, alone))
    return together + _ALONE * each


def _changed(fine: Corrected) -> Array:
    """(3,) What edges and other punches change of the signals, relative, by scene.STRAINS."""
    points, areas = layer_surface.surface_points(fine.solved.field)
    whole, alone = (layer_surface.nominal_moments(field, points, areas) for field in (fine.field, fine.field.exact))
    return np.linalg.norm(whole - alone, axis=(1, 2)) / np.linalg.norm(whole, axis=(1, 2))


def _errors(rough: Corrected, fine: Corrected, punches: Sequence[Punch], lone: Sequence[LoneTouch],
            share: float) -> _Errors:
    """From two meshes; share: the part that the finer one leaves of the floors of COARSE."""
    held, changed = np.array([punch.force_N is None for punch in punches]), _changed(fine)
    depth = np.abs(np.where(held, rough.forces / fine.forces, rough.depths / fine.depths) - 1)
    points, areas = layer_surface.surface_points(fine.solved.field)
    moments = [layer_surface.nominal_moments(each.field, points, areas) for each in (rough, fine)]
    strains = [layer_surface.strains_at(each.field, points) for each in (rough, fine)]
    signal = [float(np.linalg.norm(a - b) / np.linalg.norm(b)) for a, b in zip(*moments, strict=True)]
    missed = [float(np.sqrt(areas @ (a - b) ** 2 / (areas @ b**2))) for a, b in zip(*strains, strict=True)]
    floor = share * np.maximum(_OF_CHANGE * changed, SIGNAL_FLOOR)
    rubbed = _errors_of_friction(fine, lone, changed)
    return _Errors(np.maximum(_DEPTH_LEFT * depth, _DEPTH_FLOOR) + rubbed[0],
                   np.maximum(_SIGNAL_LEFT * np.array(signal), floor) + rubbed[1], rubbed[1], np.array(missed))


def _errors_of_friction(fine: Corrected, lone: Sequence[LoneTouch], changed: Array) -> tuple[Array, Array]:
    """What friction adds to the errors (punches,) of depths and (3,) of signals: those of its increments about each
    punch alone, and what the way of loading may alter of what edges and other punches change."""
    rubbed = [one.rubbed for one in lone if one.rubbed is not None]
    if not rubbed:
        return np.zeros(len(lone)), np.zeros(len(STRAINS))
    depths = [0.0 if one.rubbed is None else one.rubbed.depth_error + _WAY * abs(depth / one.state.depth - 1)
              for depth, one in zip(fine.depths.tolist(), lone, strict=True)]
    return np.array(depths), np.max([touch.signal_errors for touch in rubbed], axis=0) + _WAY * changed
