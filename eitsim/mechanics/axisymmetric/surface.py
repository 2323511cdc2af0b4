"""The foam's top surface under a punch: its stretches, contact pressure, contact areas and dipole response."""

from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.axisymmetric.indentation import IndentationProblem, contact_state, positions
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.contact_ends import FARTHEST, LEFT, LEFT_BY_EDGE, NEAREST, end_by_gaps
from eitsim.mechanics.contact.punch_contact import Facets
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.cap_grid import meridian
from eitsim.mechanics.solid.grid import lagrange
from eitsim.sheet.sheet_conductance import dipole, driving_strains
from touchcal.arrays import Array

# Gauss points a facet at which stretches are sampled, and at which areas and the dipole response are summed.
_SAMPLES, _FINE = 3, 8
# Conductivity of the nominal skin of the dipole response is exp(_SENSITIVITY strain).
_SENSITIVITY = -2.0


@dataclass(frozen=True)
class Stretch:
    """Deformation of the surface at points of facets, all arrays (facets, points), or (n,) points in a row."""

    position: Array  # (facets, points, 2) or (n, 2) current position
    meridian: Array
    hoop: Array
    normal: Array  # through the thickness: J over the areal stretch
    widening: Array  # current radius over the reference radius, times its derivative by the reference radius
    # (facets, points, 2) or (n, 2) derivatives of the position by the reference radius and by the height
    along: Array
    up: Array


@dataclass(frozen=True)
class Contact:
    """Integrals of the contact."""

    pressure: Array  # (facets,) contact pressure on the deformed surface, facet averages
    middle: Array  # (facets,) reference radius of the facets' middles
    radius: float  # reference radius where the outermost contact ends, by the gap outside it
    area: float  # current area projected on the punch's face where the face or the fillet is touched
    wall: float  # current area of the side wall that is touched
    ring: float  # current area, seen along the axis, from the outermost point of contact that touches to the next one
    end_error: float  # relative error of the radius where the outermost contact ends


def stretch(model: IndentationProblem, x: Array, facets: Facets) -> Stretch:
    """Deformation at the points of facets, from the displacement's gradient at the surface."""
    where = positions(model, x)
    order, rows = model.grid.order, model.grid.lines[1]
    by_height = lagrange(order, np.ones(1))[1][0] * 2 / (rows[-1] - rows[-1 - order])
    position = facets.shape @ where[facets.nodes]
    along = facets.slope @ where[facets.nodes]
    columns = facets.nodes[..., None] + np.arange(-order, 1)
    up = facets.shape @ np.einsum("k,faki->fai", by_height, where[columns])
    if model.grid.laid is not None:
        before = model.grid.nodes
        along, up = _by_cap(model.grid.curvature, facets, along, up, facets.slope @ before[facets.nodes],
                            facets.shape @ np.einsum("k,faki->fai", by_height, before[columns]))
    meridian = np.hypot(along[..., 0], along[..., 1])
    around, on_axis = model.grid.nodes[facets.nodes, 0] @ facets.shape.T, facets.radius == 0
    hoop = np.where(on_axis, meridian, position[..., 0] / np.where(on_axis, 1.0, around))
    volume = axisymmetric_assembly.surface_volume(model.law, model.grid, x[:-1], facets.nodes, facets.within)
    normal = ((along[..., 0] * up[..., 1] - along[..., 1] * up[..., 0]) / meridian if volume is None
              else volume / (meridian * hoop))
    return Stretch(position, meridian, hoop, normal, along[..., 0] * hoop, along, up)


def _by_cap(curvature: float, facets: Facets, along: Array, up: Array, along_before: Array, up_before: Array
            ) -> tuple[Array, Array]:
    """F t and F n (facets, points, 2) of the cap's unit tangent t and normal n, from the derivatives of current and of
    reference positions: those of the elements' are not quite of unit length."""
    gradient = np.stack([along, up], axis=-1) @ np.linalg.inv(np.stack([along_before, up_before], axis=-1))
    _, normal = meridian(facets.radius.ravel(), curvature)
    normal = normal.reshape(along.shape)
    tangent = np.stack([normal[..., 1], -normal[..., 0]], axis=-1)
    return (gradient @ tangent[..., None])[..., 0], (gradient @ normal[..., None])[..., 0]


def samples(model: IndentationProblem, x: Array) -> tuple[Array, Stretch]:
    """Reference radii (n,), increasing from 0, and the deformation there, flattened to (n,)."""
    axis = contact.facets_at(model.grid, model.grid.top[:1], np.array([-1.0]), np.zeros(1))
    parts = [axis, contact.top_facets(model.grid, points=_SAMPLES)]
    fields = [stretch(model, x, part) for part in parts]

    def joined(name: str) -> Array:
        values = [getattr(field, name) for field in fields]
        return np.concatenate([v.reshape(-1, *v.shape[2:]) for v in values])

    radius = np.concatenate([part.radius.ravel() for part in parts])
    return radius, Stretch(*(joined(name) for name in Stretch.__dataclass_fields__))


def contact_of(model: IndentationProblem, x: Array) -> Contact:
    """Pressures and areas of the contact at x."""
    facets = model.facets
    at, field = contact_state(model, x), stretch(model, x, facets)
    push = (facets.weight * contact.pressure(model.punch, at.penetration)).sum(axis=1)
    pressure = push / (facets.weight * field.meridian * field.hoop).sum(axis=1)
    edge = np.append(0, np.flatnonzero(at.penetration))[-1]
    inner, outer = field.position[..., 0].ravel()[[edge, min(edge + 1, at.penetration.size - 1)]]
    fine = contact.facets_at(model.grid, facets.nodes, *np.polynomial.legendre.leggauss(_FINE))
    at, field = contact_state(model, x, fine), stretch(model, x, fine)
    touched = at.penetration > 0
    projected = fine.weight * field.widening * (touched & ~at.wall)
    wall = fine.weight * field.meridian * field.hoop * (touched & at.wall)
    ends = model.grid.flat_nodes[facets.nodes[:, [0, -1]], 0]
    radius, error = _end(model, fine, field.position, float(x[-1]), ends)
    return Contact(pressure, ends.mean(axis=1), radius, float(projected.sum()), float(wall.sum()),
                   float(np.pi * abs(outer**2 - inner**2)), error / radius)


def _end(model: IndentationProblem, facets: Facets, position: Array, depth: float, ends: Array) -> tuple[float, float]:
    """Reference radius where the outermost contact ends, and its error, by the gap of points outside it; where that
    does not grow, that of the last point that touches, and the length of its facet. ends (facets, 2): reference radii.
    """
    gap = -model.punch.profile.signed_distance(position[..., 0], position[..., 1] + depth).penetration.ravel()
    radius = facets.radius.ravel()
    last = int(np.flatnonzero(gap < 0)[-1])
    inner, outer = ends[last // facets.radius.shape[1]]
    away = (radius[last + 1:] - radius[last]) / (outer - inner)
    near = (away > NEAREST) & (away < FARTHEST)
    end = end_by_gaps(away[near], gap[last + 1:][near]) if near.sum() > 1 else np.nan
    profile = model.punch.profile
    left = LEFT_BY_EDGE if profile.is_flat or profile.sharp_tip else LEFT
    return (float(radius[last]), float(outer - inner)) if np.isnan(end) else (
        float(radius[last] + end * (outer - inner)), left * float(outer - inner))


def dipole_responses(model: IndentationProblem, x: Array) -> Array:
    """(3,) polarisability of a nominal skin, driven by each of scene.STRAINS, on the deformed surface."""
    facets = contact.top_facets(model.grid, points=_FINE)
    field = stretch(model, x, facets)
    turn = field.hoop / field.meridian
    return np.array([dipole(facets.radius.ravel(), (sheet * turn).ravel(), (sheet / turn).ravel()) for sheet in
                     np.exp(_SENSITIVITY * driving_strains(field.meridian, field.hoop, field.normal))])
