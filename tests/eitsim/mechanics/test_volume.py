"""Fields in the volume near the rim: read back from the VTU, they are whole, balance, and agree with the section's."""

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.hold import relaxed
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.rim.half_disc_fields import _with_corners, volume_fields
from eitsim.mechanics.rim.solve_near_rim import FINE, Resolution, on_two_meshes
from eitsim.scene.edges.outline import Outline
from eitsim.scene.polygons import corners_and_edges
from eitsim.scene.results import Section, Volume
from eitsim.scene.scene import Body, Punch
from eitsim.simulation.foam_fields import section_fields, write_vtu
from eitsim.simulation.near_edges import with_signal_errors
from matcal.laws.hyperfoam import Hyperfoam

LAW = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.array([0.0, 0.1, 0.0]))
BODY = Body()
FORCE_N, BEARING = 0.1, np.arctan2(0.0546, -0.0728)
# Parts of cells: tetrahedra, and triangles of the top with normals upwards.
TETRAHEDRA = {"hexahedron": [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)],
              "wedge": [(0, 2, 1, 3), (1, 2, 5, 3), (1, 5, 4, 3)]}
TOP = {"hexahedron": [(4, 5, 6), (4, 6, 7)], "wedge": [(3, 5, 4)]}


def near_rim(punch):
    touch = solve_touch(LAW, BODY, punch, element_m=0.24e-3)
    return with_signal_errors(on_two_meshes(touch, LAW, BODY, punch, coarse=Resolution(12.0, 4, 9), fine=FINE))


@pytest.fixture(scope="module")
def touch():
    return near_rim(Punch(x_m=-0.0728, y_m=0.0546, force_N=FORCE_N))


@pytest.fixture(scope="module")
def read(touch, tmp_path_factory):
    path = Path(tmp_path_factory.mktemp("volume")) / "fields.vtu"
    write_vtu(touch, path)
    return meshio.read(path)


@pytest.fixture(scope="module")
def centred():
    return near_rim(Punch(force_N=FORCE_N))


def tensor(fields, name):
    return fields[name].reshape(-1, 3, 3)


def volumes(points, blocks):
    for block in blocks:
        for corners in TETRAHEDRA[block.type]:
            a, b, c, d = np.moveaxis(points[block.data[:, corners]], 1, 0)
            yield np.einsum("ni,ni->n", np.cross(b - a, c - a), d - a) / 6


def homogeneous(gradient):
    """A disc 40 mm from the axis with u = (gradient - 1) (x, y, z + H), axes towards the rim, across and up."""
    radius, height = np.linspace(0, 0.2, 9), np.linspace(-0.01, 0.0, 5)
    amplitude = np.zeros((9, 5, 3, 4))
    first, second, third = np.diag(gradient) - 1
    mean, half = (first + second) / 2, (first - second) / 2 / np.sqrt(2)
    amplitude[:, :, 0, 0] = mean * radius[:, None]
    amplitude[:, :, 0, 2], amplitude[:, :, 1, 2] = half * radius[:, None], -half * radius[:, None]
    amplitude[:, :, 2, 0] = third * (height + 0.01)
    return Volume(radius, height, 2, amplitude, np.array([0.0, 0.01]), np.linspace(0, 1, 3), np.zeros((2, 3)), 0.1,
                  0.04, 0.05, BEARING, LAW, 0.04 * np.array([np.cos(BEARING), np.sin(BEARING)]))


@pytest.mark.thorough
def test_cells_fill_the_half_disc_and_stay_upright(read):
    assert {block.type for block in read.cells} == {"hexahedron", "wedge"}
    assert np.array_equal(np.sort(np.concatenate([b.data.ravel() for b in read.cells])), np.arange(len(read.points)))
    for points in (read.points, read.points + read.point_data["displacement_m"]):
        assert min(volume.min() for volume in volumes(points, read.cells)) > 0
    total = sum(volume.sum() for volume in volumes(read.points, read.cells))
    assert total == pytest.approx(np.pi * 0.1**2 * 0.01 / 2, rel=5e-3)
    radius = np.hypot(*read.points[:, :2].T)
    assert radius.max() == pytest.approx(0.1, abs=1e-12)
    left = np.array([-np.sin(BEARING), np.cos(BEARING)])
    assert (read.points[:, :2] @ left).min() > -1e-12
    rim = read.points[np.abs(radius - 0.1) < 1e-9]
    angle = np.unique(np.round((np.arctan2(rim[:, 1], rim[:, 0]) - BEARING) % (2 * np.pi), 6))
    assert angle.min() == 0
    assert angle.max() == pytest.approx(np.pi, abs=1e-6)


def test_fields_agree_with_one_another(read):
    fields = read.point_data
    gradient, volume = tensor(fields, "deformation_gradient"), fields["volume_ratio"]
    assert np.allclose(np.linalg.det(gradient), volume)
    assert volume.min() > 0
    right = np.swapaxes(gradient, 1, 2) @ gradient
    assert np.allclose(tensor(fields, "green_lagrange_strain"), (right - np.eye(3)) / 2)
    left = tensor(fields, "nominal_strain") + np.eye(3)
    assert np.allclose(left @ left, gradient @ np.swapaxes(gradient, 1, 2))
    assert np.allclose(fields["cauchy_stress_Pa"] * volume[:, None], fields["kirchhoff_stress_Pa"])
    assert set(np.unique(fields["elliptic"])) <= {0.0, 1.0}
    assert not fields["taken_from_centre"].any()
    assert not np.any([~np.isfinite(field).any() for field in fields.values()])


def test_differences_along_the_cells_are_the_gradient(read):
    """Edges of small cells under the punch against the mean gradient of their ends: exact for quadratic elements."""
    (data,) = [block.data for block in read.cells if block.type == "hexahedron"]
    moved, gradient = read.points + read.point_data["displacement_m"], tensor(read.point_data, "deformation_gradient")
    for first, second in ((0, 1), (0, 4), (3, 2)):
        along = read.points[data[:, second]] - read.points[data[:, first]]
        separation = moved[data[:, second]] - moved[data[:, first]]
        mean = (gradient[data[:, first]] + gradient[data[:, second]]) / 2
        under = np.linalg.norm(read.points[data[:, 0], :2] - [-0.0728, 0.0546], axis=1) < 0.0065
        error = np.linalg.norm((mean @ along[..., None])[..., 0] - separation, axis=1) / np.linalg.norm(along, axis=1)
        assert error[under].max() < 1e-9


def test_contact_pressure_integrates_to_the_force(read):
    moved, pressure, top = read.points + read.point_data["displacement_m"], read.point_data, read.points[:, 2] == 0
    assert not pressure["contact_pressure_Pa"][~top].any()
    total = 0.0
    for block in read.cells:
        for corners in TOP[block.type]:
            face = block.data[:, corners]
            face = face[top[face].all(axis=1)]
            a, b, c = np.moveaxis(moved[face], 1, 0)
            total += np.sum(pressure["contact_pressure_Pa"][face].mean(axis=1) * np.cross(b - a, c - a)[:, 2])
    print("force of the pressure over the given", total / FORCE_N)
    assert total == pytest.approx(FORCE_N, rel=0.04)


def test_the_traction_on_the_bottom_is_the_reaction(read):
    nominal = tensor(read.point_data, "kirchhoff_stress_Pa") @ np.linalg.inv(
        np.swapaxes(tensor(read.point_data, "deformation_gradient"), 1, 2))
    total = 0.0
    for block in read.cells:
        for corners in TOP[block.type]:
            face = block.data[:, [corner - (3 if block.type == "wedge" else 4) for corner in corners]]
            face = face[np.abs(read.points[face, 2] + 0.01).max(axis=1) < 1e-12]
            a, b, c = np.moveaxis(read.points[face], 1, 0)
            total -= np.sum(nominal[face, 2, 2].mean(axis=1) * np.cross(b - a, c - a)[:, 2])
    print("reaction over force", total / FORCE_N)
    assert total == pytest.approx(FORCE_N, rel=0.03)


def test_the_rim_is_nearly_free_of_traction(read):
    """It is so in the weak sense only, and worst at its upper edge."""
    rim = np.abs(np.hypot(*read.points[:, :2].T) - 0.1) < 1e-9
    outwards = read.points[rim] * [10, 10, 0]
    stress = tensor(read.point_data, "kirchhoff_stress_Pa")[rim]
    inverse = np.linalg.inv(tensor(read.point_data, "deformation_gradient")[rim])
    traction = np.linalg.norm((stress @ np.swapaxes(inverse, 1, 2) @ outwards[..., None])[..., 0], axis=1)
    largest, mean = np.abs(read.point_data["cauchy_stress_Pa"]).max(), np.sqrt(np.mean(traction**2))
    at_rim = np.sqrt(9 * np.mean(stress**2))
    print("traction of the rim over the largest stress", traction.max() / largest, "in the mean over the stress there",
          mean / at_rim)
    assert traction.max() < 0.1 * largest
    assert mean < 0.01 * largest
    assert mean < 0.3 * at_rim


def test_the_surface_stands_as_deep_as_the_punch(read, touch):
    moved = read.point_data["displacement_m"]
    assert moved[:, 2].min() == pytest.approx(-touch.depth_m, rel=0.02)
    assert not moved[np.abs(read.points[:, 2] + 0.01) < 1e-12].any()


def test_at_the_centre_the_fields_are_the_section_s(centred):
    """On one mesh: middles of elements on two rays, where four cells meet that belong to one element."""
    kept = centred.volume
    moved = kept.amplitude_m[..., 0]
    place = np.array([(r, z) for r in kept.radius_m for z in kept.height_m])
    rows, order = len(kept.height_m), np.array([(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)])
    first = [(i, j) for i in range(0, len(kept.radius_m) - 1, 2) for j in range(0, rows - 1, 2)]
    elements = np.array([[(i + a) * rows + j + b for a, b in order] for i, j in first])
    section = Section(place, elements, moved[..., [0, 2]].reshape(-1, 2), LAW)
    at, expected = section_fields(replace(centred, rim=None, section=section))
    points, _, found = volume_fields(centred)
    radius = np.hypot(points[:, 0], points[:, 1])
    compared = 0
    for middle in range(8, len(at), 9):
        r, z, _ = at[middle]
        if r > kept.punch_m:
            continue
        here = np.flatnonzero((np.abs(radius - r) < 1e-12) & (np.abs(points[:, 2] - z) < 1e-12))
        for ray in ([1, 0], [0, 1]):
            on = here[np.linalg.norm(points[here, :2] - r * np.array(ray), axis=1) < 1e-12]
            assert on.size > 0
            turn = np.array([[ray[0], -ray[1], 0], [ray[1], ray[0], 0], [0, 0, 1]])
            for name in ("cauchy_stress_Pa", "nominal_strain", "deformation_gradient"):
                one = expected[name][middle].reshape(3, 3)[np.ix_([0, 2, 1], [0, 2, 1])]
                largest = np.abs(expected[name]).max()
                assert np.allclose(tensor(found, name)[on], turn @ one @ turn.T, atol=1e-5 * largest)
            ahead = turn @ expected["displacement_m"][middle][[0, 2, 1]]
            assert np.allclose(found["displacement_m"][on], ahead, atol=1e-5 * centred.depth_m)
            compared += len(on)
    assert compared > 50


def test_a_homogeneous_field_is_exact(touch):
    gradient = np.diag([1.1, 0.9, 0.7])
    points, _, fields = volume_fields(replace(touch, volume=homogeneous(gradient)))
    turn = np.array([[np.cos(BEARING), -np.sin(BEARING), 0], [np.sin(BEARING), np.cos(BEARING), 0], [0, 0, 1]])
    turned = turn @ gradient @ turn.T
    assert np.allclose(tensor(fields, "deformation_gradient"), turned, atol=1e-9)
    from_axis = points - [0.04 * np.cos(BEARING), 0.04 * np.sin(BEARING), -0.01]
    assert np.allclose(fields["displacement_m"], from_axis @ (turned - np.eye(3)), atol=1e-12)


SQUARE = Body(Outline("rectangle", width_m=0.2, height_m=0.2), 0.01)


def outlined(gradient, body, axis_m, *, whole_turn):
    """A homogeneous field in an outline, by the harmonics of half a turn or of a whole one."""
    kept = homogeneous(gradient)
    amplitude = np.zeros((9, 5, 3, 8)) if whole_turn else kept.amplitude_m
    if whole_turn:
        amplitude[..., ::2] = kept.amplitude_m
    edges = np.stack(corners_and_edges(body.outline), axis=1) - axis_m
    return replace(kept, amplitude_m=amplitude, axis_m=np.array(axis_m), edges_m=edges, whole_turn=whole_turn,
                   punch_m=0.005)


@pytest.mark.parametrize("whole_turn", [False, True])
def test_cells_fill_an_outline_and_a_homogeneous_field_is_exact(touch, whole_turn):
    gradient, axis = np.diag([1.1, 0.9, 0.7]), np.array([0.08, 0.06])
    points, blocks, fields = volume_fields(replace(touch, volume=outlined(
        gradient, SQUARE, axis, whole_turn=whole_turn)))
    cells = [meshio.CellBlock(name, numbers) for name, numbers in blocks]
    found = np.concatenate(list(volumes(points, cells)))
    assert found.min() > 0
    assert found.sum() == pytest.approx(0.2 * 0.2 * 0.01, rel=1e-4)  # what lies next to the corners is cut off
    assert np.abs(points[:, :2]).max() == pytest.approx(0.1, abs=1e-12)
    turn = np.array([[np.cos(BEARING), -np.sin(BEARING), 0], [np.sin(BEARING), np.cos(BEARING), 0], [0, 0, 1]])
    near = np.linalg.norm(points[:, :2] - axis, axis=1) < 0.19  # outside the mesh the foam rests
    turned = turn @ gradient @ turn.T
    assert np.allclose(tensor(fields, "deformation_gradient")[near], turned, atol=1e-9)
    from_axis = points - [*axis, -0.01]
    assert np.allclose(fields["displacement_m"][near], (from_axis @ (turned - np.eye(3)))[near], atol=1e-12)


def test_what_a_hole_hides_has_no_cells(touch):
    """Seen from a punch at x = -50 mm, a square hole at the origin hides a wedge up to the edge at 100 mm."""
    corners = ((-0.01, -0.01), (0.01, -0.01), (0.01, 0.01), (-0.01, 0.01))
    body = replace(SQUARE, edge=replace(SQUARE.outline, holes_m=(corners,)))
    points, blocks, _ = volume_fields(replace(touch, volume=outlined(np.eye(3), body, (-0.05, 0.0), whole_turn=True)))
    cells = [meshio.CellBlock(name, numbers) for name, numbers in blocks]
    found = np.concatenate(list(volumes(points, cells)))
    assert found.min() > 0
    hidden = (0.15 * 0.0375 - 0.04 * 0.01)  # between the rays past the near corners, from the hole's near side on
    assert found.sum() == pytest.approx((0.2 * 0.2 - hidden) * 0.01, rel=1e-3)


def test_a_solution_turned_inside_out_is_refused(touch):
    with pytest.raises(ValueError, match="inside out"):
        volume_fields(replace(touch, volume=homogeneous(np.diag([1.0, 1.0, -0.5]))))


@pytest.mark.thorough
def test_relaxed_stresses_are_those_of_the_softened_foam(touch):
    fields, held = (volume_fields(t)[2] for t in (touch, relaxed(touch, 0.4)))
    for name in ("cauchy_stress_Pa", "contact_pressure_Pa"):
        assert np.allclose(held[name], 0.4 * fields[name])
    assert np.array_equal(held["nominal_strain"], fields["nominal_strain"])


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_half_planes_lie_on_either_side_of_corners_that_are_seen(turn: float) -> None:
    """Of an L, seen from the end of an arm, four; two lie behind the inner corner, and points on a side are none."""
    corners = np.array([(0, 0), (3, 0), (6, 0), (6, 2), (2, 2), (2, 6), (0, 6), (0, 3)], float) - [5.5, 1.0]
    corners = corners @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    edges = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    angle = np.linspace(-np.pi, np.pi, 9)
    found = _with_corners(edges, 0.3, angle)
    seen = np.arctan2(*corners[[0, 2, 3, 4]].T[::-1]) - 0.3
    more = (np.concatenate([seen - 1e-4, seen + 1e-4]) + np.pi) % (2 * np.pi) - np.pi
    assert found == pytest.approx(np.sort(np.concatenate([angle, more])), abs=1e-12)
