"""Quadratic triangles that are halved again and again at electrode ends, against values without a mesh."""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree
from skfem import MeshTri

from eitsim.electrics.cem.assembly import SkinMesh, impedance
from eitsim.electrics.interop.solve_file import quadratic
from eitsim.scene.drive import read_out
from eitsim.scene.scene import Drive

REFERENCE = Path(__file__).parents[3].parent / "shared" / "reference" / "eit"
needs_reference = pytest.mark.skipif(not REFERENCE.exists(), reason="the reference values are not beside the checkout")
RIM, EDGE, HALF_RAD, PITCH_RAD = 0.1, 0.05, 0.05, np.pi / 8
# conductance outside and inside EDGE, S
CASES = {"homog": (1e-3, 1e-3), "concentric": (1e-3, 4e-3)}


def even_triangles() -> MeshTri:
    """Triangles about 2.5 mm wide outside EDGE and coarser inside, with nodes at all electrode ends and on EDGE."""
    pitch = np.concatenate([np.linspace(-HALF_RAD, HALF_RAD, 5)[:-1],
                            np.linspace(HALF_RAD, PITCH_RAD - HALF_RAD, 13)[:-1]])
    angles = (np.arange(16)[:, None] * PITCH_RAD + pitch).ravel()
    radii = np.concatenate([np.linspace(RIM, EDGE, 21), np.linspace(EDGE, 0, 11)[1:-1]])
    nodes, cells, first = [on_ring(radii[0], angles)], [], 0
    for outer, inner in itertools.pairwise(radii):
        kept, count = merged(angles, 1.5 * (outer - inner) / inner), len(angles)
        start, stop, own = kept[:-1], kept[1:], first + count + np.arange(len(kept) - 1)
        along, following = first + (start + 1) % count, np.roll(own, -1)
        cells += [np.stack([first + start, along, own]), np.stack([along, following, own]),
                  np.stack([along, first + stop % count, following])[:, stop - start == 2]]
        angles, first = angles[start], first + count
        nodes.append(on_ring(inner, angles))
    last = first + np.arange(len(angles))
    cells.append(np.stack([last, np.roll(last, -1), np.full(len(last), first + len(last))]))
    return MeshTri(np.hstack([*nodes, np.zeros((2, 1))]), np.hstack(cells))


def on_ring(radius: float, angles: np.ndarray) -> np.ndarray:
    return radius * np.stack([np.cos(angles), np.sin(angles)])


def merged(angles: np.ndarray, longest: float) -> np.ndarray:
    """Numbers of the angles that stay, and their count: one is left out where both gaps beside it are short."""
    closed, kept = np.append(angles, angles[0] + 2 * np.pi), [0]
    while kept[-1] < len(angles):
        i = kept[-1]
        kept.append(i + 2 if i + 2 < len(closed) and closed[i + 2] - closed[i] <= longest else i + 1)
    return np.array(kept)


def graded_triangles(times: int) -> SkinMesh:
    """The even triangles, refined so often about electrode ends, each time half as far as before."""
    mesh, sides = even_triangles(), np.arange(16)[:, None] * PITCH_RAD + [-HALF_RAD, HALF_RAD]
    ends = KDTree(on_ring(RIM, sides.ravel()).T)
    for k in range(times):
        near = ends.query(mesh.p[:, mesh.t].mean(axis=1).T)[0] < 5.5e-3 * 0.5**k
        mesh = mesh.refined(np.flatnonzero(near))
        rim, nodes = np.unique(mesh.facets[:, mesh.boundary_facets()]), mesh.p.copy()
        nodes[:, rim] *= RIM / np.linalg.norm(nodes[:, rim], axis=0)
        mesh = MeshTri(nodes, mesh.t)
    edges = mesh.facets[:, mesh.boundary_facets()].T
    turns = np.arctan2(*mesh.p[::-1, edges].mean(axis=2)) / PITCH_RAD
    nearest = np.round(turns)
    under = np.abs(turns - nearest) < HALF_RAD / PITCH_RAD
    return curved(quadratic(SkinMesh(mesh.p.T.copy(), mesh.t.T.copy(), edges[under],
                                     nearest[under].astype(int) % 16, 16)))


def curved(mesh: SkinMesh) -> SkinMesh:
    """Middle nodes moved to the rim and to EDGE where both ends of theirs lie there."""
    nodes = mesh.nodes_m.copy()
    for one, other, middle in ((0, 1, 3), (1, 2, 4), (0, 2, 5)):
        radius = np.linalg.norm(nodes[mesh.cells[:, [one, other]]], axis=2)
        for circle in (RIM, EDGE):
            on = mesh.cells[np.all(np.abs(radius - circle) < 1e-9, axis=1), middle]
            nodes[on] *= circle / np.linalg.norm(nodes[on], axis=1)[:, None]
    return replace(mesh, nodes_m=nodes)


def error(mesh: SkinMesh, case: str) -> float:
    outside, inside = CASES[case]
    middle = np.linalg.norm(mesh.nodes_m[mesh.cells[:, :3]].mean(axis=1), axis=1)
    readings = read_out(Drive(), impedance(mesh, np.where(middle < EDGE, inside, outside), 1.0))
    exact = np.loadtxt(REFERENCE / f"analytic_{case}_single.csv", delimiter=",")
    return float(np.linalg.norm(readings - exact) / np.linalg.norm(exact))


@needs_reference
@pytest.mark.parametrize("case", CASES)
def test_quadratic_triangles_graded_at_electrode_ends_reach_a_millionth(case):
    meshes = [graded_triangles(times) for times in (1, 3, 5)]
    errors = [error(mesh, case) for mesh in meshes]
    print(f"{case}: {[len(mesh.cells) for mesh in meshes]} triangles, errors {errors}")
    assert len(meshes[-1].cells) <= 20_000
    assert errors[-1] < 1e-6
    assert errors[0] > 5 * errors[1] > 5 * 5 * errors[2]
