"""Each punch alone on an endless layer, axisymmetric: where it needs fine elements, and a start for all of them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial import KDTree

from eitsim.mechanics.axisymmetric import friction_increments, indentation, surface
from eitsim.mechanics.axisymmetric.indentation import Equilibrium, IndentationProblem, interpolation
from eitsim.mechanics.axisymmetric.solve_axisymmetric import (
    at_depth,
    force_unit,
    mesh_hierarchy,
    rubbed,
    rubbed_course,
    under_force,
)
from eitsim.mechanics.contact import friction
from eitsim.mechanics.general.layer.equilibrium_of_many import LayerProblem
from eitsim.mechanics.general.meshing.section import Zone
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.cap_grid import meridian
from eitsim.mechanics.solid.grid import default_element_m, feature_m
from eitsim.scene.edges.disc import Disc
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, profile_of
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Radius of the disc that stands for an endless layer, thicknesses outside the punch's edge, and its elements, in
# default sizes, of a conducting punch smaller: the signal hangs on where its contact ends.
_ENDLESS, _ELEMENT, _ELEMENT_OF_CONDUCTOR = 6.0, 1.0, 0.5
_ROUND = 0.8 * np.pi  # Angle, rad, to which it reaches on a cap at most.
# Fine elements reach this far outside the reference radius at which the contact ends, and inside where the foam stands
# under the punch's round edge, in features of the punch (`solid.grid.feature_m`).
_OUTSIDE, _UNDER = 0.5, 2.0
# Increments with friction, twice as many as by default: they take 1 to 2 s more of some 20, and what touches state of
# the signal falls from 2.3 to 0.9 % at most (five of three profiles). One of three new touches was off by 0.29 % for
# 0.26 stated.
_INCREMENTS = 2 * friction_increments.INCREMENTS
_FADING = 0.5  # Distance from sides that are held, thicknesses, over which a start fades.


@dataclass(frozen=True)
class LoneTouch:
    """One punch's axisymmetric equilibrium; lengths in thicknesses."""

    model: IndentationProblem
    state: Equilibrium
    feature: float  # length that the contact's end needs resolved
    curvature: float = 0.0  # of the cap that it stands on, positive where convex
    others: tuple[Zone, ...] = ()  # zones of the same punch on caps of the surface's principal curvatures
    rubbed: Touch | None = None  # with the errors of its friction; None without friction

    @property
    def first(self) -> float:
        """Depth at which the punch begins to touch."""
        return indentation.first_touch(self.model)

    @property
    def zone(self) -> Zone:
        """Reference radii between which the surface stands under the punch's round edge and leaves it, here or on caps
        of the principal curvatures."""
        profile = self.model.punch.profile
        end = surface.contact_of(self.model, self.state.x).radius
        facets = self.model.facets
        position = facets.shape @ indentation.positions(self.model, self.state.x)[facets.nodes]
        reference, now = facets.radius.ravel(), position[..., 0].ravel()
        last = float(np.interp(end, reference, now))
        edge = max(profile.radius - profile.edge_radius, last - _UNDER * self.feature)
        inside = reference[(reference < end) & (now < edge)]
        start = float(inside.max()) if len(inside) else 0.0
        return Zone(min([start, *(zone.start for zone in self.others)]),
                    max([end + _OUTSIDE * self.feature, *(zone.end for zone in self.others)]), profile.radius,
                    profile.sharp_tip)


@dataclass(frozen=True, eq=False)
class LoneSurface:
    """The surface of a lone touch about its axis, lengths in thicknesses, vectors along the cap's tangent and normal.
    """

    radius: Array  # (n,) reference radii, by arc length, increasing
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
    place, _ = meridian(radius, touch.curvature)
    along, up, moved = (_turned(radius, part, touch.curvature) for part in (at.along, at.up, at.position - place))
    gradient = np.column_stack([along[:, 0] - 1, up[:, 0], along[:, 1], up[:, 1] - 1, at.hoop - 1])
    return LoneSurface(radius, PchipInterpolator(radius, gradient), PchipInterpolator(radius, moved))


def _turned(length: Array, values: Array, curvature: float) -> Array:
    """Vectors (n, 2) in r and z along the tangent and normal of a cap at arc lengths (n,)."""
    _, normal = meridian(length, curvature)
    return np.column_stack([values[:, 0] * normal[:, 1] - values[:, 1] * normal[:, 0],
                            values[:, 0] * normal[:, 0] + values[:, 1] * normal[:, 1]])


def lone_touch(law: Law, body: Body, punch: Punch, curvature: float = 0.0) -> LoneTouch:
    """The touch of a punch far from all edges and others, on a layer, flat or of a curvature. NotConverged where none
    is found."""
    unit, smooth = body.thickness_m, replace(punch, friction="none")
    reach = punch.diameter_m / 2 + _ENDLESS * unit
    endless = Body(Disc(min(reach, _ROUND * unit / max(abs(curvature), 1e-300))), unit)
    smooth = replace(smooth, fillet_m=profile_of(punch).edge_radius)
    element = _ELEMENT_OF_CONDUCTOR if punch.conductor else _ELEMENT
    size = min(element * default_element_m(endless, smooth), 0.4 * unit)
    levels = mesh_hierarchy(law, endless, smooth, size, None, curvature_per_m=curvature / unit)
    model, feature, shear_limit = levels[-1], feature_m(body, smooth) / unit, friction.coefficient(punch)
    force = None if punch.force_N is None else punch.force_N / force_unit(law, body)
    depth = (punch.depth_m or 0.0) / unit + indentation.first_touch(model)
    if shear_limit == 0:
        state = (at_depth([model], depth) if force is None else under_force([model], force))[-1]
        return LoneTouch(model, state, feature, curvature)
    try:
        course = rubbed_course(levels, shear_limit, force, depth, _INCREMENTS)
    except NotConverged:  # a depth may jump between nearly equal forces
        course = rubbed_course(levels, shear_limit, force, depth)
    touch = rubbed(law, endless, levels, course, 0.0)
    return LoneTouch(replace(model, springs=course.fine.springs), course.fine.state, feature, curvature, rubbed=touch)


def added_up(lone: tuple[LoneTouch, ...], layer: LayerProblem) -> Array:
    """A start: the displacements of all touches added up, fading towards sides that are held, and their depths from
    where they begin to touch with what the others' surfaces sink at their places."""
    moved, free = np.zeros((len(layer.mesh.nodes), 3)), layer.mesh.unknown >= 0
    axes, places = [press.axis for press in layer.presses], layer.mesh.coordinates
    for one, axis in zip(lone, axes, strict=True):
        moved += displacement(one, axis, places)
    held = places[(layer.mesh.unknown[:, 0] < 0) & (places[:, 2] > -1 + 1e-9)]
    if len(held):
        moved *= np.minimum(KDTree(held).query(places)[0] / _FADING, 1.0)[:, None]
    moved = (layer.mesh.layout.turn(places[:, :2]) @ moved[..., None])[..., 0]
    depths = []
    for one, axis, press in zip(lone, axes, layer.presses, strict=True):
        sunk = sum(-float(displacement(other, there, np.append(axis, 0.0)[None])[0, 2])
                   for other, there in zip(lone, axes, strict=True) if other is not one)
        raised = press.pose.first - one.first if press.pose else 0.0
        depths.append(float(one.state.x[-1]) + raised + (sunk if press.force is not None else 0.0))
    return np.append(moved[free], depths)


def displacement(touch: LoneTouch, axis: Array, points: Array) -> Array:
    """Displacements (n, 3), along the tangents and normal of its cap, of a touch about an axis at coordinates (n, 3);
    none outside its disc."""
    grid = touch.model.grid
    away = points[:, :2] - axis
    radius = np.hypot(*away.T)
    near = radius <= grid.lines[0][-1]
    along_r = interpolation(grid.lines[0], radius[near], grid.order)
    along_z = interpolation(grid.lines[1], points[near, 2], grid.order)
    values = axisymmetric_assembly.nodal(grid, touch.state.x[:-1]).reshape(*map(len, grid.lines), 2)
    flat = _turned(radius[near], np.einsum("im,mnk,in->ik", along_r, values, along_z, optimize=True), touch.curvature)
    out = np.zeros((len(points), 3))
    out[near, :2] = flat[:, :1] * away[near] / np.maximum(radius[near], 1e-300)[:, None]
    out[near, 2] = flat[:, 1]
    return out
