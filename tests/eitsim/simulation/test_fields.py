"""Fields inside the foam: read back from the VTU, they balance the force and agree with one another."""

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.results import RimField, Section
from eitsim.scene.scene import Body, Punch
from eitsim.simulation.foam_fields import section_fields, write_vtu
from matcal.laws.hyperfoam import Hyperfoam

FORCE_N = 0.5
LAW = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.1, 0.0])


@pytest.fixture(scope="module")
def solved():
    return solve_touch(LAW, Body(), Punch(force_N=FORCE_N), element_m=0.06e-3)


@pytest.fixture(scope="module")
def read(solved, tmp_path_factory):
    path = Path(tmp_path_factory.mktemp("fields")) / "fields.vtu"
    write_vtu(solved, path)
    return meshio.read(path)


def tensor(mesh, name):
    return mesh.point_data[name].reshape(-1, 3, 3)


def test_cells_are_biquadratic_with_nodes_in_vtk_order(read):
    (block,) = read.cells
    assert block.type == "quad9"
    at = read.points[block.data]
    assert np.array_equal(block.data.ravel(), np.arange(len(read.points)))
    for middle, (first, second) in zip(range(4, 8), [(0, 1), (1, 2), (2, 3), (3, 0)], strict=True):
        assert np.allclose(at[:, middle], (at[:, first] + at[:, second]) / 2)
    assert np.allclose(at[:, 8], at[:, :4].mean(axis=1))
    side, other = at[:, 1] - at[:, 0], at[:, 3] - at[:, 0]
    assert np.all(side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0] > 0)
    assert np.sum(side[:, 0] * other[:, 1]) == pytest.approx(0.1 * 0.01)


def test_fields_agree_with_one_another(read):
    gradient, volume = tensor(read, "deformation_gradient"), read.point_data["volume_ratio"]
    assert np.allclose(np.linalg.det(gradient), volume)
    assert np.all(volume > 0)
    right = np.swapaxes(gradient, 1, 2) @ gradient
    assert np.allclose(tensor(read, "green_lagrange_strain"), (right - np.eye(3)) / 2)
    left = tensor(read, "nominal_strain") + np.eye(3)
    assert np.allclose(left @ left, gradient @ np.swapaxes(gradient, 1, 2))
    cauchy, kirchhoff_stress = tensor(read, "cauchy_stress_Pa"), tensor(read, "kirchhoff_stress_Pa")
    assert np.allclose(cauchy * volume[:, None, None], kirchhoff_stress)
    scale = np.abs(cauchy).max()
    for field in (cauchy, kirchhoff_stress, left):
        assert np.allclose(field, np.swapaxes(field, 1, 2), atol=1e-12 * scale)
        assert not field[:, :2, 2].any()
    stretch = np.sqrt(np.linalg.eigvalsh(right))
    principal = np.sort(LAW.kirchhoff(np.log(stretch)), axis=-1)
    assert np.allclose(principal, np.linalg.eigvalsh(kirchhoff_stress), atol=1e-9 * scale)


def test_displacement_and_pressure_are_the_surface_s(read, solved):
    at, moved = read.points, read.point_data["displacement_m"]
    top = at[:, 1] == 0
    for axis, surface in ((0, solved.u_r_m), (1, solved.u_z_m)):
        there = np.interp(at[top, 0], solved.radius_m, surface)
        assert np.allclose(moved[top, axis], there, atol=0.01 * solved.depth_m)
    assert not moved[at[:, 1] == at[:, 1].min()].any()
    assert not moved[at[:, 0] == 0, 0].any()
    pressure = read.point_data["contact_pressure_Pa"]
    assert pressure.max() == pytest.approx(solved.sigma_max_Pa, rel=0.05)
    assert not pressure[~top].any()


@pytest.mark.parametrize(("height_m", "error"), [(-0.01, 2e-3), (-0.005, 3e-3), (0.0, 0.01)])
def test_the_traction_on_a_level_is_the_reaction(read, height_m, error):
    """Simpson's rule for 2 pi r P_zz, P = tau F^-T, on the edges of elements nearest to a level of the reference."""
    at, nominal = read.points.reshape(-1, 9, 3), tensor(read, "kirchhoff_stress_Pa") @ np.linalg.inv(
        np.swapaxes(tensor(read, "deformation_gradient"), 1, 2))
    push = (2 * np.pi * read.points[:, 0] * nominal[:, 1, 1]).reshape(-1, 9)
    lower, upper = at[:, 0, 1], at[:, 3, 1]
    level = upper[np.argmin(np.abs(upper - height_m))] if height_m > at[..., 1].min() else lower.min()
    edge = (3, 6, 2) if height_m > at[..., 1].min() else (0, 4, 1)
    on = np.isclose(at[:, edge[0], 1], level)
    width = at[on, 1, 0] - at[on, 0, 0]
    total = np.sum(width / 6 * (push[on][:, edge] @ np.array([1, 4, 1])))
    print("reaction over force", -total / FORCE_N)
    assert -total == pytest.approx(FORCE_N, rel=error)


def test_a_homogeneous_field_is_exact():
    """u = ((a - 1) r, (b - 1) z + c): F = diag(a, b, a) everywhere, axis included."""
    place = np.array([(r, z) for r in (0.0, 0.5, 1.0) for z in (-1.0, -0.5, 0.0)])
    elements = np.array([[0, 6, 8, 2, 3, 7, 5, 1, 4]])
    moved = place * [0.2, -0.3] + [0.0, 0.1]
    touch = replace(solve_touch(LAW, Body(), Punch(force_N=0.01), element_m=0.24e-3),
                    section=Section(place, elements, moved, LAW))
    _, fields = section_fields(touch)
    assert np.allclose(fields["nominal_strain"].reshape(-1, 3, 3), np.diag([0.2, -0.3, 0.2]))
    assert np.allclose(fields["volume_ratio"], 1.2 * 0.7 * 1.2)
    assert not fields["taken_from_centre"].any()


def test_bilinear_elements_are_written_as_such(tmp_path):
    touch = solve_touch(LAW, Body(), Punch(force_N=FORCE_N), element_m=0.12e-3, order=1)
    write_vtu(touch, tmp_path / "fields.vtu")
    read = meshio.read(tmp_path / "fields.vtu")
    assert read.cells[0].type == "quad"
    at = read.points.reshape(-1, 4, 3)
    assert np.sum((at[:, 1, 0] - at[:, 0, 0]) * (at[:, 3, 1] - at[:, 0, 1])) == pytest.approx(0.1 * 0.01)
    assert read.point_data["displacement_m"][:, 1].min() == pytest.approx(-touch.depth_m, rel=0.02)


def test_a_touch_with_a_rim_and_no_volume_is_refused(solved, tmp_path):
    rim = RimField(np.zeros(1), np.zeros(2), np.zeros((1, 2, 3)), np.ones((1, 2, 3)), np.ones((1, 2)), 0.1, 0.09)
    with pytest.raises(ValueError, match="no fields with the rim's effect"):
        write_vtu(replace(solved, rim=rim), tmp_path / "fields.vtu")


def test_ellipticity_is_told_where_it_is_lost():
    touch = solve_touch(replace(LAW, nu=np.zeros(3)), Body(), Punch(force_N=FORCE_N), element_m=0.24e-3)
    _, fields = section_fields(touch)
    assert np.all(fields["elliptic"] == 1)
    crushed = touch.section.displacement_m - 0.45 * touch.section.nodes_m * [1, 0]
    _, fields = section_fields(replace(touch, section=replace(touch.section, displacement_m=crushed)))
    assert np.any(fields["elliptic"] == 0)


def test_a_touch_without_a_section_is_refused(solved, tmp_path):
    with pytest.raises(ValueError, match="no fields"):
        write_vtu(replace(solved, section=None), tmp_path / "fields.vtu")
