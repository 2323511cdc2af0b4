"""What electrodes and edges of a uniform skin with an outline send to circles on it that scatter.

A potential that is harmonic up to the edges is a sum of harmonics about any place, whose amplitudes are integrals of
its values and its inflow along the edges (Green's representation). Those of the electrodes are had so from the
potentials of the untouched skin; those of what the edges make of a harmonic that goes out from a response of the edges,
once a sensor, on a coarser mesh: what comes back is a small part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from scipy.sparse import csr_matrix
from skfem import ElementLineP2
from skfem.quadrature import get_quadrature

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh, eliminated
from eitsim.electrics.cem.boundary_integral import Complex
from eitsim.electrics.cem.ring_scattering import Circle, Coupling, between
from eitsim.electrics.mesh.p2_triangles import uniform_refinement, with_quarter_points
from eitsim.electrics.outline.adapted_mesh import READINGS, order_of_halved, solve_untouched
from eitsim.electrics.outline.touch_mesh import EVEN
from eitsim.electrics.outline.triangles import refined, skin_mesh
from eitsim.numerics.conductor_elimination import solve_between
from eitsim.numerics.nested_dissection import Dissection
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.polygons import corners_and_edges, edge_distance_m
from eitsim.scene.scene import Electrodes

_DEGREE = 9  # Degree of exactness of the quadrature along an edge of the mesh.
# Errors of the untouched readings from which a mesh is fine enough for a rough account of what electrodes send, and for
# what edges send back, its middle nodes then moved to a quarter of the way from the ends of electrodes.
_ROUGHLY, _RETURNED = 1e-3, 5e-3
# Sides of the mesh of what edges send back, before it is halved, are no longer than the edges over this, about.
_SHORT = 100
_SOLVED = 64  # Currents for which potentials are solved at once.
# Nodes of a P2 triangle's sides, counter-clockwise: both ends, the middle.
_SIDES = ((0, 1, 3), (1, 2, 4), (2, 0, 5))


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of a P2 mesh at points of a quadrature; the skin has line electrodes."""

    place_m: Complex  # (q,) points
    outwards_m: Complex  # (q,) outward normal times the length that the point stands for
    contact_S: Array  # (q,) that length over the contact impedance; 0 where no electrode lies
    unknown: Indices  # (k,) nodes on edges, then electrodes, among the mesh's
    value: csr_matrix  # (q, k) potential of the skin by that of these unknowns
    over: csr_matrix  # (q, k) the same less that of the electrode there; of points without one, 0


@dataclass(frozen=True, eq=False)
class EdgeResponse:
    """A uniform skin with an outline, on one mesh for what electrodes send and one for what edges send back."""

    conductance_S: float
    arriving: Edges
    # (q, N) on its edges, of 1 A into each electrode and 1/N A out of every one: potentials, V, and the potential
    # differences, V, that drive inflow under electrodes
    potential_V: Array
    driving_V: Array
    returning: Edges
    response_Ohm: Array  # (k, k) potentials of its unknowns by currents into them that sum to zero, but for a constant


# Responses with something on a coarser mesh, and what is left over the change by it.
Variations = tuple[tuple[EdgeResponse, float], ...]


@lru_cache(maxsize=8)
def edge_responses(outline: Outline, electrodes: Electrodes, conductance_S: float) -> tuple[EdgeResponse, Variations]:
    """What arrives on one of the meshes by which the untouched skin was solved (`solve_untouched`), halved, what
    returns on a coarser one, even along edges, halved; varied by what arrives on a coarser one, and by what returns on
    its own before it was halved.

    Errors fall with the square of the number of nodes of adapted meshes, with a power of the size of halved ones that
    the sharpest corner of the outline determines (`order_of_halving`).
    """
    history, z = solve_untouched(outline, electrodes, conductance_S, READINGS).history, contact_impedances(electrodes)
    rough, exact, known = (next(mesh for mesh, error in history if error <= enough)
                           for enough in (_ROUGHLY, READINGS, _RETURNED))
    order = order_of_halved(exact, electrodes)
    even = refined(known, partial(_along, outline, _around_m(outline) / _SHORT))
    rough, exact, returning = (with_quarter_points(skin_mesh(mesh, electrodes)) for mesh in (rough, exact, even))
    exact = uniform_refinement(exact)
    found = response_on(exact, uniform_refinement(returning), conductance_S, z, order)
    coarse = response_on(rough, returning, conductance_S, z)
    share = (len(rough.cells) / len(exact.cells)) ** 2
    arrives = replace(found, arriving=coarse.arriving, potential_V=coarse.potential_V, driving_V=coarse.driving_V)
    returns = replace(found, returning=coarse.returning, response_Ohm=coarse.response_Ohm)
    return found, ((arrives, share / (1 - share)), (returns, 1 / (2 ** order_of_halving(outline) - 1)))


def order_of_halving(outline: Outline) -> float:
    """Power of the size of even triangles by which errors of a smooth functional of the potential fall: 2, or twice
    pi/w of the largest angle w of the skin at its corners, about which the potential goes as r^(pi/w)."""
    largest = np.pi
    for corners in outline.loops:
        edge = np.roll(corners, -1, axis=0) - corners
        along = edge[:, 0] + 1j * edge[:, 1]
        largest = max(largest, np.pi - float(np.angle(along / np.roll(along, 1)).min()))
    return 2 * np.pi / largest


def _around_m(outline: Outline) -> float:
    """Length of all edges, m."""
    start, end = corners_and_edges(outline)
    return float(np.linalg.norm(end - start, axis=1).sum())


def _along(outline: Outline, length_m: float, places_m: Array) -> Array:
    """Area (t,), m^2, of even triangles at places (t, 2), m, with sides of a length at edges, longer with the distance.
    """
    return EVEN * (length_m + np.abs(edge_distance_m(outline, places_m))) ** 2


def response_on(arriving: SkinMesh, returning: SkinMesh, conductance_S: float, contact_impedance: Array,
                order: Dissection | None = None) -> EdgeResponse:
    """The response of a uniform skin of sheet conductance S, S, with line electrodes of contact impedances (N,), Ohm m,
    on a P2 mesh for what arrives, in an order of elimination, and one for what returns."""
    edges, back = (edges_of(mesh, contact_impedance) for mesh in (arriving, returning))
    done = eliminated(arriving, np.full(len(arriving.cells), conductance_S), contact_impedance, order=order)
    lines = len(arriving.nodes_m) + np.arange(arriving.count)
    potential = solve_between(done, lines, np.eye(arriving.count) - 1 / arriving.count, edges.unknown)
    done = eliminated(returning, np.full(len(returning.cells), conductance_S), contact_impedance)
    count = len(back.unknown)
    response = np.empty((count, count))
    for first in range(0, count, _SOLVED):
        own = back.unknown[first:first + _SOLVED]
        response[:, first:first + len(own)] = solve_between(done, own, np.eye(len(own)), back.unknown)
    return EdgeResponse(conductance_S, edges, edges.value @ potential, -(edges.over @ potential), back, response)


def edges_of(mesh: SkinMesh, contact_impedance: Array) -> Edges:
    """The edges of a P2 mesh whose line electrodes have contact impedances (N,), Ohm m."""
    sides = edge_sides(mesh)
    points, weight = get_quadrature(ElementLineP2(), _DEGREE)
    basis = [ElementLineP2().lbasis(points, i) for i in range(3)]
    shape = np.stack([np.broadcast_to(one[0], weight.shape) for one in basis], axis=1)
    slope = np.stack([np.broadcast_to(one[1][0], weight.shape) for one in basis], axis=1)
    node = mesh.nodes_m[sides][..., 0] + 1j * mesh.nodes_m[sides][..., 1]
    outwards = (-1j * (node @ slope.T) * weight).ravel()
    nodes, column = np.unique(sides, return_inverse=True)
    electrode = np.full(len(mesh.nodes_m), -1)
    electrode[mesh.under[:, 2]] = mesh.electrode
    owner = np.repeat(electrode[sides[:, 2]], len(weight))
    at, held = np.arange(len(owner)), owner >= 0
    size = (len(at), len(nodes) + mesh.count)
    value = csr_matrix((np.tile(shape.ravel(), len(sides)),
                        (np.repeat(at, 3), np.repeat(column.reshape(-1, 3), len(weight), axis=0).ravel())), shape=size)
    held_by = csr_matrix((np.ones(held.sum()), (at[held], len(nodes) + owner[held])), shape=size)
    contact = np.where(held, np.abs(outwards) / contact_impedance[owner], 0.0)
    return Edges((node @ shape.T).ravel(), outwards, contact,
                 np.append(nodes, len(mesh.nodes_m) + np.arange(mesh.count)), value,
                 value.multiply(held[:, None]).tocsr() - held_by)


def edge_sides(mesh: SkinMesh) -> Indices:
    """Nodes (n, 3) of the sides that one triangle has, both ends and the middle, the skin on their left."""
    side = np.concatenate([mesh.cells[:, nodes] for nodes in _SIDES])
    _, first, times = np.unique(side[:, 2], return_index=True, return_counts=True)
    return side[first[times == 1]]


def arriving(response: EdgeResponse, circles: Sequence[Circle], orders: int) -> Complex:
    """(circles orders, N) amplitudes a_m, V, of Re a_m (zeta/r)^m in the potential of the untouched skin about circles,
    1 A into each electrode and 1/N A out of every one."""
    order = np.tile(np.arange(1, orders + 1), len(circles))
    wave, slope = outgoing_waves(response.arriving, circles, orders)
    inflow = wave * (response.arriving.contact_S / response.conductance_S)[:, None]
    parts = inflow.view(float).T @ response.driving_V - slope.view(float).T @ response.potential_V
    return (parts[::2] + 1j * parts[1::2]) / (2 * np.pi * order[:, None])


def couplings(outline: Outline, electrodes: Electrodes, conductance_S: float, circles: Sequence[Circle],
              orders: int) -> tuple[Coupling, list[tuple[Coupling, float]]]:
    """Fields about circles by electrodes, edges and each other, in harmonics 1 to `orders`; and with each variation of
    `edge_responses`, with what it leaves."""
    found, ((arrives, share), (returns, left)) = edge_responses(outline, electrodes, conductance_S)
    known = coupling(found, circles, orders)
    same, crossed = _returning(returns, circles, orders)
    return known, [(replace(known, incoming=arriving(arrives, circles, orders)), share),
                   (replace(known, same=same, crossed=crossed), left)]


def coupling(response: EdgeResponse, circles: Sequence[Circle], orders: int) -> Coupling:
    """Fields about circles by electrodes, edges and each other, in harmonics 1 to `orders`."""
    order = np.tile(np.arange(1, orders + 1), len(circles))
    return Coupling(arriving(response, circles, orders), *_returning(response, circles, orders), order)


def _returning(response: EdgeResponse, circles: Sequence[Circle], orders: int) -> tuple[Complex, Complex]:
    """`same` and `crossed` of the coupling.

    With w_m = (zeta/r)^-m the amplitude of (zeta/r)^m in a potential u is int (w_m d_n u - u d_n w_m) / (2 pi m) along
    the edges, where S d_n u = (U - u)/z. A harmonic w_m that goes out loads nodes and electrodes by
    f_m = -S int d_n w_m v - int w_m (v - V)/z; what comes back is the amplitude of their potential, whose d_n holds
    that of -w_m, too.
    """
    sheet, order = response.conductance_S, np.tile(np.arange(1, orders + 1), len(circles))
    edges = response.returning
    wave, slope = outgoing_waves(edges, circles, orders)
    inflow = wave * (edges.contact_S / sheet)[:, None]
    loads = edge_loads(edges, sheet, wave, slope)
    moved = response.response_Ohm @ np.hstack([loads.real, loads.imag])
    moved = moved[:, :len(order)] + 1j * moved[:, len(order):]
    scale = 1 / (4 * np.pi * order[:, None])
    same = scale * (loads.T @ moved.conj() / sheet - wave.T @ (slope + inflow).conj())
    crossed = scale * (loads.T @ moved / sheet - wave.T @ (slope + inflow))
    crossed += np.block([[between(one, other, np.arange(1, orders + 1)) for other in circles] for one in circles])
    return same, crossed


def edge_loads(edges: Edges, conductance_S: float, wave: Complex, slope: Complex) -> Complex:
    """Currents (k, m) into the unknowns of edges whose potentials are what edges send back of harmonics that go out, as
    `outgoing_waves`."""
    inflow = wave * (edges.contact_S / conductance_S)[:, None]
    return np.asarray(-conductance_S * (edges.value.T @ slope + edges.over.T @ inflow), dtype=complex)


def outgoing_waves(edges: Edges, circles: Sequence[Circle], orders: int) -> tuple[Complex, Complex]:
    """(zeta/r)^-m about each circle at points of edges (q, circles orders), and its slope along the normals times the
    lengths of the points."""
    waves, slopes = [], []
    for centre, reach in circles:
        inverse = reach / (edges.place_m - centre)
        wave = np.cumprod(np.broadcast_to(inverse[:, None], (len(inverse), orders)), axis=1)
        waves.append(wave)
        slopes.append(-np.arange(1, orders + 1) / reach * wave * (inverse * edges.outwards_m)[:, None])
    return np.hstack(waves), np.hstack(slopes)
