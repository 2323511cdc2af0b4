"""The strain outside the rings, up to the rim: small, so its signal is taken to first order."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh, gradients, potentials, quadrature_points
from eitsim.electrics.cem.ring_scattering import FULL, Scattered, position, ring_share, scattered_gradient
from eitsim.electrics.forward.skins import skin_of
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import (
    principal_conductances,
    sheet_conductance,
    stretches,
    touched_conductance,
)
from matcal.laws.conductivity import Conductivity

# Degree of exactness of the quadrature where cells are not cut: that of products of their gradients; where touches meet
# strains vary within a cell too, and it is the element's own.
DEGREE = 2
# Strains fall by e in less than a thickness: up to so many thicknesses outside a contact cells are sampled in parts of
# so many thicknesses, the last that applies.
_FADES = ((8.0, 1.0),)
# What rings send out and get back counts so many of their reaches from the punch.
_SEEN = 1.2
# Part of the change by the rings that the cells left out may make to first order, fields and changes without signs.
_LEFT_OUT = 1e-5
_SAMPLES = 64  # radii at which the largest change of conductance is taken for what may be left out


@dataclass(frozen=True, eq=False)
class Fields:
    """Untouched potentials of 1 A into each electrode on a fixed mesh."""

    mesh: SkinMesh
    potential: Array  # (nodes, N), Ohm
    points_m: Array  # (cells, q, 2) points of its quadrature
    area_m2: Array  # (cells, q) the areas that these stand for
    gradient: Array  # (cells, q, 2, N), Ohm/m

    @property
    def size_m(self) -> Array:
        """(cells,) root of the area of each."""
        return np.sqrt(self.area_m2.sum(axis=1))

    @cached_property
    def heat(self) -> Array:
        """(cells, q) squared gradients, summed over electrodes, times areas."""
        return np.asarray(self.area_m2 * np.sum(self.gradient**2, axis=(2, 3)))

    def some(self, cells: Indices) -> "Fields":
        """Those in some cells."""
        return Fields(replace(self.mesh, cells=self.mesh.cells[cells]), self.potential, self.points_m[cells],
                      self.area_m2[cells], self.gradient[cells])


@lru_cache(maxsize=8)
def untouched_fields(body: Body, electrodes: Electrodes, conductance_S: float, degree: int | None = DEGREE) -> Fields:
    """The potentials, on a mesh on which the readings of a skin with an outline are known to FIELDS, and their
    gradients by a quadrature."""
    mesh = skin_of(body, electrodes, conductance_S).fields_mesh()
    potential = potentials(mesh, np.full(len(mesh.cells), conductance_S), contact_impedances(electrodes))
    return fields_of(mesh, potential[:len(mesh.nodes_m)], degree)


def fields_of(mesh: SkinMesh, potential: Array, degree: int | None = DEGREE) -> Fields:
    """The fields of potentials of the nodes (nodes, N), Ohm, by a quadrature."""
    gradient, area = gradients(mesh, potential, degree=degree)
    return Fields(mesh, potential, quadrature_points(mesh, degree=degree), area, gradient)


def _sampled(fields: Fields, thickness_m: float, places_m: Array, inner_m: Array, contact_m: Array,
             fades: Sequence[tuple[float, float]]) -> tuple[Array, Array, Array]:
    """Points (n, 2), m, of all cells, their areas (n,), m^2, and the gradients (n, 2, N), Ohm/m, there, views where no
    cell is cut; as close to each other as `fades` asks in cells outside inner radii (k,) about places (k, 2), near the
    ends of contact (k,)."""
    size = fields.size_m
    away = np.linalg.norm(fields.points_m[:, :, None] - places_m, axis=-1)
    outside, parts = away.max(axis=1) > inner_m - size[:, None], np.ones(len(size), dtype=int)
    for within, spacing in fades:
        near = ((away.min(axis=1) < contact_m + within * thickness_m) & outside).any(axis=1)
        if near.any():
            parts[near] = max(1, math.ceil(size[near].max() / (spacing * thickness_m)))
    whole = parts == 1
    if whole.all():
        return fields.points_m.reshape(-1, 2), fields.area_m2.ravel(), _flat(fields.gradient)
    points, area, gradient = [fields.points_m[whole]], [fields.area_m2[whole]], [fields.gradient[whole]]
    for count in np.unique(parts[~whole]).tolist():
        mesh = replace(fields.mesh, cells=fields.mesh.cells[parts == count])
        finer, finer_area = gradients(mesh, fields.potential, count)
        points.append(quadrature_points(mesh, count))
        area.append(finer_area)
        gradient.append(finer)
    return (np.vstack([part.reshape(-1, 2) for part in points]), np.concatenate([part.ravel() for part in area]),
            np.concatenate([_flat(part) for part in gradient]))


def _flat(gradient: Array) -> Array:
    return gradient.reshape(-1, *gradient.shape[2:])


def born_correction(body: Body, electrodes: Electrodes, conductance_S: float, punch: Punch, touch: Touch, skin: Skin,
                    law: Conductivity, reach_m: float, rings: Scattered | None = None,
                    change_Ohm: float = 0.0) -> tuple[Array, Array]:
    """Change (count, count), Ohm, of the impedance matrix by what the rings leave out, and the part of it of second
    order in ds: -int grad u_k . (ds - ds^2 / 2S) grad u_l, ds the change of conductance less `ring_share` of it, u the
    untouched fields, or those that the rings leave.

    The second order, taken near the rings alone, lies between 0 and twice this, which a disc of small change has. Cells
    that could add no more than _LEFT_OUT of what the rings change, of this Frobenius norm, are left out.
    """
    place, whole = np.array([punch.x_m, punch.y_m]), untouched_fields(body, electrodes, conductance_S)
    cells = _counting(whole, conductance_S, punch, touch, skin, law, reach_m, _LEFT_OUT * change_Ohm)
    if not len(cells):
        nothing = np.zeros((electrodes.count, electrodes.count))
        return nothing, nothing
    points, area, field = _sampled(whole.some(cells), body.thickness_m, place[None], np.array([FULL * reach_m]),
                                   np.array([touch.contact_radius_m]), _FADES)
    radius = np.linalg.norm(points - place, axis=1)
    change = sheet_conductance(points, punch, touch, skin, law) - conductance_S * np.eye(2)
    change *= (1 - ring_share(radius, reach_m))[:, None, None]
    near = np.flatnonzero((radius > FULL * reach_m) & (radius < _SEEN * reach_m))
    if rings is not None:
        field[near] += scattered_gradient(rings, (position(punch), reach_m), points[near])
    second = first_order(area[near], field[near], _squared(change[near]) / (-2 * conductance_S))
    return first_order(area, field, change) + second, second


def _squared(change: Array) -> Array:
    """Products of symmetric matrices (n, 2, 2) with themselves."""
    xx, xy, yy = change[:, 0, 0], change[:, 0, 1], change[:, 1, 1]
    out = np.empty_like(change)
    out[:, 0, 0], out[:, 1, 1] = xx**2 + xy**2, yy**2 + xy**2
    out[:, 0, 1] = out[:, 1, 0] = xy * (xx + yy)
    return out


def _counting(fields: Fields, conductance_S: float, punch: Punch, touch: Touch, skin: Skin, law: Conductivity,
              reach_m: float, left_out_Ohm: float) -> Indices:
    """Cells outside the rings, without those whose changes add up to no more than what is left out."""
    away = np.linalg.norm(fields.points_m - np.array([punch.x_m, punch.y_m]), axis=-1)
    cells = np.flatnonzero(away.max(axis=1) > FULL * reach_m - fields.size_m)
    radii = np.linspace(FULL * reach_m - fields.size_m[cells].max(initial=0.0), away.max(), _SAMPLES)
    sheets = principal_conductances(law, skin, *stretches(touch, radii))
    largest = np.max([np.abs(one - conductance_S) for one in sheets], axis=0)
    weight = np.sum(np.interp(away[cells], radii, largest) * fields.heat[cells], axis=1)
    order = np.argsort(weight)
    return cells[np.sort(order[np.cumsum(weight[order]) > left_out_Ohm])]


def change_where_they_meet(body: Body, electrodes: Electrodes, conductance_S: float,
                           touches: Sequence[tuple[Punch, Touch]], skin: Skin, law: Conductivity) -> Array:
    """Change (count, count), Ohm, of the impedance matrix, to first order, by what touches make of the conductance
    together more than the sum of what each makes alone, outside their contacts; 0 for one touch."""
    if len(touches) == 1:
        return np.zeros((electrodes.count,) * 2)
    places = np.array([[punch.x_m, punch.y_m] for punch, _ in touches])
    inner = np.array([touch.contact_radius_m for _, touch in touches])
    outer = np.array([[touch.radius_m[-1]] for _, touch in touches])
    fields = untouched_fields(body, electrodes, conductance_S, degree=None)
    points, area, gradient = _sampled(fields, body.thickness_m, places, inner, inner, _FADES)
    away = np.linalg.norm(points - places[:, None], axis=-1)
    outside = np.all(away > inner[:, None], axis=0) & (np.sum(away < outer, axis=0) > 1)
    points = points[outside]
    alone = [sheet_conductance(points, punch, touch, skin, law) for punch, touch in touches]
    rest = (len(touches) - 1) * conductance_S * np.eye(2)
    change = touched_conductance(points, touches, skin, law) - np.sum(alone, axis=0) + rest
    return first_order(area[outside], gradient[outside], change)


def first_order(area: Array, gradient: Array, change: Array) -> Array:
    """-int grad u_k . ds grad u_l of symmetric changes ds (n, 2, 2)."""
    x, y = gradient[:, 0], gradient[:, 1]
    xx, xy, yy = ((area * change[:, i, j])[:, None] for i, j in ((0, 0), (0, 1), (1, 1)))
    crossed = x.T @ (xy * y)
    return -(x.T @ (xx * x) + y.T @ (yy * y) + crossed + crossed.T)
