"""Elimination front by front: exact however stiff, in any order of this mesh alone, refused where torn."""

import decimal
import json
import os
import subprocess
import sys
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import SkinMesh, dissection, eliminated, impedance, potentials
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.numerics.conductor_elimination import Detached, eliminate, residual, solve, solve_between
from eitsim.numerics.nested_dissection import dissect
from eitsim.scene.scene import Body, Electrodes


def rings(count: int = 9) -> SkinMesh:
    angles, electrode = rim_angles(Body(), Electrodes(), 1)
    return ring_mesh(np.linspace(0, 0.1, count), np.zeros((count, 2)), angles, electrode, 16)


def halves() -> SkinMesh:
    """The rings cut through along the y axis: their nodes there, the centre too, are doubled."""
    mesh = rings()
    right = mesh.nodes_m[mesh.cells].mean(axis=1)[:, 0] > 0
    shared = np.intersect1d(mesh.cells[right], mesh.cells[~right])
    doubled = np.arange(len(mesh.nodes_m))
    doubled[shared] = len(mesh.nodes_m) + np.arange(len(shared))
    cells = np.where(right[:, None], doubled[mesh.cells], mesh.cells)
    on_right = mesh.nodes_m[mesh.under].mean(axis=1)[:, 0] > 0
    under = np.where(on_right[:, None], doubled[mesh.under], mesh.under)
    return replace(mesh, nodes_m=np.vstack([mesh.nodes_m, mesh.nodes_m[shared]]), cells=cells, under=under)


def test_a_stiff_network_keeps_every_digit():
    rng = np.random.default_rng(3)
    size, last = 24, 4
    cells = np.array([rng.choice(size, 3, replace=False) for _ in range(200)])
    order = dissect(rng.normal(size=(200, 2)), [cells, np.array([[0, size + k] for k in range(last)])], last)
    weights = 10.0 ** rng.uniform(-15, 15, len(order.pairs))
    assert len(order.height) > 7
    potential = solve(eliminate(order, weights), np.eye(size + last))
    with decimal.localcontext(prec=120):
        matrix = [[Decimal(0)] * (size + last) for _ in range(size + last)]
        for (i, j), w in zip(order.pairs.tolist(), weights.tolist(), strict=True):
            for a, b in ((i, j), (j, i)):
                matrix[a][a] += Decimal(w)
                matrix[a][b] -= Decimal(w)
        exact = [float(effective_resistance(matrix, k)) for k in range(size + last - 1)]
    np.testing.assert_allclose(np.diagonal(potential)[:-1], exact, rtol=1e-13)


def effective_resistance(matrix: list[list[Decimal]], at: int) -> Decimal:
    """Between an unknown and the last one, by Gaussian elimination of all others."""
    matrix = [row.copy() for row in matrix]
    others = [i for i in range(len(matrix) - 1) if i != at]
    for n, k in enumerate(others):
        for i in [*others[n + 1:], at]:
            factor = matrix[i][k] / matrix[k][k]
            for j in [*others[n + 1:], at]:
                matrix[i][j] -= factor * matrix[k][j]
    return 1 / matrix[at][at]


def test_numbering_does_not_matter():
    mesh = rings()
    rng = np.random.default_rng(4)
    conductance = 10 ** rng.uniform(-6, 0, len(mesh.cells))
    to, of_cell = rng.permutation(len(mesh.nodes_m)), rng.permutation(len(mesh.cells))
    nodes = np.empty_like(mesh.nodes_m)
    nodes[to] = mesh.nodes_m
    other = replace(mesh, nodes_m=nodes, cells=to[mesh.cells][of_cell], under=to[mesh.under][::-1],
                    electrode=mesh.electrode[::-1])
    z, again = impedance(mesh, conductance, 1.0), impedance(other, conductance[of_cell], 1.0)
    assert np.abs(again - z).max() < 1e-13 * np.abs(z).max()
    x, moved = potentials(mesh, conductance, 1.0), potentials(other, conductance[of_cell], 1.0)
    assert np.abs(moved[:len(nodes)][to] - x[:len(nodes)]).max() < 1e-12 * np.abs(x).max()


def test_an_impedance_matrix_is_symmetric_to_the_last_bit():
    mesh = rings()
    z = impedance(mesh, np.random.default_rng(5).uniform(1e-3, 1, len(mesh.cells)), 1.0)
    assert np.array_equal(z, z.T)


def test_potentials_carry_the_currents():
    mesh = rings()
    done = eliminated(mesh, np.ones(len(mesh.cells)), 1.0)
    current = np.random.default_rng(7).normal(size=(len(mesh.nodes_m) + 16, 2))
    current -= current.mean(axis=0)
    potential = solve(done, current)
    assert np.array_equal(potential[-1], np.zeros(2))
    assert np.abs(residual(done, current, potential)).max() < 1e-12 * np.abs(current).sum(axis=0).max()


def test_one_order_serves_all_meshes_of_a_topology():
    mesh = rings()
    moved = replace(mesh, nodes_m=mesh.nodes_m * [1.0, 1.1])
    expected = impedance(moved, np.ones(len(mesh.cells)), 1.0)
    found = impedance(moved, np.ones(len(mesh.cells)), 1.0, order=dissection(mesh))
    assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()


def test_a_sheet_torn_through_is_refused():
    torn = halves()
    for method in (impedance, potentials):
        with pytest.raises(ValueError, match=r"the sheet is torn: no current flows between .* and electrode 15"):
            method(torn, np.ones(len(torn.cells)), 1.0)


def test_a_sheet_that_hangs_by_threads_is_solved_until_rounding_hides_its_parts():
    mesh = rings()
    x = mesh.nodes_m[mesh.cells][..., 0]
    cut = (x.min(axis=1) < 0.02) & (x.max(axis=1) > 0.02)
    begins = np.array([mesh.nodes_m[mesh.under[mesh.electrode == k], 0].min() for k in range(16)])
    right = np.ix_(begins > 0.025, begins > 0.025)
    threads = (1e-4, 1e-6, 1e-8)
    found = [resistances(impedance(mesh, np.where(cut, thread, 1.0), 1.0)) for thread in threads]
    for thread, between, thinner in zip(threads, found, found[1:], strict=False):
        assert np.abs(thinner[right] - between[right]).max() < 0.3 * thread * between[right].max()
    assert found[-1].max() > 1e6
    for thread in (1e-17, 1e-18, 1e-100):
        for method in (impedance, potentials):
            with pytest.raises(ValueError, match="all but torn"):
                method(mesh, np.where(cut, thread, 1.0), 1.0)


def resistances(z: np.ndarray) -> np.ndarray:
    """Between every two electrodes."""
    return np.add.outer(np.diagonal(z), np.diagonal(z)) - 2 * z


def test_an_electrode_without_contact_is_refused_and_one_with_little_is_not():
    mesh = rings()
    z = np.ones(16)
    z[5] = 1e6
    assert resistances(impedance(mesh, np.ones(len(mesh.cells)), z))[5].max() > 1e7
    z[5] = 1e15
    with pytest.raises(ValueError, match="all but without contact"):
        impedance(mesh, np.ones(len(mesh.cells)), z)


def test_a_part_that_floats_is_refused_and_named():
    mesh = rings()
    island = np.arange(9) + len(mesh.nodes_m)
    mesh = replace(mesh, nodes_m=np.vstack([mesh.nodes_m, mesh.nodes_m[mesh.cells[70]]]),
                   cells=np.vstack([mesh.cells, island]))
    with pytest.raises(ValueError, match=r"between the node at \(.*\) mm and electrode 15"):
        impedance(mesh, np.ones(len(mesh.cells)), 1.0)


def permuted(mesh: SkinMesh) -> SkinMesh:
    """The same mesh with its cells in another order."""
    return replace(mesh, cells=mesh.cells[np.random.default_rng(8).permutation(len(mesh.cells))])


def renumbered(mesh: SkinMesh) -> SkinMesh:
    """The same mesh with its electrodes counted the other way round."""
    return replace(mesh, electrode=15 - mesh.electrode)


def shifted(mesh: SkinMesh) -> SkinMesh:
    """The electrodes on the edges next to those that are theirs."""
    return replace(mesh, under=np.roll(mesh.under, 1, axis=0))


@pytest.mark.parametrize("made", [lambda _: rings(5), permuted, renumbered, shifted])
def test_the_order_of_another_mesh_is_refused(made):
    mesh = rings()
    order = dissection(made(mesh))
    for method in (impedance, potentials):
        with pytest.raises(ValueError, match=r"cells or electrodes; take the one .* this very mesh"):
            method(mesh, np.ones(len(mesh.cells)), 1.0, order=order)


def test_weights_of_another_network_are_refused():
    order = dissect(np.zeros((1, 2)), [np.array([[0, 1, 2]]), np.array([[0, 3]])], 1)
    with pytest.raises(ValueError, match="4 pairs of unknowns got 5 weights"):
        eliminate(order, np.ones(5))


def test_a_node_without_element_is_refused():
    mesh = rings()
    with pytest.raises(ValueError, match=f"node {len(mesh.nodes_m)} .* belongs to no element"):
        dissection(replace(mesh, nodes_m=np.vstack([mesh.nodes_m, np.zeros((1, 2))])))


def test_a_weight_that_is_not_finite_is_refused():
    order = dissect(np.zeros((1, 2)), [np.array([[0, 1, 2]]), np.array([[0, 3]])], 1)
    for bad in (np.nan, np.inf, -1.0):
        with pytest.raises(Detached, match="unknown"):
            eliminate(order, np.array([1.0, 1.0, 1.0, bad]))


def test_potentials_of_some_unknowns_are_those_of_all():
    mesh, rng = rings(), np.random.default_rng(4)
    done = eliminated(mesh, np.ones(len(mesh.cells)), 1.0)
    size = len(mesh.nodes_m) + mesh.count
    for _ in range(4):
        into, asked = rng.choice(size, 5, replace=False), np.append(rng.choice(size, 9, replace=False), size - 1)
        currents = np.zeros((size, 3))
        currents[into] = rng.normal(size=(5, 3))
        np.testing.assert_array_equal(solve_between(done, into, currents[into], asked), solve(done, currents)[asked])


PLAIN = """
import json, numpy as np
from eitsim.electrics.cem.assembly import impedance, potentials
from eitsim.numerics.conductor_elimination import _eliminate
from eitsim.scene.scene import Body, Electrodes
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
mesh = ring_mesh(np.linspace(0, 0.1, 4), np.zeros((4, 2)), *rim_angles(Body(), Electrodes(count=5), 1), 5)
conductance = np.linspace(1, 2, len(mesh.cells))
print(json.dumps({"compiled": hasattr(_eliminate, "py_func"), "z": impedance(mesh, conductance, 1.0).tolist(),
                  "x": potentials(mesh, conductance, 1.0).tolist()}))
"""


@pytest.mark.thorough
def test_compiled_and_plain_elimination_agree():
    runs = [subprocess.run([sys.executable, "-c", PLAIN], capture_output=True, text=True, check=True,
                           env={**os.environ, "NUMBA_DISABLE_JIT": off}) for off in ("0", "1")]
    fast, plain = (json.loads(run.stdout) for run in runs)
    assert fast["compiled"]
    assert not plain["compiled"]
    for key in ("z", "x"):
        assert np.abs(np.subtract(fast[key], plain[key])).max() < 1e-13 * np.abs(plain[key]).max()
