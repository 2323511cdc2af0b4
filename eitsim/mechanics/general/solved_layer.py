"""The layer's equilibrium on one mesh: from the sum of its punches' lone touches, or by way of part of the load."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit
from eitsim.mechanics.general.layer import equilibrium_of_many as many
from eitsim.mechanics.general.layer import layer_surface
from eitsim.mechanics.general.layer.equilibrium_of_many import LayerProblem, Press
from eitsim.mechanics.general.layer.grips import grip_of
from eitsim.mechanics.general.layer.layer_field import LayerField
from eitsim.mechanics.general.layer.lone_touches import LoneTouch, added_up, lone_touch
from eitsim.mechanics.general.meshing.bodies import NO_BODIES, Bodies
from eitsim.mechanics.general.meshing.levels import Level, layer_mesh
from eitsim.numerics.newton import Minimum
from eitsim.scene.scene import Body, Punch
from matcal.laws.law import Law, over
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# How often the load is halved for a start where the equilibrium is not found from the sum of the lone touches.
_HALVINGS = 4


@dataclass(frozen=True, eq=False)
class Solved:
    """The layer's equilibrium on one mesh."""

    model: LayerProblem
    x: Array  # (unknowns + punches,) as in `equilibrium_of_many`
    residuals: tuple[float, ...]
    depths: Array  # (punches,) thicknesses, without the contacts' penetration
    field: LayerField


def lone_touches(law: Law, body: Body, punches: Sequence[Punch]) -> tuple[LoneTouch, ...]:
    """Each punch's touch far from edges and others."""
    return tuple(lone_touch(law, body, punch) for punch in punches)


def problem(law: Law, body: Body, punches: Sequence[Punch], lone: Sequence[LoneTouch], level: Level,
            bonded: bool = False, bodies: Bodies = NO_BODIES) -> LayerProblem:
    """The layer under its punches on a mesh of a level; bodies: as of `layer_mesh`."""
    centres = np.array([[punch.x_m, punch.y_m] for punch in punches]) / body.thickness_m
    mesh = layer_mesh(body, centres, tuple(one.zone for one in lone), tuple(one.feature for one in lone), level,
                      bonded=bonded, bodies=bodies)
    unit = force_unit(law, body)
    presses = tuple(Press(one.model.punch, centre, None if punch.force_N is None else punch.force_N / unit,
                          one.state.force, grip_of(one.model))
                    for one, centre, punch in zip(lone, centres, punches, strict=True))
    return LayerProblem(over(law, law.mu_0_Pa), mesh, presses)


def equilibrium(model: LayerProblem, lone: tuple[LoneTouch, ...], thickness_m: float) -> Solved:
    """Its equilibrium. NotConverged where none is found."""
    minimum = _reached(model, lone, added_up(lone, model), _HALVINGS)
    held = [one.state.x[-1] - one.state.depth if press.force is None else 0.0
            for one, press in zip(lone, model.presses, strict=True)]
    field = LayerField(model.mesh, many.split(model, minimum.x)[0], thickness_m, ())
    curves = layer_surface.contact_curves(model, minimum.x, field)
    return Solved(model, minimum.x, minimum.residuals, many.corrected_depths(model, minimum) - held,
                  replace(field, contact_curves_m=curves))


def _reached(model: LayerProblem, lone: tuple[LoneTouch, ...], start: Array, halvings: int) -> Minimum:
    """The equilibrium from a start; else by way of half the load."""
    try:
        return many.solve(model, start)
    except NotConverged:
        if halvings == 0:
            raise
    held = start[model.mesh.unknowns:]
    easier = replace(model, presses=tuple(replace(p, force=None if p.force is None else p.force / 2)
                                          for p in model.presses))
    depths = np.where([p.force is None for p in model.presses], held / 2, 0.0)
    half = _reached(easier, lone, np.append(start[:-len(held)] / 2, np.where(depths > 0, depths, held / 2)),
                    halvings - 1)
    ahead = half.x.copy()
    ahead[model.mesh.unknowns:] = np.where(depths > 0, held, ahead[model.mesh.unknowns:])
    return many.solve(model, ahead)
