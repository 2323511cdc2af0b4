"""What the edges of a uniform skin with line electrodes send back to circles on it that scatter.

A potential that is harmonic up to the edges is a sum of harmonics about any place, whose amplitudes are integrals of
its values and its inflow along the edges (Green's representation); those of what the edges make of a harmonic that
goes out are had by solving for it on the mesh of the untouched skin, whose factor is kept.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_matrix
from skfem import ElementLineP2
from skfem.quadrature import get_quadrature

from eitsim.electrics.cem.assembly import Array, Indices, SkinMesh, eliminated
from eitsim.electrics.cem.boundary_integral import Complex
from eitsim.electrics.cem.ring_scattering import Circle, Coupling, between
from eitsim.electrics.mesh.p2_triangles import EDGES, sides, uniform_refinement
from eitsim.electrics.outline.adapted_mesh import solve_untouched
from eitsim.electrics.outline.triangles import skin_mesh
from eitsim.numerics.conductor_elimination import Elimination, solve
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.outline import Outline
from eitsim.scene.scene import Electrodes

_DEGREE = 9  # Degree of exactness of the quadrature along an edge of the mesh.


@dataclass(frozen=True, eq=False)
class EdgeResponse:
    """A uniform skin with an outline, solved on one mesh, and its edges at points of a quadrature."""

    conductance_S: float
    place_m: Complex  # (q,) points along all edges
    outwards_m: Complex  # (q,) outward normal times the length that the point stands for
    contact_S: Array  # (q,) that length over the contact impedance; 0 where no electrode lies
    value: csr_matrix  # (q, unknowns) potential of the skin, by the potentials of nodes and electrodes
    against: csr_matrix  # (q, unknowns) the same less that of the electrode there; of points without one, 0
    elimination: Elimination
    potential_V: Array  # (unknowns, N) by 1 A into each electrode and 1/N A out of every one


@lru_cache(maxsize=8)
def edge_responses(outline: Outline, electrodes: Electrodes, conductance_S: float) -> tuple[EdgeResponse, EdgeResponse]:
    """On the mesh of the untouched skin (`solve_untouched`), and on it halved."""
    mesh = skin_mesh(solve_untouched(outline, electrodes, conductance_S).triangles, electrodes)
    z = contact_impedances(electrodes)
    return response_on(mesh, conductance_S, z), response_on(uniform_refinement(mesh), conductance_S, z)


def response_on(mesh: SkinMesh, conductance_S: float, contact_impedance: Array) -> EdgeResponse:
    """The edges of a P2 mesh of a uniform skin of sheet conductance S, S, with line electrodes of contact impedances
    (N,), Ohm m."""
    edges = _edges(mesh)
    size, count = len(mesh.nodes_m) + mesh.count, len(edges)
    points, weight = get_quadrature(ElementLineP2(), _DEGREE)
    basis = [ElementLineP2().lbasis(points, i)[0] for i in range(3)]
    shape = np.stack([np.broadcast_to(one, weight.shape) for one in basis], axis=1)
    place, along = (shape @ ends[..., None] for ends in (
        _complex(mesh.nodes_m[edges]), np.repeat(np.diff(_complex(mesh.nodes_m[edges[:, :2]])), 3, axis=1)))
    electrode = np.full(len(mesh.nodes_m), -1)
    electrode[mesh.under[:, 2]] = mesh.electrode
    owner = np.repeat(electrode[edges[:, 2]], len(weight))
    at = np.arange(count * len(weight))
    value = csr_matrix((np.tile(shape.ravel(), count), (np.repeat(at, 3), np.repeat(edges, len(weight), axis=0).ravel())),
                       shape=(len(at), size))
    held = owner >= 0
    under = csr_matrix((held.astype(float), (at, at)), shape=(len(at), len(at)))
    electrodes = csr_matrix((np.ones(held.sum()), (at[held], len(mesh.nodes_m) + owner[held])), shape=(len(at), size))
    outwards = -1j * along[..., 0].ravel() * np.tile(weight, count)
    contact = np.where(held, np.abs(outwards) / contact_impedance[owner], 0.0)
    done = eliminated(mesh, np.full(len(mesh.cells), conductance_S), contact_impedance)
    currents = np.zeros((size, mesh.count))
    currents[-mesh.count:] = np.eye(mesh.count) - 1 / mesh.count
    return EdgeResponse(conductance_S, place[..., 0].ravel(), outwards, contact, value, under @ value - electrodes, done,
                        solve(done, currents))


def _edges(mesh: SkinMesh) -> Indices:
    """Nodes (n, 3) of the edges that one triangle has, both ends and the middle, the skin on their left."""
    corner = np.concatenate([mesh.cells[:, [a, b, middle]] for a, b, middle in ((0, 1, 3), (1, 2, 4), (2, 0, 5))])
    _, first, times = np.unique(corner[:, 2], return_index=True, return_counts=True)
    return corner[first[times == 1]]


def _complex(points: Array) -> Complex:
    return points[..., 0] + 1j * points[..., 1]


def coupling(response: EdgeResponse, circles: Sequence[Circle], orders: int) -> Coupling:
    """Fields about circles by electrodes, edges and each other, in harmonics 1 to `orders`.

    A harmonic (zeta/r)^-m that goes out of a circle loads nodes and electrodes by
    f_m = -S int d_n(zeta/r)^-m v - int (zeta/r)^-m (v - V)/z along the edges; the amplitude of (zeta/r)^m in a
    potential u of the untouched skin is f_m . u / (2 pi m S), and what the edges send back is of the same form.
    """
    m, sheet = np.arange(1, orders + 1), response.conductance_S
    waves = [(reach / (response.place_m - centre))[:, None] ** m for centre, reach in circles]
    slopes = [-(m / reach) * wave * (reach / (response.place_m - centre) * response.outwards_m)[:, None]
              for wave, (centre, reach) in zip(waves, circles, strict=True)]
    wave, slope = np.hstack(waves), np.hstack(slopes)
    order = np.tile(m, len(circles))
    loads = -(response.value.T @ (sheet * slope) + response.against.T @ (wave * response.contact_S[:, None]))
    moved = solve(response.elimination, np.hstack([loads.real, loads.imag]))
    moved = moved[:, :len(order)] + 1j * moved[:, len(order):]
    inflow = slope + wave * (response.contact_S / sheet)[:, None]
    scale = 1 / (4 * np.pi * order[:, None])
    same = scale * (loads.T @ moved.conj() / sheet - wave.T @ inflow.conj())
    crossed = scale * (loads.T @ moved / sheet - wave.T @ inflow)
    crossed += np.block([[between(one, other, m) for other in circles] for one in circles])
    return Coupling(2 * scale * (loads.T @ response.potential_V) / sheet, same, crossed, order)
