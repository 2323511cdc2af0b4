"""Meshes whose lines follow the end of contact where the rim leaves no room for a circle."""

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import SkinMesh, quadrature_points
from eitsim.electrics.mesh.graded_mesh import LEAN, triangulation
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.mesh.symmetric_mesh import with_contact_lines
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch

LINES, PATCHES = Electrodes(), Electrodes(kind="patch")
# axis 10.2 mm inside the rim, edge 0.2 mm; the end of contact is 0.1 mm beyond the rim there
PUNCH, REACH_M = Punch(0.0898, 0.0, 0.02), 10.3e-3


def contact(radius_m: float) -> Touch:
    """A touch of which only the radius of contact is used."""
    rest = np.ones(2)
    return Touch(np.array([0.0, 0.1]), 0 * rest, 0 * rest, rest, rest, rest, 0 * rest, radius_m, *[0.0] * 9, 0, (), 0.0)


def meshes(touches: tuple[tuple[Punch, Touch], ...], electrodes: Electrodes = LINES) -> tuple[SkinMesh, SkinMesh]:
    mesh = triangulation(Body(), electrodes, touches, grading=LEAN)
    return mesh, with_contact_lines(mesh, Body(), electrodes, touches)


def across(mesh: SkinMesh) -> int:
    """Cells more than 0.7 rad off the way to the rim with quadrature points on both sides of the end of contact."""
    offset = (quadrature_points(mesh) - [PUNCH.x_m, PUNCH.y_m]) @ np.array([1, 1j])
    off = np.abs(np.angle(offset)).min(axis=1) > 0.7
    inside = np.abs(offset) < REACH_M
    return int(np.sum(off & inside.any(axis=1) & ~inside.all(axis=1)))


def test_no_element_lies_across_the_end_of_contact_but_near_the_cut():
    plain, line = meshes(((PUNCH, contact(REACH_M)),))
    assert across(plain) > 10
    assert across(line) == across(uniform_refinement(line)) == 0


def test_rim_punch_and_what_is_far_stay():
    plain, line = meshes(((PUNCH, contact(REACH_M)),))
    away = np.abs(plain.nodes_m @ np.array([1, 1j]) - PUNCH.x_m)
    moved = np.linalg.norm(line.nodes_m - plain.nodes_m, axis=1)
    corners = np.unique(plain.cells[:, :3])
    on_rim = corners[np.abs(np.linalg.norm(plain.nodes_m[corners], axis=1) - 0.1) < 1e-12]
    assert moved[on_rim].max() < 1e-15
    assert moved[(away <= PUNCH.diameter_m / 2) | (away > 1.5 * REACH_M)].max() == 0
    assert moved.max() == pytest.approx(REACH_M - 10.18e-3, rel=0.1)


def test_a_contact_with_room_changes_nothing():
    plain, line = meshes(((PUNCH, contact(10.1e-3)),))
    assert line is plain


def test_a_neighbours_circles_stay():
    other = Punch(0.0898 - 23e-3, 0.0, 0.02)
    plain, line = meshes(((PUNCH, contact(REACH_M)), (other, contact(10.2e-3))))
    near = np.abs(plain.nodes_m @ np.array([1, 1j]) - other.x_m) <= 10.2e-3
    np.testing.assert_array_equal(line.nodes_m[near], plain.nodes_m[near])
    assert not np.array_equal(line.nodes_m, plain.nodes_m)


def test_beside_patches_the_ring_that_they_lie_on_stays():
    inner = Body().radius_m - PATCHES.length_m
    punch = Punch(inner - 11e-3, 0.0, 0.02)
    plain, line = meshes(((punch, contact(10.95e-3)),), PATCHES)
    under = np.linalg.norm(plain.nodes_m, axis=1) >= inner
    np.testing.assert_allclose(line.nodes_m[under], plain.nodes_m[under], atol=1e-15)
    assert not np.array_equal(line.nodes_m, plain.nodes_m)
