"""The complete electrode model on given meshes: parity with EIDORS, convergence, balance, stiff cases."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csc_matrix
from skfem import MeshTri

from eitsim.cem import SkinMesh, impedance, potentials, quadrature_points, sparsity, system
from eitsim.drive import read_out
from eitsim.linear import factorise
from eitsim.scene import Body, Drive, Electrodes
from eitsim.template import rim_angles, ring_mesh

REFERENCE = Path(__file__).parents[2].parent / "shared" / "reference" / "eit"
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


def plain_mesh() -> SkinMesh:
    """The same rings for all sectors, without grading."""
    angles, electrode = rim_angles(Body(), Electrodes(), 1)
    radii = np.linspace(0, 0.1, 9)
    return ring_mesh(radii, np.zeros((9, 2)), angles, electrode, 16)


def error(readings: np.ndarray, case: str) -> float:
    exact = np.loadtxt(REFERENCE / f"analytic_{case}_single.csv", delimiter=",")
    return float(np.linalg.norm(readings - exact) / np.linalg.norm(exact))


def concentric(mesh: SkinMesh) -> np.ndarray:
    outside, inside = CASES["concentric"]
    return np.where(np.linalg.norm(quadrature_points(mesh), axis=-1) < 0.05, inside, outside)


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


def test_reciprocity():
    mesh = plain_mesh()
    z = impedance(mesh, random_conductance(mesh), 1.0)
    assert np.abs(z - z.T).max() < 1e-12 * np.abs(z).max()


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
    conductance, pattern = random_conductance(mesh), sparsity(mesh)
    matrix = csc_matrix((system(mesh, conductance, 1.0, pattern), (pattern.row, pattern.column)))
    current = matrix @ potentials(mesh, conductance, 1.0)
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
    pattern = sparsity(mesh)
    values = system(mesh, conductance, contact, pattern)
    order = pattern.size - 1
    solve = factorise(csc_matrix((values[pattern.kept], pattern.kept_row, pattern.kept_pointer), (order, order)))
    off = pattern.row != pattern.column
    row, column, weight = pattern.row[off], pattern.column[off], values[off].astype(np.longdouble)[:, None]
    x = np.zeros((pattern.size, 15), dtype=np.longdouble)
    for _ in range(8):
        residual = np.zeros_like(x)
        residual[len(mesh.nodes_m): -1] = np.eye(15)
        np.subtract.at(residual, column, weight * (x[row] - x[column]))
        x[:-1] += solve(residual[:-1].astype(float))
    z = np.zeros((16, 16), dtype=np.longdouble)
    z[:, :-1] = x[len(mesh.nodes_m):]
    centre = np.eye(16) - np.longdouble(1) / 16
    return centre @ z @ centre


@needs_reference
def test_contrast_of_a_million_and_perfect_contacts_cost_no_digits():
    mesh, region = reference_mesh("r1")
    conductance = np.where(region == 3, 1e3, 1e-3)
    exact = extended(mesh, conductance, 1e-6)
    lost = [float(np.abs(impedance(mesh, conductance, 1e-6, refinements=n) - exact).max() / np.abs(exact).max())
            for n in (0, 1)]
    print(f"relative error without refinement {lost[0]:.1e}, with one step {lost[1]:.1e}")
    assert lost[0] > 1e-10
    assert lost[1] < 1e-14


def test_wrong_input_is_refused():
    mesh = plain_mesh()
    with pytest.raises(ValueError, match="contact impedance must be positive"):
        impedance(mesh, np.ones(len(mesh.cells)), 0.0)
    with pytest.raises(ValueError, match="conductance must be positive"):
        impedance(mesh, -np.ones(len(mesh.cells)), 1.0)
    with pytest.raises(ValueError, match=r"'Q3' is unknown; known: P1, P2, Q2"):
        replace(mesh, element="Q3")
    with pytest.raises(ValueError, match="electrode 3"):
        replace(mesh, under=mesh.under[mesh.electrode != 3], electrode=mesh.electrode[mesh.electrode != 3])
    with pytest.raises(ValueError, match="folded over"):
        impedance(replace(mesh, cells=mesh.cells[:, [0, 2, 1, 3, 4, 5, 6, 7, 8]]), np.ones(len(mesh.cells)), 1.0)
