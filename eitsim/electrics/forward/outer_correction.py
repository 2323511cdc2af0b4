"""The strain outside the circle of a touch near an edge, to third order, by the response of the uniform skin on a mesh.

The circle reaches the edge, so that outside it strains are no longer small, and the series of what edges send back does
not converge everywhere. On a mesh of the uniform skin, once a sensor, that field is solved for instead; then so is what
strains outside make of it. With D the gradients at points, u the potentials that the circle leaves, w = -area ds and G
the response, f = D' w D u and v = G f, the impedance changes by u' D' w D u + f' v + v' D' w D v.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_array

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh, eliminated, quadrature_points, slopes
from eitsim.electrics.cem.ring_scattering import FULL, Circle, Scattered, outgoing_gradient, position, ring_share
from eitsim.electrics.forward.far_field import DEGREE, Fields, fields_of, first_order
from eitsim.electrics.forward.outline_electrics import TRIANGLES
from eitsim.electrics.outline.adapted_mesh import READINGS
from eitsim.electrics.outline.edge_response import Edges, edge_loads, edges_of, outgoing_waves
from eitsim.electrics.outline.touch_mesh import fields_mesh
from eitsim.numerics.conductor_elimination import Elimination, solve_between
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import sheet_conductance
from matcal.laws.conductivity import Conductivity

# Up to so many thicknesses outside a contact cells are sampled in parts of so many thicknesses, the last that applies.
_FADES = ((8.0, 1.0), (3.0, 1 / 3))
# Length of parts of cells over the width of the ring in which the circle's change fades, on that ring.
_ACROSS = 0.5
# Part of the first order, in untouched fields and without signs, that the cells left out may have.
_LEFT_OUT = 1e-4
# Part of the size of the strongest of the fields there, as combinations of electrodes, from which others count.
_WEAKEST = 1e-3
# What is left over what `_faded` changes: fields inside the circle's last tenth are taken to first order in its depth.
_LEFT = 1 / 3


@dataclass(frozen=True, eq=False)
class _UniformSkin:
    """The uniform skin on one mesh: its untouched fields, its response, and its edges."""

    fields: Fields
    gradient: Array  # (cells, 2, N) of these in the middle of each cell, Ohm/m
    response: Elimination
    edges: Edges


@dataclass(frozen=True, eq=False)
class _Samples:
    """Points of some cells of a mesh, and the combinations of electrodes whose fields count there."""

    points_m: Array  # (n, 2)
    area_m2: Array  # (n,)
    node: Indices  # (nodes,) those of the cells among the mesh's
    slope: csr_array  # (2 n, nodes) x and y of gradients at the points by potentials of these nodes
    combination: Array  # (electrodes, N)


@lru_cache(maxsize=4)
def _uniform_skin(body: Body, electrodes: Electrodes, conductance_S: float) -> _UniformSkin:
    mesh = fields_mesh(body, electrodes, conductance_S, body.edge.area_m2 / TRIANGLES, READINGS)
    z, count = contact_impedances(electrodes), mesh.count
    response = eliminated(mesh, np.full(len(mesh.cells), conductance_S), z)
    nodes = np.arange(len(mesh.nodes_m))
    potential = solve_between(response, len(nodes) + np.arange(count), np.eye(count) - 1 / count, nodes)
    fields = fields_of(mesh, potential)
    return _UniformSkin(fields, fields.gradient.mean(axis=1), response, edges_of(mesh, z))


def outer_correction(body: Body, electrodes: Electrodes, conductance_S: float, punch: Punch, touch: Touch, skin: Skin,
                     law: Conductivity, reach_m: float, rings: Scattered) -> tuple[Array, Array]:
    """Change (count, count), Ohm, of the impedance matrix by what the circle of a touch that edges change leaves out,
    and what is unsure of it; the skin has an outline and line electrodes."""
    known, circle = _uniform_skin(body, electrodes, conductance_S), (position(punch), reach_m)
    samples = _samples(known, body, conductance_S, punch, touch, skin, law, reach_m)
    away = samples.points_m - np.array([punch.x_m, punch.y_m])
    radius = np.linalg.norm(away, axis=1)
    share = ring_share(radius, reach_m)[:, None, None]
    change = sheet_conductance(samples.points_m, punch, touch, skin, law) - conductance_S * np.eye(2)
    combined = samples.combination
    rings = replace(rings, outgoing=rings.outgoing @ combined)
    potential = known.fields.potential[samples.node] @ combined
    potential += _returned(known, conductance_S, circle, rings, samples.node)
    field = _at(samples, potential) + outgoing_gradient(rings, circle, samples.points_m)
    fading, area = radius < reach_m, samples.area_m2
    left = (1 - share) * change
    seen = field[fading]
    field[fading] = _faded(seen, away[fading] / radius[fading, None], (share * change)[fading], conductance_S)
    unsure = first_order(area[fading], seen, left[fading]) - first_order(area[fading], field[fading], left[fading])
    flow = _flow(area, left, field)
    currents = samples.slope.T @ flow.reshape(-1, flow.shape[-1])
    answer = solve_between(known.response, samples.node, currents, samples.node)
    third = first_order(area, _at(samples, answer), left)
    whole = _power(field, flow) + currents.T @ answer + third
    return combined @ whole @ combined.T, _LEFT * (combined @ unsure @ combined.T)


def _samples(known: _UniformSkin, body: Body, conductance_S: float, punch: Punch, touch: Touch, skin: Skin,
             law: Conductivity, reach_m: float) -> _Samples:
    """Points of the cells outside the last tenth of a circle, where the touch changes something."""
    fields, place = known.fields, np.array([punch.x_m, punch.y_m])
    away, size, inner = np.linalg.norm(fields.points_m - place, axis=-1), fields.size_m, FULL * reach_m
    cells = np.flatnonzero(away.max(axis=1) > inner - size)
    change = sheet_conductance(fields.points_m[cells], punch, touch, skin, law) - conductance_S * np.eye(2)
    change = np.sqrt(change[..., 0, 0] ** 2 + 2 * change[..., 0, 1] ** 2 + change[..., 1, 1] ** 2)
    weight = np.sum(change * fields.heat[cells], axis=1)
    order = np.argsort(weight)
    counts = order[np.cumsum(weight[order]) > _LEFT_OUT * weight.sum()]
    cells, change = cells[counts], change[counts]
    combination = _combinations(known.gradient[cells], np.sum(change * fields.area_m2[cells], axis=1))
    parts = _parts(size[cells], away[cells].min(axis=1), body.thickness_m, touch.contact_radius_m, reach_m)
    found = [_sampled(replace(fields.mesh, cells=fields.mesh.cells[cells[parts == count]]), count)
             for count in np.unique(parts).tolist()]
    points, area, slope, nodes = (np.concatenate(part) for part in zip(*found, strict=True))
    there, start = np.zeros(len(fields.mesh.nodes_m), dtype=bool), np.arange(0, slope.size + 1, slope.shape[1])
    there[fields.mesh.cells[cells]] = True
    node, column = np.flatnonzero(there), np.cumsum(there) - 1
    return _Samples(points, area, node, csr_array((slope.ravel(), column[nodes.ravel()], start),
                                                  shape=(len(slope), len(node))), combination)


def _combinations(gradient: Array, weight: Array) -> Array:
    """(electrodes, N) orthonormal combinations of electrodes whose fields (cells, 2, electrodes), weighted by
    (cells,), are no smaller than _WEAKEST of the strongest."""
    flat = (gradient * np.sqrt(weight)[:, None, None]).reshape(-1, gradient.shape[-1])
    power, combination = np.linalg.eigh(flat.T @ flat)
    return combination[:, power >= _WEAKEST**2 * power[-1]]


def _parts(size_m: Array, away_m: Array, thickness_m: float, contact_m: float, reach_m: float) -> Indices:
    """(cells,) into how many parts the sides of cells of a size are cut, so far from the punch."""
    longest = np.full(len(size_m), np.inf)
    for within, spacing in _FADES:
        longest[away_m < contact_m + within * thickness_m] = spacing * thickness_m
    longest[away_m < reach_m] = _ACROSS * (1 - FULL) * reach_m
    return np.maximum(np.ceil(size_m / longest), 1).astype(int)


def _sampled(mesh: SkinMesh, parts: int) -> tuple[Array, Array, Array, Indices]:
    """Points (n, 2) of cells in parts, their areas (n,), and slopes (2 n, k), of functions of nodes (2 n, k)."""
    degree = DEGREE if parts == 1 else None
    slope, area = slopes(mesh, parts, degree)
    nodes = np.repeat(mesh.cells, 2 * area.shape[1], axis=0)
    return quadrature_points(mesh, parts, degree).reshape(-1, 2), area.ravel(), slope.reshape(nodes.shape), nodes


def _at(samples: _Samples, potential: Array) -> Array:
    """Gradients (n, 2, N) at the samples of potentials (nodes, N)."""
    return np.asarray(samples.slope @ potential).reshape(len(samples.area_m2), 2, -1)


def _returned(known: _UniformSkin, conductance_S: float, circle: Circle, rings: Scattered, node: Indices) -> Array:
    """Potentials (nodes, N) at nodes of what edges send back to a circle."""
    wave, slope = outgoing_waves(known.edges, [circle], len(rings.outgoing))
    loads = edge_loads(known.edges, conductance_S, wave, slope) @ rings.outgoing.conj()
    return solve_between(known.response, known.edges.unknown, loads.real, node)


def _faded(field: Array, outwards: Array, change: Array, conductance_S: float) -> Array:
    """Gradients (n, 2, N) where rings carry a change (n, 2, 2) of conductance: what flows along the normals (n, 2) of
    circles and the field across them are those without it."""
    flow = np.einsum("ni,nij,njk->nk", outwards, change, field, optimize=True)
    stiff = conductance_S + np.einsum("ni,nij,nj->n", outwards, change, outwards)
    return field - outwards[:, :, None] * (flow / stiff[:, None])[:, None]


def _flow(area: Array, change: Array, field: Array) -> Array:
    """-area ds grad u (n, 2, N)."""
    xx, xy, yy = (-(area * change[:, i, j])[:, None] for i, j in ((0, 0), (0, 1), (1, 1)))
    x, y = field[:, 0], field[:, 1]
    return np.stack([xx * x + xy * y, xy * x + yy * y], axis=1)


def _power(field: Array, flow: Array) -> Array:
    """(N, N) sum of fields times flows (n, 2, N)."""
    count = field.shape[-1]
    return field.reshape(-1, count).T @ flow.reshape(-1, count)
