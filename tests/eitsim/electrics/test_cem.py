"""The complete electrode model on given meshes: parity with EIDORS, convergence, balance, stiff cases."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.sparse import csc_matrix, diags_array
from scipy.sparse.linalg import splu
from skfem import MeshTri

from eitsim.electrics.cem import assembly
from eitsim.electrics.cem.assembly import (
    SkinMesh,
    centred,
    dissection,
    eliminated,
    impedance,
    potentials,
    quadrature_points,
    weights,
)
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.numerics.conductor_elimination import residual, solve
from eitsim.scene.drive import read_out
from eitsim.scene.scene import Body, Drive, Electrodes

REFERENCE = Path(__file__).parents[3].parent / "shared" / "reference" / "eit"
needs_reference = pytest.mark.skipif(not REFERENCE.exists(), reason="the reference meshes are not beside the checkout")
CASES = {"homog": (1e-3, 1e-3), "concentric": (1e-3, 4e-3)}


def reference_mesh(name: str) -> tuple[SkinMesh, np.ndarray]:
    file = np.load(REFERENCE / f"mesh_{name}.npz")
    under = file["belec"] > 0
    mesh = SkinMesh(file["nodes"], file["elems"], file["bedges"][under], file["belec"][under] - 1, 16)
    return mesh, file["region"]


def readings_of(name: str, case: str) -> np.ndarray:
    mesh, region = reference_mesh(name)
    outside, inside = CASES[case]
    return read_out(Drive(), impedance(mesh, np.where(region == 1, outside, inside), 1.0))


def graded_mesh(level: int, edge_m: float = 0.05) -> SkinMesh:
    """Concentric rings with a line at edge_m; geometric towards the electrodes' ends, each width cut in `level`."""
    end = 0.05
    arcs = np.arange(16)[:, None] * np.pi / 8 + np.array([-end, end, np.pi / 8 - end])
    pieces = [piece for a, b, c in arcs for piece in (spread(a, b, level), spread(b, c, level))]
    electrode = np.repeat([k // 2 if k % 2 == 0 else -1 for k in range(32)], [len(piece) for piece in pieces])
    outer = 0.1 - cut((0.1 - edge_m) * np.append(0.5 ** np.arange(8), 0.0), level)
    radii = np.concatenate([np.linspace(0, edge_m, 2 * level + 1)[:-1], outer])
    return ring_mesh(radii, np.zeros((len(radii), 2)), np.concatenate(pieces), electrode, 16)


def spread(start: float, stop: float, level: int) -> np.ndarray:
    """Points from start on, before stop, geometric towards both ends."""
    near = 0.5 * 0.25 ** np.arange(2, -1, -1)
    return start + (stop - start) * cut(np.concatenate([[0.0], near, 1 - near[-2::-1], [1.0]]), level)[:-1]


def cut(points: np.ndarray, parts: int) -> np.ndarray:
    return np.interp(np.arange(parts * (len(points) - 1) + 1) / parts, np.arange(len(points)), points)


def curved(mesh: SkinMesh) -> SkinMesh:
    """The same triangles with middle nodes, those of the rim on its circle."""
    triangles = MeshTri(np.ascontiguousarray(mesh.nodes_m.T), np.ascontiguousarray(mesh.cells.T), sort_t=False)
    middle, rim = mesh.nodes_m[triangles.facets].mean(axis=0), triangles.boundary_facets()
    middle[rim] *= 0.1 / np.linalg.norm(middle[rim], axis=1)[:, None]
    first, number = len(mesh.nodes_m), {tuple(sorted(f)): i for i, f in enumerate(triangles.facets.T.tolist())}
    edges = np.column_stack([mesh.under, [first + number[tuple(sorted(edge))] for edge in mesh.under.tolist()]])
    return replace(mesh, nodes_m=np.vstack([mesh.nodes_m, middle]), under=edges, element="P2",
                   cells=np.hstack([triangles.t.T, first + triangles.t2f.T]))


def plain_mesh(circles: int = 9) -> SkinMesh:
    """The same rings for all sectors, without grading."""
    angles, electrode = rim_angles(Body(), Electrodes(), 1)
    return ring_mesh(np.linspace(0, 0.1, circles), np.zeros((circles, 2)), angles, electrode, 16)


def error(readings: np.ndarray, case: str) -> float:
    exact = np.loadtxt(REFERENCE / f"analytic_{case}_single.csv", delimiter=",")
    return float(np.linalg.norm(readings - exact) / np.linalg.norm(exact))


def concentric(mesh: SkinMesh) -> np.ndarray:
    outside, inside = CASES["concentric"]
    return np.where(np.linalg.norm(quadrature_points(mesh), axis=-1) < 0.05, inside, outside)


@pytest.mark.parametrize("element", ["P1", "P2", "Q2"])
def test_the_impedance_is_that_of_a_plain_sparse_solve(element):
    rings = plain_mesh()
    mesh = {"P1": linear(rings), "P2": curved(linear(rings)), "Q2": rings}[element]
    conductance, contact = random_conductance(mesh), np.geomspace(0.1, 10, 16)
    expected = by_sparse_lu(mesh, conductance, contact, 1)
    assert np.abs(impedance(mesh, conductance, contact) - expected).max() < 1e-12 * np.abs(expected).max()


@needs_reference
@pytest.mark.parametrize("name", ["r1", "r2"])
@pytest.mark.parametrize("case", CASES)
def test_parity_with_eidors_on_the_same_mesh(name, case):
    expected = np.loadtxt(REFERENCE / f"eidors_{case}_{name}_single.csv", delimiter=",")
    assert np.abs(readings_of(name, case) / expected - 1).max() < 1e-12


@needs_reference
@pytest.mark.parametrize("case", CASES)
def test_linear_triangles_converge_to_the_mesh_free_values(case):
    coarse, fine = (error(readings_of(name, case), case) for name in ("r1", "r2"))
    rate = np.log2(coarse / fine)
    print(f"{case}: errors {coarse:.1e}, {fine:.1e}, rate {rate:.2f}")
    assert 1.2 < rate < 2.2
    assert fine < 3e-4


@needs_reference
def test_graded_quadratic_meshes_converge_to_the_mesh_free_values():
    errors = []
    for level in (1, 2, 3):
        mesh = graded_mesh(level)
        errors.append(error(read_out(Drive(), impedance(mesh, concentric(mesh), 1.0)), "concentric"))
    print(errors)
    assert errors[2] < 3e-6
    assert errors[0] > 8 * errors[1] > 8 * 3 * errors[2]


@needs_reference
def test_quadratic_triangles_with_a_curved_rim_beat_linear_ones_five_times():
    errors = []
    for name in ("r1", "r2"):
        mesh = curved(reference_mesh(name)[0])
        errors.append(error(read_out(Drive(), impedance(mesh, np.full(len(mesh.cells), 1e-3), 1.0)), "homog"))
        assert errors[-1] < error(readings_of(name, "homog"), "homog") / 5
    assert errors[1] < errors[0] / 2


def random_conductance(mesh: SkinMesh) -> np.ndarray:
    """Random anisotropic tensors at the quadrature points."""
    points = quadrature_points(mesh)
    root = np.random.default_rng(1).normal(size=(*points.shape[:2], 2, 2))
    return 1e-3 * (root @ root.swapaxes(-1, -2) + 0.5 * np.eye(2))


def matrix_of(mesh: SkinMesh, conductance: np.ndarray, contact: ArrayLike) -> csc_matrix:
    """The system's matrix, summed from the weights of its pairs."""
    return csc_matrix(incidence(mesh).T @ diags_array(weights(mesh, conductance, contact)) @ incidence(mesh))


def incidence(mesh: SkinMesh) -> csc_matrix:
    """Takes potentials to the differences of the pairs."""
    pairs = dissection(mesh).pairs
    row = np.arange(len(pairs))
    return csc_matrix((np.repeat([1.0, -1.0], len(pairs)), (np.tile(row, 2), pairs.T.ravel())))


@pytest.mark.parametrize("contact", [1e-9, 1.0, 1e6])
def test_reciprocity_of_potentials_that_are_substituted_column_by_column(contact):
    """What `impedance` makes is symmetric by its form, as no test of it could fail."""
    mesh = plain_mesh()
    z = centred(mesh, potentials(mesh, random_conductance(mesh), contact))[len(mesh.nodes_m):]
    apart = np.abs(z - z.T).max() / np.abs(z).max()
    print(f"z = {contact:g}: {apart:.1e}")
    assert apart < 1e-12


def test_currents_through_the_electrodes_are_those_driven():
    mesh, contact = plain_mesh(), 0.7
    potential = potentials(mesh, random_conductance(mesh), contact)
    under, voltage = potential[mesh.under], potential[len(mesh.nodes_m) + mesh.electrode]
    s, weight = np.polynomial.legendre.leggauss(3)
    shape = np.stack([s * (s - 1) / 2, s * (s + 1) / 2, 1 - s**2])
    slope = np.stack([s - 0.5, s + 0.5, -2 * s])
    speed = np.linalg.norm(np.einsum("kq,ekx->eqx", slope, mesh.nodes_m[mesh.under]), axis=-1)
    drop = voltage[:, None] - np.einsum("kq,ekp->eqp", shape, under)
    flow = np.einsum("eq,q,eqp->ep", speed, weight, drop) / contact
    current = np.stack([flow[mesh.electrode == k].sum(axis=0) for k in range(16)])
    assert np.abs(current - (np.eye(16) - 1 / 16)).max() < 1e-12


def test_the_discrete_system_balances_every_current():
    mesh = plain_mesh()
    conductance = random_conductance(mesh)
    drop = incidence(mesh) @ potentials(mesh, conductance, 1.0)
    current = incidence(mesh).T @ (weights(mesh, conductance, 1.0)[:, None] * drop)
    expected = np.zeros_like(current)
    expected[len(mesh.nodes_m):] = np.eye(16) - 1 / 16
    assert np.abs(current - expected).max() < 1e-12


def test_rotation_and_mirror_symmetry_on_a_symmetric_mesh():
    mesh = plain_mesh()
    radius = np.linalg.norm(quadrature_points(mesh), axis=-1)
    z = impedance(mesh, 1e-3 * (1 + radius / 0.1), 1.0)
    assert np.abs(np.roll(z, (1, 1), (0, 1)) - z).max() < 1e-10 * np.abs(z).max()
    assert np.abs(np.roll(z[::-1, ::-1], (1, 1), (0, 1)) - z).max() < 1e-10 * np.abs(z).max()


def extended(mesh: SkinMesh, conductance: np.ndarray, contact: float) -> np.ndarray:
    """The impedance matrix in extended precision: refinement with residuals and iterates in long doubles."""
    done = eliminated(mesh, conductance, contact)
    one, other = dissection(mesh).pairs.T
    weight = weights(mesh, conductance, contact).astype(np.longdouble)[:, None]
    currents = np.zeros((len(mesh.nodes_m) + 16, 15), dtype=np.longdouble)
    currents[len(mesh.nodes_m): -1] = np.eye(15)
    x = np.zeros_like(currents)
    for _ in range(4):
        left = currents.copy()
        flow = weight * (x[one] - x[other])
        np.subtract.at(left, one, flow)
        np.add.at(left, other, flow)
        x += solve(done, left.astype(float))
    z = np.zeros((16, 16), dtype=np.longdouble)
    z[:, :-1] = x[len(mesh.nodes_m):]
    centre = np.eye(16) - np.longdouble(1) / 16
    return centre @ z @ centre


def by_sparse_lu(mesh: SkinMesh, conductance: np.ndarray, contact: ArrayLike, refinements: int = 0) -> np.ndarray:
    """The impedance matrix by SuperLU."""
    matrix, centre = matrix_of(mesh, conductance, contact), np.eye(16) - 1 / 16
    current, potential = np.zeros((2, len(mesh.nodes_m) + 16, 16))
    current[-16:] = centre
    solve_earthed = splu(csc_matrix(matrix[:-1, :-1]), permc_spec="MMD_AT_PLUS_A").solve
    for _ in range(1 + refinements):
        potential[:-1] += solve_earthed(residual(eliminated(mesh, conductance, contact), current, potential)[:-1])
    return centre @ potential[-16:]


def linear(rings: SkinMesh) -> SkinMesh:
    """The same nodes as linear triangles."""
    quarters = [(0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)]
    corners = [[q[i] for i in corner] for q in quarters for corner in ((0, 1, 2), (0, 2, 3))]
    cells = np.concatenate([rings.cells[:, three] for three in corners])
    cells = cells[[len(set(cell)) == 3 for cell in cells.tolist()]]
    under = np.concatenate([rings.under[:, [0, 2]], rings.under[:, [2, 1]]])
    return replace(rings, cells=cells, under=under, electrode=np.tile(rings.electrode, 2), element="P1")


@needs_reference
def test_contrast_of_a_million_and_perfect_contacts_cost_no_digits():
    mesh, region = reference_mesh("r1")
    conductance = np.where(region == 3, 1e3, 1e-3)
    exact = extended(mesh, conductance, 1e-6)
    found = [impedance(mesh, conductance, 1e-6), impedance(mesh, conductance, 1e-6, refinements=1),
             by_sparse_lu(mesh, conductance, 1e-6)]
    plain, refined, lu = (float(np.abs(z - exact).max() / np.abs(exact).max()) for z in found)
    print(f"relative error {plain:.1e}, after a refinement {refined:.1e}; {lu:.1e} by LU of the matrix")
    assert lu > 1e-10
    assert plain < 1e-14
    assert refined < 1e-14


@pytest.mark.parametrize("contact", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("contrast", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("element", ["P1", "P2", "Q2"])
def test_no_contrast_and_no_contact_costs_digits(element, contrast, contact):
    rings = plain_mesh(5)
    mesh = {"P1": linear(rings), "P2": curved(linear(rings)), "Q2": rings}[element]
    inside = np.hypot(*(mesh.nodes_m[mesh.cells].mean(axis=1) - [0.03, 0.02]).T) < 0.03
    conductance = np.where(inside, 1e-3 * contrast, 1e-3)
    exact = extended(mesh, conductance, contact)
    assert np.abs(impedance(mesh, conductance, contact) - exact).max() < 1e-13 * np.abs(exact).max()


def test_a_poor_contact_is_refused_where_it_hides_the_resistance_between_others():
    """Up to 1e10 Ohm m under one electrode that between two others keeps four digits; beyond, the double has none."""
    mesh = plain_mesh(5)

    def between(poor: float) -> float:
        z = impedance(mesh, np.full(len(mesh.cells), 1e-3), np.where(np.arange(16) == 3, poor, 1.0))
        return z[0, 0] + z[8, 8] - 2 * z[0, 8]

    assert between(1e10) == pytest.approx(between(1e5), rel=1e-4)
    with pytest.raises(ValueError, match="all but without contact"):
        between(1e15)


@pytest.mark.parametrize("digits", [3.95, 4.05])
def test_resistances_between_electrodes_keep_four_digits(digits: float):
    """Between two electrodes at r = eps 10^digits of the largest entry."""
    r = np.finfo(float).eps * 10**digits
    z = np.diag([1.0, 1.0, 1.0])
    z[0, 1] = z[1, 0] = 1 - r / 2
    if digits < 4:
        with pytest.raises(ValueError, match="fewer than four digits"):
            assembly.resolved(z)
    else:
        assert assembly.resolved(z) is z


def test_wrong_input_is_refused():
    mesh = plain_mesh()
    with pytest.raises(ValueError, match="contact impedance must be positive"):
        impedance(mesh, np.ones(len(mesh.cells)), 0.0)
    with pytest.raises(ValueError, match="conductance must be positive"):
        impedance(mesh, -np.ones(len(mesh.cells)), 1.0)
    for tensor, message in (([[1.0, 0.0], [5.0, 1.0]], "must be symmetric"), ([[1e-3, 2e-3], [2e-3, 1e-3]], "definite"),
                            ([[-1.0, 0.0], [0.0, -1.0]], "definite"), ([[1.0, 0.0], [np.nan, 1.0]], "symmetric")):
        conductance = np.broadcast_to(np.eye(2), (*quadrature_points(mesh).shape[:2], 2, 2)).copy()
        conductance[7] = tensor
        with pytest.raises(ValueError, match=message):
            impedance(mesh, conductance, 1.0)
    with pytest.raises(ValueError, match=r"'Q3' is unknown; known: P1, P2, Q2"):
        replace(mesh, element="Q3")
    with pytest.raises(ValueError, match="electrode 3"):
        replace(mesh, under=mesh.under[mesh.electrode != 3], electrode=mesh.electrode[mesh.electrode != 3])
    with pytest.raises(ValueError, match="folded over"):
        impedance(replace(mesh, cells=mesh.cells[:, [0, 2, 1, 3, 4, 5, 6, 7, 8]]), np.ones(len(mesh.cells)), 1.0)
