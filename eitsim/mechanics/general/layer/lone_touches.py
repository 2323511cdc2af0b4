"""Each punch alone on an endless layer, axisymmetric: where it needs fine elements, and a start for all of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial import KDTree

from eitsim.mechanics.axisymmetric import friction_increments, indentation, surface
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem, interpolation
from eitsim.mechanics.axisymmetric.solve_axisymmetric import at_depth, force_unit, mesh_hierarchy, under_force
from eitsim.mechanics.contact import friction
from eitsim.mechanics.general.layer.equilibrium_of_many import LayerProblem
from eitsim.mechanics.general.meshing.section import Zone
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.grid import default_element_m, feature_m
from eitsim.scene.edges.disc import Disc
from eitsim.scene.scene import Body, Punch, profile_of
from matcal.laws.law import Law
from touchcal.arrays import Array

# Radius of the disc that stands for an endless layer, thicknesses outside the punch's edge, and its elements, in
# default sizes.
_ENDLESS, _ELEMENT = 6.0, 1.0
# Fine elements reach this far outside the reference radius at which the contact ends, and inside where the foam stands
# under the punch's round edge, in features of the punch (`solid.grid.feature_m`).
_OUTSIDE, _UNDER = 0.5, 2.0
_FADING = 0.5  # Distance from sides that are held, thicknesses, over which a start fades.


@dataclass(frozen=True)
class LoneTouch:
    """One punch's axisymmetric equilibrium; lengths in thicknesses."""

    model: IndentationProblem
    state: Equilibrium
    feature: float  # length that the contact's end needs resolved

    @property
    def zone(self) -> Zone:
        """Reference radii between which the surface stands under the punch's round edge and leaves it."""
        profile = self.model.punch.profile
        end = surface.contact_of(self.model, self.state.x).radius
        facets = self.model.facets
        position = facets.shape @ indentation.positions(self.model, self.state.x)[facets.nodes]
        reference, now = facets.radius.ravel(), position[..., 0].ravel()
        last = float(np.interp(end, reference, now))
        edge = max(profile.radius - profile.edge_radius, last - _UNDER * self.feature)
        inside = reference[(reference < end) & (now < edge)]
        start = float(inside.max()) if len(inside) else 0.0
        return Zone(start, end + _OUTSIDE * self.feature, profile.radius, profile.sharp_tip)


@dataclass(frozen=True, eq=False)
class LoneSurface:
    """The surface of a lone touch about its axis, lengths in thicknesses."""

    radius: Array  # (n,) reference radii, increasing
    # (n, 5) displacement gradient there: rr, rz, zr, zz and hoop; (n, 2) displacement
    cubics: PchipInterpolator
    moved: PchipInterpolator

    def gradient(self, away: Array) -> Array:
        """Displacement gradients (n, 3, 3) at places (n, 2) about the axis; none outside the last radius."""
        radius = np.hypot(*away.T)
        outwards = np.column_stack([away / np.maximum(radius, 1e-300)[:, None], np.zeros(len(away))])
        outwards[radius == 0] = [1.0, 0.0, 0.0]
        upwards = np.array([0.0, 0.0, 1.0])
        around = np.cross(upwards, outwards)
        rr, rz, zr, zz, hoop = (self.cubics(np.clip(radius, *self.radius[[0, -1]])) * (
            radius <= self.radius[-1])[:, None]).T[..., None, None]
        out, turn, up = outwards[:, :, None], around[:, :, None], upwards[None, :, None]
        flat, side, high = (np.swapaxes(part, 1, 2) for part in (out, turn, up))
        return rr * out * flat + rz * out * high + zr * up * flat + zz * up * high + hoop * turn * side

    def displacement(self, away: Array) -> Array:
        """Displacements (n, 3) at places (n, 2) about the axis."""
        radius = np.hypot(*away.T)
        values = self.moved(np.clip(radius, *self.radius[[0, -1]])) * (radius <= self.radius[-1])[:, None]
        return np.column_stack([values[:, :1] * away / np.maximum(radius, 1e-300)[:, None], values[:, 1]])


def lone_surface(touch: LoneTouch) -> LoneSurface:
    """Cubics between the samples of a lone touch's surface."""
    radius, at = surface.samples(touch.model, touch.state.x)
    gradient = np.column_stack([at.along[:, 0] - 1, at.up[:, 0], at.along[:, 1], at.up[:, 1] - 1, at.hoop - 1])
    moved = np.column_stack([at.position[:, 0] - radius, at.position[:, 1]])
    return LoneSurface(radius, PchipInterpolator(radius, gradient), PchipInterpolator(radius, moved))


def lone_touch(law: Law, body: Body, punch: Punch) -> LoneTouch:
    """The touch of a punch far from all edges and others. NotConverged where none is found."""
    unit, smooth = body.thickness_m, replace(punch, friction="none")
    endless = Body(Disc(punch.diameter_m / 2 + _ENDLESS * unit), unit)
    smooth = replace(smooth, fillet_m=profile_of(punch).edge_radius)
    size = min(_ELEMENT * default_element_m(endless, smooth), 0.4 * unit)
    levels, feature = mesh_hierarchy(law, endless, smooth, size, None), feature_m(body, smooth) / unit
    force, depth = punch.force_N and punch.force_N / force_unit(law, body), (punch.depth_m or 0.0) / unit
    if coefficient := friction.coefficient(punch):
        return LoneTouch(*_rubbed(levels, coefficient, force, depth), feature)
    state = (at_depth(levels[-1:], depth) if force is None else under_force(levels[-1:], force))[-1]
    return LoneTouch(levels[-1], state, feature)


def _rubbed(levels: list[IndentationProblem], coefficient: float, force: float | None, depth: float
            ) -> tuple[IndentationProblem, Equilibrium]:
    """The problem on the finest level with what holds the foam there, and its equilibrium."""
    coarse, fine = levels[-2:]
    if force is None:
        course = friction_increments.at_depth(coarse, fine, coefficient, depth,
                                              at_depth(levels[:1], depth)[0].force)
    else:
        (course,) = friction_increments.under_forces(coarse, fine, coefficient, [force])
    return replace(fine, springs=course.fine.springs), course.fine.state


def added_up(lone: tuple[LoneTouch, ...], layer: LayerProblem, share: float = 1.0) -> Array:
    """A start: the displacements of all touches added up, fading towards sides that are held, and their depths with
    what the others' surfaces sink at their places, times a share."""
    moved, free = np.zeros((len(layer.mesh.nodes), 3)), layer.mesh.unknown >= 0
    axes = [press.axis for press in layer.presses]
    for one, axis in zip(lone, axes, strict=True):
        moved += displacement(one, axis, layer.mesh.nodes)
    held = layer.mesh.nodes[(layer.mesh.unknown[:, 0] < 0) & (layer.mesh.nodes[:, 2] > -1 + 1e-9)]
    if len(held):
        moved *= np.minimum(KDTree(held).query(layer.mesh.nodes)[0] / _FADING, 1.0)[:, None]
    depths = []
    for one, axis, press in zip(lone, axes, layer.presses, strict=True):
        sunk = sum(-float(displacement(other, there, np.append(axis, 0.0)[None])[0, 2])
                   for other, there in zip(lone, axes, strict=True) if other is not one)
        depths.append(float(one.state.x[-1]) + (sunk if press.force is not None else 0.0))
    return share * np.append(moved[free], depths)


def displacement(touch: LoneTouch, axis: Array, points: Array) -> Array:
    """Displacements (n, 3) of a touch about an axis at points (n, 3); none outside its disc."""
    grid = touch.model.grid
    away = points[:, :2] - axis
    radius = np.hypot(*away.T)
    near = radius <= grid.lines[0][-1]
    along_r = interpolation(grid.lines[0], radius[near], grid.order)
    along_z = interpolation(grid.lines[1], points[near, 2], grid.order)
    values = axisymmetric_assembly.nodal(grid, touch.state.x[:-1]).reshape(*map(len, grid.lines), 2)
    flat = np.einsum("im,mnk,in->ik", along_r, values, along_z, optimize=True)
    out = np.zeros((len(points), 3))
    out[near, :2] = flat[:, :1] * away[near] / np.maximum(radius[near], 1e-300)[:, None]
    out[near, 2] = flat[:, 1]
    return out
