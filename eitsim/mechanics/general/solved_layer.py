"""The layer's equilibrium on one mesh: from the sum of its punches' lone touches, or by way of part of the load."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit
from eitsim.mechanics.contact.punch_shape import PunchShape
from eitsim.mechanics.general.layer import equilibrium_of_many as many
from eitsim.mechanics.general.layer import layer_surface
from eitsim.mechanics.general.layer.equilibrium_of_many import LayerProblem, Press
from eitsim.mechanics.general.layer.grips import grip_of
from eitsim.mechanics.general.layer.layer_field import LayerField
from eitsim.mechanics.general.layer.lone_touches import LoneTouch, added_up, lone_touch
from eitsim.mechanics.general.layer.pose import posed
from eitsim.mechanics.general.meshing.bodies import NO_BODIES, Bodies
from eitsim.mechanics.general.meshing.layer_layout import FLAT, Layout, curvatures
from eitsim.mechanics.general.meshing.levels import Level, layer_mesh
from eitsim.mechanics.general.meshing.surface_places import inside
from eitsim.mechanics.general.meshing.wedge import shapes
from eitsim.numerics.newton import Minimum
from eitsim.numerics.work_budget import used_up
from eitsim.scene.scene import Body, Punch
from matcal.laws.law import Law, over
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# How often the load is halved for a start where the equilibrium is not found from the sum of the lone touches.
_HALVINGS = 4
_BISECTIONS = 40
_SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5)  # Shares of the sum of the lone touches that are tried as a start.
_SPHERICAL = 1e-6  # Difference of principal curvatures, over the thickness, up to which a surface is a sphere's.


@dataclass(frozen=True, eq=False)
class Solved:
    """The layer's equilibrium on one mesh."""

    model: LayerProblem
    x: Array  # (unknowns + punches,) as in `equilibrium_of_many`
    residuals: tuple[float, ...]
    depths: Array  # (punches,) thicknesses from where a posed one begins to touch, without the contacts' penetration
    field: LayerField


def upright_where_they_rub(punches: Sequence[Punch]) -> None:
    """ValueError where a punch that leans rubs: about it no lone touch says what is held."""
    if any(punch.tilt_rad and punch.friction != "none" for punch in punches):
        raise ValueError("friction in [punch] is built for upright punches; leave it out where tilt_deg is not 0.")


def lone_touches(law: Law, body: Body, punches: Sequence[Punch], layout: Layout = FLAT) -> tuple[LoneTouch, ...]:
    """Each punch's touch far from edges and others, upright on a cap of the surface's mean curvature there; ValueError
    where one that leans rubs."""
    upright_where_they_rub(punches)
    return tuple(_lone(law, body, punch, layout) for punch in punches)


def _lone(law: Law, body: Body, punch: Punch, layout: Layout) -> LoneTouch:
    low, high = curvatures(layout, np.array([punch.x_m, punch.y_m]) / body.thickness_m)
    mean = lone_touch(law, body, punch, (low + high) / 2)
    if high - low < _SPHERICAL:
        return mean
    return replace(mean, others=tuple(lone_touch(law, body, punch, one).zone for one in (low, high)))


def problem(law: Law, body: Body, punches: Sequence[Punch], lone: Sequence[LoneTouch], level: Level,
            bodies: Bodies = NO_BODIES, layout: Layout = FLAT,
            shapes: Sequence[PunchShape | None] = ()) -> LayerProblem:
    """The layer under its punches, whose x and y are coordinates of the layout, on a mesh of a level; bodies: as of
    `layer_mesh`; shapes (m): as of `solve_general`."""
    centres = np.array([[punch.x_m, punch.y_m] for punch in punches]) / body.thickness_m
    mesh = layer_mesh(body, centres, tuple(one.zone for one in lone), tuple(one.feature for one in lone), level,
                      bodies=bodies, layout=layout)
    unit = force_unit(law, body)
    rigid = [one.model.punch if shape is None else replace(one.model.punch, shape=shape.scaled(body.thickness_m))
             for one, shape in zip(lone, shapes or [None] * len(lone), strict=True)]
    presses = tuple(posed(Press(own, centre, None if punch.force_N is None else punch.force_N / unit,
                                one.state.force, grip_of(one.model)), punch, layout)
                    for one, own, centre, punch in zip(lone, rigid, centres, punches, strict=True))
    return LayerProblem(over(law, law.mu_0_Pa), mesh, presses)


def equilibrium(model: LayerProblem, lone: tuple[LoneTouch, ...], thickness_m: float, near: Solved | None = None
                ) -> Solved:
    """Its equilibrium, started from one on a coarser mesh, or under about these loads, where there is one. NotConverged
    where none is found."""
    minimum = _reached(model, lone, _start(model, lone, near), _HALVINGS)
    held = [one.state.x[-1] - one.state.depth if press.force is None else 0.0
            for one, press in zip(lone, model.presses, strict=True)]
    field = LayerField(model.mesh, many.split(model, minimum.x)[0], thickness_m, ())
    curves = layer_surface.contact_curves(model, minimum.x, field)
    first = [press.pose.first if press.pose else 0.0 for press in model.presses]
    return Solved(model, minimum.x, minimum.residuals, many.corrected_depths(model, minimum) - held - first,
                  replace(field, contact_curves_m=curves))


def _start(model: LayerProblem, lone: tuple[LoneTouch, ...], near: Solved | None) -> Array:
    """A near equilibrium, or the sum of the lone touches where there is none or it turns something inside out."""
    if near is not None:
        moved = _carried_over(near.field, model.mesh.coordinates)
        start = np.append(moved[model.mesh.unknown >= 0], near.x[-len(model.presses):])
        if np.isfinite(many.energy(model, start)):
            return start
    return _upright(model, added_up(lone, model))


def _carried_over(field: LayerField, points: Array) -> Array:
    """Displacements (n, 3), thicknesses, at points (n, 3) of the layer by coordinates; 0 where its mesh has ended."""
    out, (element, reference) = np.zeros((len(points), 3)), inside(field.mesh, points)
    there = element >= 0
    value, _ = shapes(reference[there])
    out[there] = np.einsum("na,nai->ni", value, field.moved[field.mesh.elements[element[there]]])
    return out


def _upright(model: LayerProblem, start: Array) -> Array:
    """The largest share of a start that does not turn the layer inside out between the points of a coarse mesh; depths
    that are given stay."""
    given = np.zeros(len(start), dtype=bool)
    given[-len(model.presses):] = [press.force is None for press in model.presses]
    tried = (np.where(given, start, share * start) for share in _SHARES)
    return next((each for each in tried if np.isfinite(many.energy(model, each))), start)


def _reached(model: LayerProblem, lone: tuple[LoneTouch, ...], start: Array, halvings: int) -> Minimum:
    """The equilibrium from a start; else by way of half the load."""
    try:
        return many.solve(model, _touching(model, start))
    except NotConverged:
        if halvings == 0 or used_up():
            raise
    held = start[model.mesh.unknowns:]
    easier = replace(model, presses=tuple(replace(p, force=None if p.force is None else p.force / 2)
                                          for p in model.presses))
    depths = np.where([p.force is None for p in model.presses], held / 2, 0.0)
    half = _reached(easier, lone, np.append(start[:-len(held)] / 2, np.where(depths > 0, depths, held / 2)),
                    halvings - 1)
    ahead = half.x.copy()
    ahead[model.mesh.unknowns:] = np.where(depths > 0, held, ahead[model.mesh.unknowns:])
    return many.solve(model, _touching(model, ahead))


def _touching(model: LayerProblem, x: Array) -> Array:
    """A start with punches that do not touch the layer so deep that their contacts balance their forces: by bisection.
    """
    low, high = x.copy(), x.copy()
    off = np.flatnonzero((many.reactions(model, x) == 0) & [press.force is not None for press in model.presses])
    high[model.mesh.unknowns + off] += 1.0
    force = np.array([press.force or 0.0 for press in model.presses])
    for _ in range(_BISECTIONS if len(off) else 0):
        middle = (low + high) / 2
        over = model.mesh.unknowns + off[many.reactions(model, middle)[off] > force[off]]
        under = np.setdiff1d(model.mesh.unknowns + off, over)
        high[over], low[under] = middle[over], middle[under]
    return high
