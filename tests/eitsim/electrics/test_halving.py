"""Halved triangles, and meshes that are alike where scenes are."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from skfem import ElementTriP2
from skfem.quadrature import get_quadrature

from eitsim.electrics.cem.assembly import SkinMesh, gradients, impedance
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.mesh.graded_mesh import LEAN, triangulation
from eitsim.electrics.mesh.p2_triangles import uniform_refinement, untangled, with_quarter_points
from eitsim.electrics.mesh.ring_mesh import template
from eitsim.electrics.mesh.symmetric_mesh import alike_mesh
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch
from touchcal.errors import NotConverged


def contact(radius_m: float) -> Touch:
    """A touch of which only the radius of contact is used."""
    rest = np.ones(2)
    return Touch(np.array([0.0, 0.1]), 0 * rest, 0 * rest, rest, rest, rest, 0 * rest, radius_m, *[0.0] * 9, 0, (), 0.0)


TOUCH = contact(7e-3)
LINES, PATCHES = Electrodes(count=8), Electrodes(kind="patch", count=8)


def area_m2(mesh: SkinMesh) -> np.ndarray:
    return gradients(mesh, np.zeros((len(mesh.nodes_m), 1)))[1].sum(axis=1)


@pytest.mark.parametrize("electrodes", [LINES, PATCHES])
def test_halving_keeps_the_cells_and_what_lies_under_each_electrode(electrodes: Electrodes):
    mesh = triangulation(Body(), electrodes, ((Punch(0.03, 0.02), TOUCH),), grading=LEAN)
    fine = uniform_refinement(mesh)
    assert len(fine.cells) == 4 * len(mesh.cells)
    assert area_m2(fine).min() > 0
    np.testing.assert_allclose(area_m2(fine).reshape(-1, 4).sum(axis=1), area_m2(mesh), rtol=1e-12)
    assert np.array_equal(np.unique(fine.cells), np.arange(len(fine.nodes_m)))
    assert np.array_equal(np.bincount(fine.electrode) // np.bincount(mesh.electrode), [len(fine.under) // len(
        mesh.under)] * 8)
    if electrodes is PATCHES:
        under = [area_m2(replace(m, cells=m.under[m.electrode == 3])).sum() for m in (mesh, fine)]
        assert under[1] == pytest.approx(under[0], rel=1e-12)


def test_halved_meshes_hold_the_potentials_of_the_coarser_ones():
    """So the power that currents need grows from each to the next, for any currents, and towards a limit."""
    mesh = with_quarter_points(triangulation(Body(), LINES, ((Punch(0.03, 0.02), TOUCH),), grading=LEAN))
    meshes = [mesh, uniform_refinement(mesh), uniform_refinement(uniform_refinement(mesh))]
    z = [impedance(m, np.full(len(m.cells), 6e-4), 1.0) for m in meshes]
    steps = [np.sort(np.linalg.eigvalsh(fine - coarse)) for coarse, fine in itertools.pairwise(z)]
    assert all(step[0] > -1e-10 * np.abs(z[0]).max() for step in steps)
    assert steps[1][-1] < steps[0][-1] / 3


def test_quarter_points_gain_digits_of_the_untouched_impedance():
    exact = solve_rim(Body(), LINES, 6e-4).impedance_Ohm
    plain = triangulation(Body(), LINES, ((Punch(0.03, 0.02), TOUCH),), grading=LEAN)
    errors = [np.linalg.norm(impedance(m, np.full(len(m.cells), 6e-4), 1.0) - exact) / np.linalg.norm(exact)
              for m in (uniform_refinement(plain), uniform_refinement(with_quarter_points(plain)))]
    print(f"plain {errors[0]:.1e}, with quarter points {errors[1]:.1e}")
    assert errors[1] < errors[0] / 3


def test_only_quadratic_triangles_are_halved():
    with pytest.raises(ValueError, match="Q2"):
        uniform_refinement(template(Body(), LINES, Punch(), TOUCH))


def test_scenes_that_are_alike_get_meshes_that_are():
    def places(x_m: float, y_m: float) -> np.ndarray:
        mesh = alike_mesh(Body(), LINES, ((Punch(x_m, y_m), TOUCH),))
        return mesh.nodes_m @ np.array([1, 1j])

    angle, turn = 0.2, 2 * math.pi / 8 * 3
    one, other, mirrored = (places(0.05 * math.cos(a), 0.05 * math.sin(a)) for a in (angle, angle + turn, -angle))
    np.testing.assert_allclose(other, one * np.exp(1j * turn), atol=1e-14)
    np.testing.assert_allclose(mirrored, one.conj(), atol=1e-14)


def least_turn(mesh: SkinMesh) -> float:
    """Least Jacobian of the elements at the points of their stiffness, over the area of the element."""
    points = get_quadrature(ElementTriP2(), 4)[0]
    slopes = [np.broadcast_to(ElementTriP2().lbasis(points, i)[1], points.shape) for i in range(6)]
    jacobian = np.linalg.det(np.einsum("eka,kbq->eqab", mesh.nodes_m[mesh.cells], slopes))
    return float((jacobian * np.sign(jacobian.sum(axis=1))[:, None] / area_m2(mesh)[:, None]).min())


@pytest.mark.parametrize("electrodes", [Electrodes(), Electrodes(width_m=0.2 * np.pi / 16), Electrodes(
    count=8, width_m=(0.001, 0.002, 0.03, 0.01, 0.01, 0.02, 0.01, 0.01))])
def test_no_element_folds_over_however_close_the_contact_comes_to_the_rim(electrodes: Electrodes):
    """Edges on the circle about a punch bulge more than what lies between them and the rim is wide."""
    rng = np.random.default_rng(6)
    for gap in np.geomspace(5e-5, 2e-3, 10):
        diameter, angle = rng.uniform(0.006, 0.024), rng.uniform(0, 2 * np.pi)
        away = Body().radius_m - diameter / 2 - gap
        punch = Punch(away * math.cos(angle), away * math.sin(angle), diameter)
        radius = diameter / 2 + rng.uniform(0.5, 1.3) * gap
        mesh = alike_mesh(Body(), electrodes, ((punch, contact(radius)),))
        for part in (mesh, uniform_refinement(mesh), uniform_refinement(uniform_refinement(mesh))):
            assert least_turn(part) > 0, (gap, diameter, radius)


def test_only_the_triangles_that_fold_over_get_plain_nodes():
    mesh = triangulation(Body(), LINES, ((Punch(0.03, 0.02), TOUCH),), grading=LEAN)
    nodes = mesh.nodes_m.copy()
    cell = mesh.cells[50]
    nodes[cell[3]] = nodes[cell[2]]
    repaired = untangled(replace(mesh, nodes_m=nodes), mesh.nodes_m)
    assert np.array_equal(repaired.nodes_m, mesh.nodes_m)
    with pytest.raises(NotConverged, match="move the punch"):
        untangled(replace(mesh, nodes_m=nodes), nodes)


def test_ends_that_two_electrodes_share_get_quarter_points():
    touching = Electrodes(count=8, width_m=0.2 * np.pi / 8)
    plain = triangulation(Body(), touching, ((Punch(0.03, 0.02), TOUCH),), grading=LEAN)
    moved = np.flatnonzero(np.any(with_quarter_points(plain).nodes_m != plain.nodes_m, axis=1))
    owner = plain.electrode[np.isin(plain.under[:, 2], moved)]
    assert np.bincount(owner).tolist() == [2] * 8
