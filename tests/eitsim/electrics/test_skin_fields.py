"""Fields on the skin: read back from the VTU, the current through a cut is the one driven."""

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from skfem import ElementQuad2, ElementTriP2

from eitsim.electrics.forward.sheet_fields import skin_fields, surface_displacement, write_skin_vtu
from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.drive import Drive, protocol
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import moved, untouched_conductance
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
LAW = Conductivity(30.0, [-2, 2, -1], (0.0, 0.4))
PUNCH = Punch(0.02, -0.01, force_N=0.5)
ELEMENTS = {"quad9": ElementQuad2(), "triangle6": ElementTriP2()}


@pytest.fixture(scope="module")
def touch() -> Touch:
    return solve_touch(FOAM, Body(), PUNCH, element_m=0.12e-3)


@pytest.fixture(scope="module", params=[("normal", 1), ("normal", 2), ("principal", 1), ("principal", 2)],
                ids=lambda param: f"{param[0]}, touches: {param[1]}")
def scene(request) -> Scene:
    strain, count = request.param
    both = PUNCH, replace(PUNCH, x_m=-0.04, y_m=0.02)
    return Scene(punches=both[:count], skin=Skin(strain=strain), drive=Drive(pattern="skip-2"))


@pytest.fixture(scope="module")
def read(scene, touch, tmp_path_factory):
    path = Path(tmp_path_factory.mktemp("skin")) / "skin.vtu"
    write_skin_vtu(scene, [touch] * len(scene.punches), LAW, path, patterns=[0, 5])
    return meshio.read(path)


def at_gauss_points(mesh: meshio.Mesh, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places (n, 2), areas (n,) and values (n, ...) of a field at Gauss points of all cells, shapes as VTK has them."""
    (block,) = mesh.cells
    element = ELEMENTS[block.type]
    t, w = np.polynomial.legendre.leggauss(4)
    s, t = (a.ravel() for a in np.meshgrid((t + 1) / 2, (t + 1) / 2))
    w = np.outer(w, w).ravel() / 4
    at, weight = (np.array([s, t]), w) if block.type == "quad9" else (np.array([s, t * (1 - s)]), w * (1 - s))
    basis = [element.lbasis(at, i) for i in range(block.data.shape[1])]
    shape = np.array([np.broadcast_to(b[0], weight.shape) for b in basis])
    slope = np.array([np.broadcast_to(b[1], at.shape) for b in basis])
    place = mesh.points[block.data][..., :2]
    area = weight * np.abs(np.linalg.det(np.einsum("eka,kbq->eqab", place, slope)))
    value = mesh.point_data[name][block.data]
    found = np.einsum("kq,ek...->eq...", shape, value)
    return np.einsum("kq,eka->eqa", shape, place).reshape(-1, 2), area.ravel(), found.reshape(-1, *value.shape[2:])


def smooth_step(x: np.ndarray) -> np.ndarray:
    """Derivative of a step from 0 at x = 0 to 1 at x = 1."""
    return np.where((x > 0) & (x < 1), 30 * x**2 * (1 - x) ** 2, 0.0)


def test_points_cover_the_disc(read, scene) -> None:
    place, area, _ = at_gauss_points(read, "potential_V_00")
    assert (read.cells[0].type == "quad9") == (len(scene.punches) == 1)
    assert area.sum() == pytest.approx(np.pi * 0.1**2, rel=1e-6)
    assert np.linalg.norm(place, axis=1).max() < 0.1
    assert not read.points[:, 2].any()


@pytest.mark.parametrize("pattern", [0, 5])
def test_the_driven_current_flows_through_every_cut_between_source_and_sink(read, scene, pattern) -> None:
    """The mean over parallel cuts between two gaps of the rim, one on either side of the source."""
    place, area, density = at_gauss_points(read, f"current_density_A_per_m_{pattern:02d}")
    angle = (pattern + 0.5) * 2 * np.pi / 16
    normal = np.array([-np.sin(angle), np.cos(angle)])
    width = 0.014
    ramp = smooth_step((place @ normal + width) / (2 * width)) / (2 * width)
    current = np.sum(area * ramp * (density[:, :2] @ normal))
    print(f"{current * 1e3:.6f} mA of 5")
    assert current == pytest.approx(scene.drive.current_A, rel={"normal": 2e-5, "principal": 3e-5}[scene.skin.strain])
    about = place - np.array([PUNCH.x_m, PUNCH.y_m])
    radius = np.linalg.norm(about, axis=1)
    ring = smooth_step((radius - 0.008) / 0.01) / 0.01
    through = np.sum(area * ring * np.sum(density[:, :2] * about, axis=1) / radius)
    assert abs(through) < 1e-4 * scene.drive.current_A


def test_potentials_give_the_readings_of_the_scene(read, scene, touch) -> None:
    """An electrode that is read carries no current: its voltage is the mean of the potential under it."""
    pairs = tuple((punch, touch) for punch in scene.punches)
    readings = solve(scene.body, scene.skin, scene.electrodes, scene.drive, pairs, LAW)
    radius, angle = np.linalg.norm(read.points, axis=1), np.arctan2(read.points[:, 1], read.points[:, 0])
    value = []
    for k in range(16):
        away = np.angle(np.exp(1j * (angle - k * np.pi / 8)))
        under = (radius > 0.1 * (1 - 1e-9)) & (np.abs(away) < 0.05 * (1 + 1e-9))
        order = np.argsort(away[under])
        value.append(np.trapezoid(read.point_data["potential_V_05"][under][order], away[under][order]) / 0.1)
    found = protocol(scene.drive, 16).weights[5] @ np.array(value)
    np.testing.assert_allclose(found, readings.touched_V[5], rtol=0, atol=2e-3 * np.abs(readings.touched_V).max())


def test_the_surface_goes_down_with_the_punch(read, scene, touch) -> None:
    moved_m = read.point_data["displacement_m"]
    for punch in scene.punches:
        near = np.linalg.norm(read.points[:, :2] - [punch.x_m, punch.y_m], axis=1) < punch.diameter_m / 4
        np.testing.assert_allclose(moved_m[near, 2], -touch.depth_m, rtol=0.02)
    far = np.linalg.norm(read.points[:, :2], axis=1) > 0.095
    assert np.abs(moved_m[far]).max() < 0.01 * touch.depth_m


def test_the_sheet_is_as_untouched_far_away_and_positive_everywhere(read, scene) -> None:
    sheet = read.point_data["sheet_conductance_S"].reshape(-1, 3, 3)
    np.testing.assert_allclose(sheet, np.swapaxes(sheet, 1, 2), rtol=0, atol=1e-15)
    assert np.linalg.eigvalsh(sheet[:, :2, :2]).min() > 0
    assert not sheet[:, 2].any()
    far = np.linalg.norm(read.points[:, :2], axis=1) > 0.095
    at_rest = untouched_conductance(LAW, scene.skin) * np.eye(2)
    np.testing.assert_allclose(sheet[far][:, :2, :2], np.broadcast_to(at_rest, (far.sum(), 2, 2)), rtol=0,
                               atol=1e-3 * at_rest[0, 0])


def test_only_the_centre_of_the_rings_is_collapsed(read, scene) -> None:
    taken = read.point_data["taken_from_middle"].astype(bool)
    assert taken.any() == (len(scene.punches) == 1)
    np.testing.assert_allclose(read.points[taken, :2], np.broadcast_to([PUNCH.x_m, PUNCH.y_m], (taken.sum(), 2)),
                               atol=1e-12)


def test_what_the_rim_moves_is_added_in_its_own_axes(touch) -> None:
    radius, share = np.linspace(0, 0.02, 5), np.linspace(0, 1, 6)
    one = np.ones((5, 6))
    added = 1e-4 * np.stack([one, one * np.sin(np.pi * share), -one], axis=-1)
    rim = RimField(radius, share, added, np.broadcast_to([1.0, 0, 1], (5, 6, 3)), np.ones((5, 6)), 0.1, 0.05)
    punch = replace(PUNCH, x_m=0.0, y_m=0.05)
    points = np.array([[0.0, 0.06], [0.01, 0.05], [-0.01, 0.05], [0.0, 0.01]])
    alone, together = (surface_displacement(points, ((punch, t),)) for t in (touch, replace(touch, rim=rim)))
    expected = 1e-4 * np.array([[0, 1, -1], [1, 1, -1], [-1, 1, -1], [0, 0, 0]])
    np.testing.assert_allclose(together - alone, expected, atol=2e-7)
    np.testing.assert_allclose(moved(rim, np.array([[0.0, -0.01]]))[0, 1], -1e-4, rtol=2e-3)


@pytest.mark.parametrize(("scene", "patterns", "message"), [
    (Scene(), [16], "pattern 16 is none of 0 to 15"), (Scene(), [-1], "pattern -1 is none")])
def test_fields_that_cannot_be_are_refused(scene, patterns, message, touch) -> None:
    with pytest.raises(ValueError, match=message):
        skin_fields(scene, [touch], LAW, patterns)


def test_pressure_strain_and_rest_are_those_of_the_touch(touch):
    points, _, fields = skin_fields(Scene(punches=(PUNCH,)), [touch], LAW, patterns=[3])
    away = np.hypot(points[:, 0] - PUNCH.x_m, points[:, 1] - PUNCH.y_m)
    assert np.array_equal(fields["contact_pressure_Pa"] > 0, np.interp(away, touch.radius_m, touch.pressure_Pa) > 0)
    assert fields["contact_pressure_Pa"].max() == pytest.approx(touch.sigma_max_Pa, rel=0.1)
    stretch = np.maximum(touch.stretch_meridian, touch.stretch_hoop)
    assert fields["largest_in_plane_strain"].max() == pytest.approx(stretch.max() - 1, rel=0.05)
    far = away > touch.radius_m[-1]
    assert np.allclose(fields["largest_in_plane_strain"][far], 0, atol=1e-12)
    change = fields["potential_V_03"] - fields["untouched_potential_V_03"]
    assert 0 < np.ptp(change) < 0.2 * np.ptp(fields["untouched_potential_V_03"])
