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
# Floors of both: 2 and 5 mm from an edge depths are within 0.1 % of an independent program; 8 mm from one dV by the
# principal strain is within 1.3 % of `solve_near_rim`, on FINE within 0.5 %.
_DEPTH_FLOOR = 1e-3
# Floor of signals, and the part of what edges and other punches change that is their floor.
SIGNAL_FLOOR, _OF_CHANGE = 1e-2, 0.06
# Part of what edges and other punches change that the way of loading may alter where a punch rubs, as near a rim.
_WAY = 0.1
# Predicted CPU time, s, up to which touches are solved on the finest level for the requested errors.
MOST_S = 100.0
# Factorisations on the finer mesh whose work the touches may take: usual ones take 5 to 20.
_FACTORISATIONS = 100
# Operations per second, factorisations and iterations of a usual touch with edges and others, CPU time of an element in
# an iteration, s, and the part of all this that each punch alone takes.
_PER_SECOND, _FACTORED, _ITERATIONS, _ELEMENT_S, _ALONE = 4e10, 5, 12, 2e-4, 0.45


@dataclass(frozen=True, eq=False)
class GeneralSolution:
    """Touches solved together."""

    touches: tuple[Touch, ...]  # one a punch; their arrays are means over the angle
    corrected: Corrected  # the layer on the finer mesh, with the field of its whole surface
    coarser: Corrected  # the same on the coarser mesh, by which errors are estimated
    cpu_s: float
    by_friction: Array  # (3,) part of the errors of signals, by scene.STRAINS, that friction leaves
    finest: bool  # whether it was solved on the finest level for the requested errors

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
    mesh: Array  # (3,) what the mesh leaves of the signals, by scene.STRAINS
    friction: Array  # (3,) what friction's increments and way of loading leave of them
    strains: Array  # (3,)

    @property
    def signals(self) -> Array:
        return self.mesh + self.friction

    def missed(self, requested: Array) -> bool:
        """Whether signals miss the requested errors (3,), and half of what the mesh leaves would do."""
        return bool(np.any((self.signals > requested) & (self.mesh / 2 + self.friction <= requested)))


def solve_general(law: Law, body: Body, punches: Sequence[Punch], *, level: Level = COARSE, coarser: Level = ROUGH,
                  bodies: Bodies = NO_BODIES, layout: Layout = FLAT, shapes: Sequence[PunchShape | None] = (),
                  requested: Array | None = None, finest: Level = FINE, near: CorrectedField | None = None
                  ) -> GeneralSolution:
    """Equilibrium of a layer, its bottom fixed and its sides free, with what is bonded to it, under rigid punches; flat
    or laid into space, then with the body's edge and the punches' x and y by coordinates of the layout.
    A punch that rubs holds the layer where it does so alone (`layer.grips`). Shapes (punches,), m, stand in place of
    the punches' profiles, which then are about what they are, for the start and the mesh; on the coarser mesh on every
    second line of their grids. Where there are none and the signals' errors
    exceed those requested (3,), by scene.STRAINS, for the mesh's sake, it is solved on the finest level as well, unless
    that would take more than MOST_S or finds no equilibrium. near: the field under about these loads, to start from.

    ValueError where a punch overhangs an edge or another punch; NotConverged where no equilibrium is found.
    """
    started, lone = cpu_s(), lone_touches(law, body, punches, layout)

    def on(each: Level, seen: Sequence[PunchShape | None] = shapes) -> LayerProblem:
        return problem(law, body, punches, lone, each, bodies, layout, seen)

    def better(model: LayerProblem, start: Solved | None, each: Level) -> Corrected:
        return corrected(equilibrium(model, lone, body.thickness_m, start), lone, each)

    first, model = on(coarser, [shape and shape.coarser for shape in shapes]), on(level)
    with bounded(_FACTORISATIONS, model.mesh.unknowns):
        rough = better(first, near and near.solved, coarser)
        fine = better(model, rough.solved, level)
    errors = _errors(rough, fine, punches, lone)
    refined, finest = False, replace(finest, reach=max(finest.reach, level.reach))
    if requested is not None and not any(shapes) and errors.missed(requested) and (
            predicted_cpu_s([model := on(finest)], [finest], lone) < MOST_S):
        with suppress(NotConverged), bounded(_FACTORISATIONS // 2, model.mesh.unknowns):
            rough, fine = fine, better(model, fine.solved, finest)
            errors, refined = _errors(rough, fine, punches, lone, finest.element / level.element), True
    spent = cpu_s() - started
    for k, shape in enumerate(shapes):
        if shape is not None and fine.depths[k] * body.thickness_m > shape.height:
            raise NotConverged(f"punch {k} (from 0) sinks in as a whole: its shape is {1e3 * shape.height:.3g} mm "
                               "high.")
    touches = [replace(touch_about(k, fine, rough, law, body), signal_errors=errors.signals, depth_error=float(error),
                       strain_errors=errors.strains, cpu_s=spent / len(punches),
                       slip_fraction=None if one.rubbed is None else one.rubbed.slip_fraction)
               for k, (one, error) in enumerate(zip(lone, errors.depths, strict=True))]
    return GeneralSolution(tuple(touches), fine, rough, spent, errors.friction, refined)


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
            share: float = 1.0) -> _Errors:
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
                   np.maximum(_SIGNAL_LEFT * np.array(signal), floor), rubbed[1], np.array(missed))


def _errors_of_friction(fine: Corrected, lone: Sequence[LoneTouch], changed: Array) -> tuple[Array, Array]:
    """What friction adds to the errors (punches,) of depths and (3,) of signals: those of its increments about each
    punch alone, and what the way of loading may alter of what edges and other punches change."""
    rubbed = [one.rubbed for one in lone if one.rubbed is not None]
    if not rubbed:
        return np.zeros(len(lone)), np.zeros(len(STRAINS))
    depths = [0.0 if one.rubbed is None else one.rubbed.depth_error + _WAY * abs(depth / one.state.depth - 1)
              for depth, one in zip(fine.depths.tolist(), lone, strict=True)]
    return np.array(depths), np.max([touch.signal_errors for touch in rubbed], axis=0) + _WAY * changed
