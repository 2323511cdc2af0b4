"""The foam's top surface under a punch: its stretches, contact pressure, contact areas and dipole response."""

from dataclasses import dataclass

import numpy as np

from eitsim.mechanics.axisymmetric.indentation import IndentationProblem, contact_state, positions
from eitsim.mechanics.contact import punch_contact as contact
from eitsim.mechanics.contact.punch_contact import Facets
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.cap_grid import meridian
from eitsim.mechanics.solid.grid import lagrange
from eitsim.sheet.sheet_conductance import dipole, driving_strains
from touchcal.arrays import Array

# Gauss points a facet at which stretches are sampled, and at which areas and the dipole response are summed.
_SAMPLES, _FINE = 3, 8
# By a facet of half the length the end of a contact moves by less than a quarter of the facet in which it lies in 41 of
# 43 random conducting punches, by an eighth in three quarters of them; of cones by less than two fifths in 12 of 12
# others, by less than a quarter in 10.
END, END_OF_CONE = 1 / 4, 2 / 5
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
    radius: float  # reference radius where the outermost contact ends, interpolated between points
    area: float  # current area projected on the punch's face where the face or the fillet is touched
    wall: float  # current area of the side wall that is touched
    ring: float  # current area, seen along the axis, from the outermost point of contact that touches to the next one
    # relative error of the radius where the outermost contact ends, END or END_OF_CONE lengths of the facet in which it
    # does
    end_error: float


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
    radius = _end(model, fine, field.position, float(x[-1]))
    last = min(int(np.searchsorted(ends[:, 1], radius)), len(ends) - 1)
    share = END_OF_CONE if model.punch.profile.sharp_tip else END
    return Contact(pressure, ends.mean(axis=1), radius, float(projected.sum()), float(wall.sum()),
                   float(np.pi * abs(outer**2 - inner**2)), share * float(ends[last, 1] - ends[last, 0]) / radius)


def _end(model: IndentationProblem, facets: Facets, position: Array, depth: float) -> float:
    """Reference radius of the outermost zero of the penetration, linear between points; that of the last point that
    touches where no further one lies in reach."""
    inside = model.punch.profile.signed_distance(position[..., 0], position[..., 1] + depth).penetration.ravel()
    radius = facets.radius.ravel()
    last = int(np.flatnonzero(inside > 0)[-1])
    if last + 1 == len(radius):
        return float(radius[last])
    share = inside[last] / (inside[last] - inside[last + 1])
    return float(radius[last] + share * (radius[last + 1] - radius[last]))


def dipole_responses(model: IndentationProblem, x: Array) -> Array:
    """(3,) polarisability of a nominal skin, driven by each of scene.STRAINS, on the deformed surface."""
    facets = contact.top_facets(model.grid, points=_FINE)
    field = stretch(model, x, facets)
    turn = field.hoop / field.meridian
    return np.array([dipole(facets.radius.ravel(), (sheet * turn).ravel(), (sheet / turn).ravel()) for sheet in
                     np.exp(_SENSITIVITY * driving_strains(field.meridian, field.hoop, field.normal))])
