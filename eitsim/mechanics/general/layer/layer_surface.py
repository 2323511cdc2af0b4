"""What a solved layer shows at its surface: contact pressures and areas, curves where contact ends, mean stretches."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.contact_ends import FARTHEST, NEAREST, end_by_gaps
from eitsim.mechanics.contact.punch_contact import spatial_contact, spatial_penetration
from eitsim.mechanics.general.layer.equilibrium_of_many import LayerProblem, Press, contacts, split
from eitsim.mechanics.general.layer.layer_field import LayerField
from eitsim.mechanics.general.meshing.wedge import Facets, facet_shapes
from eitsim.mechanics.general.meshing.wedge_mesh import Revolved
from eitsim.scene.polygons import signed_area
from eitsim.scene.results import SurfaceField
from eitsim.sheet.sheet_conductance import driving_strains
from touchcal.arrays import Array

# Points along each side of a facet at which areas are summed, and directions and radii of a contact's curve.
_FINE, _DIRECTIONS, _RADII, _REACH = 8, 64, 400, 1.0
_GAPS = 12  # Places along each direction whose gaps show where contact ends.
_ROUND = 2 * np.pi / _DIRECTIONS / np.sin(2 * np.pi / _DIRECTIONS)  # Area of a circle over that of its polygon.
_SENSITIVITY = -2.0  # Conductivity of the nominal skin is exp(_SENSITIVITY strain).


@dataclass(frozen=True)
class PunchContact:
    """Integrals of one punch's contact, in thicknesses and mu_0."""

    largest: float  # contact pressure on the deformed surface, average over a facet
    # Current area seen along the axis: inside the curve where contact ends, or of all points that touch where contact
    # does not go all round the axis, as under a punch that leans on its edge.
    area: float
    wall: float  # current area of the side wall that is touched
    end_error: float = 0.0  # relative error of the radius at which the touch that corrects the mesh ends


def contact_integrals(model: LayerProblem, x: Array, field: LayerField) -> tuple[PunchContact, ...]:
    """Pressures and areas of each punch's contact, by the curves of the field."""
    moved, depths = split(model, x)
    count = len(model.presses)
    largest, wall, spots, where = np.zeros(count), np.zeros(count), np.zeros(count), model.mesh.nodes + moved
    for k, faces, at in contacts(model, moved, depths):
        push = np.sum(faces.weight * contact.pressure(model.presses[k].rigid, at.penetration), axis=1)
        position, part = _finely(faces, where)
        size, along = np.linalg.norm(part, axis=-1), np.abs(model.presses[k].past(part, 0.0)[..., 2])
        at = spatial_contact(model.presses[k].rigid, model.presses[k].seen(position, depths[k]))
        largest[k] = max(largest[k], float((push / size.sum(axis=1)).max(initial=0.0)))
        wall[k] += float(np.sum(size[(at.penetration > 0) & at.wall]))
        spots[k] += float(np.sum(along[(at.penetration > 0) & ~at.wall]))
    curves = [press.seen(_moved(field, curve) / field.thickness_m, 0.0)[:, :2] * field.thickness_m
              for press, curve in zip(model.presses, field.contact_curves_m, strict=True)]
    areas = [float(signed_area(curve)) / field.thickness_m**2 * _ROUND if len(curve) else spot
             for curve, spot in zip(curves, spots.tolist(), strict=True)]
    return tuple(PunchContact(*values) for values in zip(largest.tolist(), areas, wall.tolist(), strict=True))


def _finely(faces: Facets, where: Array) -> tuple[Array, Array]:
    """Positions of many points and their current areas along the normal, both (f, p, 3)."""
    t = (np.arange(_FINE) + 0.5) / _FINE
    if faces.quadrilateral:
        at, share = np.column_stack([np.tile(2 * t - 1, _FINE), np.repeat(2 * t - 1, _FINE)]), 4 / _FINE**2
    else:
        both = np.column_stack([np.tile(t, _FINE), np.repeat(t, _FINE)])
        at, share = np.where((both.sum(axis=1) > 1)[:, None], 1 - both[:, ::-1], both), 1 / (2 * _FINE**2)
    value, slope = facet_shapes(faces.quadrilateral, at)
    corners = where[faces.nodes]
    along = np.einsum("pkd,fki->fpdi", slope, corners)
    return value @ corners, share * np.cross(along[:, :, 0], along[:, :, 1])


def contact_curves(model: LayerProblem, x: Array, field: LayerField) -> tuple[Array, ...]:
    """Closed curves (directions, 2), m, about each punch outside which no place touches it; empty without contact."""
    depths, angle = x[model.mesh.unknowns:], 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    return tuple(_curve(press, float(depth), field, way, about)
                 for press, depth, about in zip(model.presses, depths, model.mesh.about, strict=True))


def _curve(press: Press, depth: float, field: LayerField, way: Array, about: Revolved) -> Array:
    """Where contact ends along rays, by the gaps outside the outermost places that touch."""
    sector = int(np.ceil(np.diff(about.circle.angles).max() / (2 * np.pi) * _DIRECTIONS))

    def penetration(radius: Array) -> Array:
        """Along rays, (directions, n) or (n,); the largest of so many directions, a sector of the mesh, counts, since
        its arcs are not quite those of a circle."""
        points = press.axis + radius[..., None] * way[:, None]
        seen = press.seen(_moved(field, points * field.thickness_m) / field.thickness_m, depth)
        return maximum_filter1d(spatial_penetration(press.rigid, seen), sector + 1, axis=0, mode="wrap")

    radius = (press.rigid.profile.radius + _REACH) * np.arange(1, _RADII + 1) / _RADII
    inside = penetration(radius)
    if not (inside > 0).any(axis=1).all():
        return np.empty((0, 2))
    k, last = np.arange(len(way)), _RADII - 1 - np.argmax((inside > 0)[:, ::-1], axis=1)
    after = np.minimum(last + 1, _RADII - 1)
    drop = inside[k, last] - inside[k, after]
    share = np.where(drop > 0, inside[k, last] / np.where(drop > 0, drop, 1.0), 0.0)
    end, lines = radius[last] + share * (radius[after] - radius[last]), about.radii
    k = np.clip(np.searchsorted(lines, end), 1, len(lines) - 1)
    length, away = lines[k] - lines[k - 1], np.linspace(NEAREST, FARTHEST, _GAPS)
    moved = end_by_gaps(away, -penetration(end[:, None] + length[:, None] * away)) * length
    end = np.where(np.isnan(moved), end, end + moved)
    return (press.axis + end[:, None] * way) * field.thickness_m


def _moved(field: LayerField, points_m: Array) -> Array:
    """Where places (..., 2) are in space (..., 3), m, deformed."""
    layout, points = field.mesh.layout, points_m / field.thickness_m
    turned = (layout.turn(points) @ field.displacement(points_m)[..., None])[..., 0]
    return layout.place(points)[0] * field.thickness_m + turned


def surface_points(field: LayerField) -> tuple[Array, Array]:
    """Places (n, 2), m, all over the meshed surface, and the reference areas (n,), m^2, that they stand for."""
    faces, unit = (field.mesh.around, field.mesh.flat), field.thickness_m
    points = [(each.shape @ field.mesh.coordinates[each.nodes][..., :2]).reshape(-1, 2) for each in faces]
    return np.concatenate(points) * unit, np.concatenate([each.weight.ravel() for each in faces]) * unit**2


def strains_at(field: SurfaceField, points_m: Array) -> Array:
    """(3, n) strains that drive a skin, by scene.STRAINS."""
    metric, normal = field.metric(points_m)
    first, second = principal_stretches(metric)
    return driving_strains(first, second, normal)


def principal_stretches(metric: Array) -> tuple[Array, Array]:
    """The larger and the smaller stretch (...) of metrics (..., 2, 2)."""
    xx, xy, yy = metric[..., 0, 0], metric[..., 0, 1], metric[..., 1, 1]
    first = np.sqrt((xx + yy) / 2 + np.hypot((xx - yy) / 2, xy))
    return first, np.sqrt(xx * yy - xy**2) / first


def nominal_moments(field: SurfaceField, points_m: Array, area_m2: Array) -> Array:
    """(3, 2, 2) integrals over the surface of what a touch changes of the conductance of a nominal skin over its own,
    by scene.STRAINS: its signal in a uniform field, to first order, m^2."""
    metric, normal = field.metric(points_m)
    first, second = principal_stretches(metric)
    sheet = np.exp(_SENSITIVITY * driving_strains(first, second, normal)) / (first * second)
    adjugate = np.stack([metric[:, 1, 1], -metric[:, 0, 1], -metric[:, 0, 1], metric[:, 0, 0]], -1).reshape(-1, 2, 2)
    return np.einsum("n,snij->sij", area_m2, sheet[..., None, None] * adjugate - np.eye(2))
