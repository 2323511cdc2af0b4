"""Admittance of line electrodes along an outline, as they slide, widen and change, and its derivatives.

Electrodes end anywhere on the edges of one mesh, which is made once for given places of them and is fine wherever they
may end. So readings depend smoothly on where they lie, and derivatives are those of the model on this mesh: with
a(u, v) = int S grad u . grad v + 1/z int (u - U)(v - V) an end that moves by ds along the edge adds
(u - U)(v - V) ds / z there. Ends that lie inside triangles make readings wrong by some 2e-4, 2-norm; at the places
that the mesh is made for they lie at its nodes.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial import KDTree

from eitsim.electrics.cem.adjoint import impedance_by_contact
from eitsim.electrics.cem.assembly import (
    Array,
    Indices,
    SkinMesh,
    centred,
    dissection,
    edge_functions,
    gradients,
    potentials,
    quadrature_points,
)
from eitsim.electrics.cem.uneven_sheet import MODES, sheet_modes
from eitsim.electrics.outline.adapted_mesh import solve_untouched
from eitsim.electrics.outline.edge_response import edge_sides
from eitsim.electrics.outline.touch_mesh import EVEN
from eitsim.electrics.outline.triangles import refined, skin_mesh
from eitsim.numerics.nested_dissection import Dissection
from eitsim.scene.edges.outline_electrodes import stretches_along
from eitsim.scene.electrodes import contact_impedances, widths
from eitsim.scene.outline_edge import arcs_of, edge_starts, places_along
from eitsim.scene.scene import Body, Electrodes

# How far an electrode's ends may move from their places in the mesh, m and over its width, and how much longer its
# triangles' sides grow away from where they may lie.
_SLIDES_M, _WIDENS, _GROWTH = 3e-3, 0.3, 0.7
# Meshes by the estimated error of the readings, electrodes where they are made for them, and by how fine they are where
# electrodes may end, over the narrowest one's width.
ROUGHLY, CLOSELY = (2e-3, 1 / 20), (2e-5, 1 / 80)
_ON_EDGE = 1e-9  # Distance from the edge, over its length, of points that lie on it.
_DEGREE = 2  # Of the quadrature of derivatives by the sheet's modes.


@dataclass(frozen=True, eq=False)
class SlidingMesh:
    """A mesh of a skin on whose edges electrodes end anywhere near given places."""

    body: Body
    mesh: SkinMesh  # its parts under electrodes are all edges that each may reach
    order: Dissection
    middle_m: Array  # (N,) arc lengths of the electrodes' middles from the outer edge's first corner
    reach_m: Array  # (N,) how far on either side of them an electrode's ends may lie
    part_m: Array  # (parts, 2) arc lengths of the ends of the parts from the middles of their electrodes
    length_m: float  # length of the outer edge

    @cached_property
    def psi(self) -> Array:
        """(modes, cells, q) modes of the sheet where the mesh needs its conductance."""
        return sheet_modes(self.body, quadrature_points(self.mesh))

    @cached_property
    def psi_of_slopes(self) -> Array:
        """(modes, cells, q) the same where derivatives by them are summed."""
        return sheet_modes(self.body, quadrature_points(self.mesh, degree=_DEGREE))


@dataclass(frozen=True, eq=False)
class EdgeAdmittance:
    """Admittance of a skin's line electrodes, currents into them by their potentials, and its derivatives, as those of
    a disc (`boundary_integral.RimAdmittance`); places are arc lengths over the body's radius."""

    sliding: SlidingMesh
    mesh: SkinMesh  # with what the electrodes cover
    electrodes: Electrodes
    conductance_S: float
    modes: Array  # how uneven the sheet is
    ends_m: Array  # (N, 2) arc lengths of the electrodes' ends, as `part_m` of the mesh
    potential_Ohm: Array  # (nodes + N, N), of 1 A into each electrode and 1/N A out of every one

    @cached_property
    def admittance_S(self) -> Array:
        """(N, N), S; rows and columns sum to zero."""
        z = centred(self.mesh, self.potential_Ohm)[-self.mesh.count:]
        return np.asarray(np.linalg.pinv((z + z.T) / 2, hermitian=True), dtype=float)

    @cached_property
    def by_layer(self) -> Array:
        """(N, N, N) S; [k]: by S z / R of electrode k."""
        return self._changed(self._radius_m / self.conductance_S * impedance_by_contact(
            self.mesh, self.potential_Ohm, contact_impedances(self.electrodes)))

    @cached_property
    def by_angle(self) -> Array:
        """(N, N, N) S; [k]: by the place of the middle of electrode k along the edge, over R."""
        first, last = self._by_ends
        return self._changed(self._radius_m * (first + last))

    @cached_property
    def by_width(self) -> Array:
        """(N, N, N) S; [k]: by ln of the width of electrode k."""
        first, last = self._by_ends
        return self._changed(widths(self.electrodes)[:, None, None] / 2 * (last - first))

    @cached_property
    def by_sheet(self) -> Array:
        """(modes, N, N) S; by each mode of ln of the sheet conductance (`uneven_sheet`)."""
        mesh, psi = self.mesh, self.sliding.psi_of_slopes
        gradient, area = gradients(mesh, self.potential_Ohm[:len(mesh.nodes_m)], degree=_DEGREE)
        weight = self.conductance_S * area * np.exp(np.tensordot(self.modes, psi, 1)) * psi
        flat = gradient.reshape(-1, mesh.count)
        return self._changed(-np.stack([flat.T @ (np.repeat(one.ravel(), 2)[:, None] * flat) for one in weight]))

    @property
    def _radius_m(self) -> float:
        return self.sliding.body.edge.size_m

    @cached_property
    def _by_ends(self) -> tuple[Array, Array]:
        """(N, N, N) Ohm/m, twice: dZ by the arc length of the first end of each electrode, and of the last."""
        z = contact_impedances(self.electrodes)[:, None, None]
        first, last = (self._squared_at(end) / z for end in self.ends_m.T)
        return first, -last

    def _squared_at(self, end_m: Array) -> Array:
        """(N, N, N) (u_k - U_k)(u_l - U_l) at one end of each electrode, electrodes first."""
        part = _part_of(self.sliding, self.mesh.electrode, end_m)
        first, last = self.sliding.part_m[part].T
        value, _ = edge_functions(self.mesh.element, (end_m - first) / (last - first))
        over = np.einsum("ei,eik->ek", value, self.potential_Ohm[self.mesh.under[part]]
                         ) - self.potential_Ohm[-self.mesh.count:]
        return over[:, :, None] * over[:, None]

    def _changed(self, impedance_by: Array) -> Array:
        return -self.admittance_S @ impedance_by @ self.admittance_S


@lru_cache(maxsize=4)
def sliding_mesh(body: Body, electrodes: Electrodes, conductance_S: float,
                 kind: tuple[float, float] = ROUGHLY) -> SlidingMesh:
    """The mesh, ROUGHLY or CLOSELY, for electrodes near given ones on a skin of about sheet conductance S, S;
    NotConverged as `solve_untouched`."""
    error, fineness = kind
    known = next(mesh for mesh, left in solve_untouched(body.outline, electrodes, conductance_S, error).history
                 if left <= error)
    length, middle = edge_starts(body.outline)[-1], stretches_along(body.outline, electrodes).mean(axis=1)
    width = widths(electrodes)
    moves, fine = _SLIDES_M + _WIDENS * width, fineness * float(width.min())
    ends = KDTree(places_along(body.outline, np.concatenate([
        np.arange(at + side * half - move, at + side * half + move, fine / 2)
        for at, half, move in zip(middle, width / 2, np.minimum(moves, width), strict=True) for side in (-1, 1)])))
    triangles = refined(known, lambda places: EVEN * (fine + _GROWTH * ends.query(places)[0]) ** 2)
    mesh = skin_mesh(triangles, electrodes)
    sides = edge_sides(mesh)
    sides = sides[arcs_of(body.outline, mesh.nodes_m[sides[:, 2]])[1] < _ON_EDGE * length]
    start, stop = (arcs_of(body.outline, mesh.nodes_m[sides[:, k]])[0] for k in (0, 1))
    half = np.mod(stop - start, length) / 2
    reach = width / 2 + moves
    from_middle = np.mod(start + half - middle[:, None] + length / 2, length) - length / 2
    electrode, side = np.nonzero(np.abs(from_middle) <= reach[:, None] + half)
    part = from_middle[electrode, side][:, None] + half[side][:, None] * np.array([-1.0, 1.0])
    mesh = replace(mesh, under=sides[side], electrode=electrode)
    return SlidingMesh(body, mesh, dissection(mesh), middle, reach, part, float(length))


def edge_admittance(sliding: SlidingMesh, electrodes: Electrodes, conductance_S: float,
                    modes: Array | None = None) -> EdgeAdmittance:
    """The admittance of a skin's line electrodes on a sheet of conductance S, S; modes: how uneven the sheet is
    (`uneven_sheet`).

    ValueError where electrodes overlap or have left the part of the edge that the mesh is fine on, or one is missing.
    """
    if electrodes.kind != "line" or electrodes.missing:
        raise ValueError("the admittance of the edge is built for line electrodes which all have contact.")
    ends, under = _ends(sliding, electrodes), sliding.mesh.electrode
    first, last = sliding.part_m[:, :1], sliding.part_m[:, 1:]
    mesh = replace(sliding.mesh, covered=np.clip((ends[under] - first) / (last - first), 0, 1))
    mode, sheet = np.zeros(len(MODES)) if modes is None else modes, np.full(len(mesh.cells), conductance_S)
    if mode.any():
        sheet = conductance_S * np.exp(np.tensordot(mode, sliding.psi, 1))
    potential = potentials(mesh, sheet, contact_impedances(electrodes), order=sliding.order)
    return EdgeAdmittance(sliding, mesh, electrodes, conductance_S, mode, ends, potential)


def _ends(sliding: SlidingMesh, electrodes: Electrodes) -> Array:
    """(N, 2) arc lengths of the electrodes' ends, m, as `part_m` of the mesh."""
    found, length = stretches_along(sliding.body.outline, electrodes), sliding.length_m
    middle = np.mod(found.mean(axis=1) - sliding.middle_m + length / 2, length) - length / 2
    ends = middle[:, None] + np.diff(found, axis=1) / 2 * np.array([-1.0, 1.0])
    away = np.abs(ends).max(axis=1)
    if len(lost := np.flatnonzero(away > sliding.reach_m)):
        raise ValueError(f"electrode {lost[0]} (from 0) ends {away[lost[0]] * 1e3:.3g} mm from where its middle was "
                         f"expected, and {sliding.reach_m[lost[0]] * 1e3:.3g} mm are the most.")
    return ends


def _part_of(sliding: SlidingMesh, electrode: Indices, end_m: Array) -> Indices:
    """(N,) the part of each electrode on which, or next to which, a place (N,) lies."""
    off = np.abs(sliding.part_m - end_m[electrode, None]).sum(axis=1) - np.diff(sliding.part_m, axis=1)[:, 0]
    order = np.lexsort((off, electrode))
    return order[np.unique(electrode[order], return_index=True)[1]]
