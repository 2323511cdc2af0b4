"""What a mesh leaves of each punch alone, taken away from what it leaves of all of them.

Next to a contact's end a mesh in three dimensions leaves far more than an axisymmetric one, and about as much whether
edges and other punches are near or not. The same punch alone on the same section shows it; in its place comes the
axisymmetric touch. A punch that leans so far that it touches on one side of its axis alone has no such lone touch, and
keeps what its mesh says.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric import surface
from eitsim.mechanics.general.layer import equilibrium_of_many as many
from eitsim.mechanics.general.layer import layer_surface
from eitsim.mechanics.general.layer.equilibrium_of_many import LayerProblem
from eitsim.mechanics.general.layer.layer_field import LayerField, metric_of
from eitsim.mechanics.general.layer.layer_surface import PunchContact
from eitsim.mechanics.general.layer.lone_touches import LoneSurface, LoneTouch, lone_surface
from eitsim.mechanics.general.meshing.levels import Level, mesh_alone
from eitsim.mechanics.general.solved_layer import Solved, equilibrium
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class AddedField:
    """The surfaces of lone touches added up, as no mesh in three dimensions shows them; places (..., 2) in m."""

    exact: tuple[LoneSurface, ...]
    axes_m: Array  # (punches, 2)
    thickness_m: float

    @property
    def reach_m(self) -> float:
        """Distance from the origin outside which nothing is deformed."""
        return max(float(np.hypot(*axis) + one.radius[-1] * self.thickness_m)
                   for axis, one in zip(self.axes_m, self.exact, strict=True))

    def metric(self, points_m: Array) -> tuple[Array, Array]:
        """As of CorrectedField."""
        return metric_of(self.deformation_gradient(points_m))

    def deformation_gradient(self, points_m: Array) -> Array:
        """F (..., 3, 3) at the surface."""
        added = sum((each.gradient(at) for each, at in zip(self.exact, self._away(points_m), strict=True)),
                    np.zeros((1, 3, 3)))
        return np.eye(3) + np.broadcast_to(added, (points_m.size // 2, 3, 3)).reshape(*points_m.shape[:-1], 3, 3)

    def displacement(self, points_m: Array) -> Array:
        """Displacement (..., 3), m, of the surface."""
        added = sum((each.displacement(at) for each, at in zip(self.exact, self._away(points_m), strict=True)),
                    np.zeros((1, 3)))
        return np.broadcast_to(added, (points_m.size // 2, 3)).reshape(*points_m.shape[:-1], 3) * self.thickness_m

    def _away(self, points_m: Array) -> list[Array]:
        return [np.reshape(points_m - axis, (-1, 2)) / self.thickness_m for axis in self.axes_m]


@dataclass(frozen=True, eq=False)
class CorrectedField:
    """A layer's surface with, for each punch alone, the axisymmetric surface in place of the mesh's own; places
    (..., 2) in m."""

    solved: Solved
    alone: tuple[LayerField, ...]  # of punches that touch all round their axis
    instead: AddedField  # of the same
    exact: AddedField  # of all punches
    contact_curves_m: tuple[Array, ...]  # as of LayerField
    level: Level  # of the mesh

    @property
    def field(self) -> LayerField:
        """As the mesh has it."""
        return self.solved.field

    def metric(self, points_m: Array) -> tuple[Array, Array]:
        """In-plane right Cauchy-Green tensor (..., 2, 2) of the surface, and stretch (...) normal to it."""
        return metric_of(self.deformation_gradient(points_m))

    def deformation_gradient(self, points_m: Array) -> Array:
        """F (..., 3, 3) at the surface: the mesh's, its stretch that of summed logarithmic strains, since where the
        skin lies steep along a punch gradients of touches whose contacts end a little elsewhere add up to strain."""
        f = self.field.deformation_gradient(points_m)
        own, _ = metric_of(f)
        metric, normal = self.instead.metric(points_m)
        strain = _of_eigenvalues(np.log, own) + _of_eigenvalues(np.log, metric)
        for field in self.alone:
            metric, alone = field.metric(points_m)
            strain, normal = strain - _of_eigenvalues(np.log, metric), normal / alone
        stretch = _of_eigenvalues(lambda each: each**-0.5, own) @ _of_eigenvalues(np.exp, strain / 2)
        return np.concatenate([f[..., :2] @ stretch, f[..., 2:] * normal[..., None, None]], axis=-1)

    def displacement(self, points_m: Array) -> Array:
        """Displacement (..., 3), m, of the surface."""
        whole = self.field.displacement(points_m) + self.instead.displacement(points_m)
        return whole - sum(field.displacement(points_m) for field in self.alone)


@dataclass(frozen=True, eq=False)
class Corrected:
    """A solved layer without what its mesh leaves of each punch alone; thicknesses and mu_0."""

    solved: Solved
    depths: Array  # (punches,)
    forces: Array  # (punches,)
    contacts: tuple[PunchContact, ...]
    field: CorrectedField
    unknowns: int  # of all its meshes


def corrected(solved: Solved, lone: tuple[LoneTouch, ...], level: Level) -> Corrected:
    """The layer, and each punch alone on its section. NotConverged where one of them is not found."""
    model, unit = solved.model, solved.field.thickness_m
    depths, forces = solved.depths.copy(), many.reactions(model, solved.x)
    contacts = [*layer_surface.contact_integrals(model, solved.x, solved.field)]
    curves = [*solved.field.contact_curves_m]
    alone = {k: equilibrium(problem_alone(model, k, level, one.curvature), (one,), unit)
             for k, one in enumerate(lone) if len(curves[k])}
    for k, one in enumerate(lone):
        press, exact, whole = model.presses[k], surface.contact_of(one.model, one.state.x), contacts[k]
        if press.force is not None:
            forces[k] = press.force
        if (own := alone.get(k)) is None:
            contacts[k] = replace(whole, end_error=exact.end_error)
            continue
        if press.force is not None:
            depths[k] += one.state.depth - own.depths[0]
        else:
            forces[k] *= one.state.force / many.reactions(own.model, own.x)[0]
        (mine,) = layer_surface.contact_integrals(own.model, own.x, own.field)
        area = min(exact.area, np.pi * press.rigid.profile.radius**2)
        contacts[k] = PunchContact(whole.largest * float(exact.pressure.max()) / mine.largest,
                                   whole.area + area - mine.area, max(whole.wall + exact.wall - mine.wall, 0.0),
                                   exact.end_error)
        curves[k] = _moved_out(curves[k], own.field.contact_curves_m[0], press.axis * unit, exact.radius * unit)
    surfaces, axes = [*map(lone_surface, lone)], np.array([press.axis for press in model.presses]) * unit
    instead = AddedField(tuple(surfaces[k] for k in alone), axes[[*alone]], unit)
    field = CorrectedField(solved, tuple(own.field for own in alone.values()), instead,
                           AddedField(tuple(surfaces), axes, unit), tuple(curves), level)
    unknowns = model.mesh.unknowns + sum(own.model.mesh.unknowns for own in alone.values())
    return Corrected(solved, depths, forces, tuple(contacts), field, unknowns)


def problem_alone(model: LayerProblem, k: int, level: Level, curvature: float) -> LayerProblem:
    """Punch k alone on its section, upright on an endless layer, flat or of a curvature."""
    press = replace(model.presses[k], pose=None, rigid=replace(model.presses[k].rigid, shape=None))
    mesh = mesh_alone(model.mesh, k, press.rigid.profile.radius, level, curvature)
    return replace(model, mesh=mesh, presses=(press,))


def _of_eigenvalues(function: Callable[[Array], Array], metric: Array) -> Array:
    """A function of symmetric matrices (..., 2, 2), by their eigenvalues."""
    values, vectors = np.linalg.eigh(metric)
    return (vectors * function(values)[..., None, :]) @ np.swapaxes(vectors, -1, -2)


def _moved_out(curve: Array, alone: Array, axis: Array, end: float) -> Array:
    """A curve of contact moved along its radii by what the mesh leaves of a lone one, whose radius is `end`."""
    if not len(curve) or not len(alone):
        return curve
    radius, own = (np.linalg.norm(each - axis, axis=1) for each in (curve, alone))
    return axis + (curve - axis) * ((radius + end - own) / radius)[:, None]
