"""A press as a series of files: read back, its foam, punch and electrodes fit each other and the touch."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

import eitsim
from eitsim.scene.scene import from_edge_m, profile_of
from eitsim.simulation.press_series import loaded
from matcal.card import MaterialCard
from matcal.laws.hyperfoam import Hyperfoam

CARD = MaterialCard("Table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm"))
SCENE = eitsim.Scene(punches=(eitsim.Punch(x_m=0.02, y_m=-0.01, force_N=0.5),), accuracy=eitsim.Accuracy(0.05))
STEPS = 2
TETRAHEDRA = {"hexahedron": [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)],
              "wedge": [(0, 2, 1, 3), (1, 2, 5, 3), (1, 5, 4, 3)]}


@pytest.fixture(scope="module")
def touches():
    return eitsim.press_of(SCENE, CARD, steps=STEPS)


@pytest.fixture(scope="module")
def series(touches, tmp_path_factory):
    path = Path(tmp_path_factory.mktemp("press")) / "press.pvd"
    eitsim.write_press(SCENE, touches, path)
    return path


def block(series, name, step=STEPS):
    return meshio.read(series.parent / "press" / f"{name}_{step:03d}.vtu")


def volumes(points, blocks):
    corners = np.concatenate([cells.data[:, list(four)] for cells in blocks for four in TETRAHEDRA[cells.type]])
    a, b, c, d = np.moveaxis(points[corners], 1, 0)
    return np.einsum("ni,ni->n", np.cross(b - a, c - a), d - a) / 6


def about_the_punch(foam):
    """Radius from the punch's axis and outward displacement of the foam's points, m."""
    (punch,) = SCENE.punches
    away = foam.points[:, :2] - np.array([punch.x_m, punch.y_m])
    radius = np.linalg.norm(away, axis=1)
    return radius, np.sum(foam.point_data["displacement_m"][:, :2] * away, axis=1) / np.maximum(radius, 1e-12)


def test_the_series_lists_equal_steps_of_the_force_and_every_part(series, touches):
    listed = list(ElementTree.parse(series).iter("DataSet"))
    assert [float(one.get("timestep")) for one in listed[::3]] == [0, 0.25, 0.5]
    assert [(one.get("name"), one.get("part")) for one in listed[:3]] == [
        ("foam", "0"), ("punch", "1"), ("electrodes", "2")]
    assert all((series.parent / one.get("file")).is_file() for one in listed)
    assert [touch.force_N for touch in touches] == pytest.approx([0.25, 0.5], rel=1e-3)


def test_the_foam_is_half_the_disc_untouched_and_stays_upright_pressed(series):
    foam, rest = block(series, "foam"), block(series, "foam", 0)
    assert np.abs(rest.point_data["displacement_m"]).max() == 0
    before = volumes(foam.points, foam.cells)
    body = SCENE.body
    assert before.min() > 0
    assert before.sum() == pytest.approx(np.pi * body.radius_m**2 * body.thickness_m / 2, rel=5e-3)
    assert volumes(foam.points + foam.point_data["displacement_m"], foam.cells).min() > 0


def test_the_skin_moves_as_the_touch_and_its_strain_is_that_of_its_motion(series, touches):
    foam = block(series, "foam")
    radius, outwards = about_the_punch(foam)
    (punch,) = SCENE.punches
    top = foam.points[:, 2] == 0
    moved = np.interp(radius[top], touches[-1].radius_m, touches[-1].u_z_m)
    # a disc's radius from the axis the touch rests
    assert foam.point_data["displacement_m"][top, 2] == pytest.approx(moved, abs=0.01 * touches[-1].depth_m)
    ahead = np.array([punch.x_m, punch.y_m]) / np.hypot(punch.x_m, punch.y_m)
    away = foam.points[:, :2] - np.array([punch.x_m, punch.y_m])
    ray = np.flatnonzero(top & (radius > 1e-9) & (away @ ahead >= 0) & (np.abs(away @ [-ahead[1], ahead[0]]) < 1e-9))
    ray = ray[np.argsort(radius[ray])]
    r, u_r, u_z = radius[ray], outwards[ray], foam.point_data["displacement_m"][ray, 2]
    meridian = np.hypot(np.gradient(r + u_r, r), np.gradient(u_z, r))[1:-1]
    expected = np.maximum(meridian, 1 + u_r[1:-1] / r[1:-1]) - 1
    found = foam.point_data["driving_strain_principal"][ray][1:-1]
    smooth = np.abs(r[1:-1] - punch.diameter_m / 2) > 1e-3  # but for the edge, where differences are coarse
    assert np.abs(found - expected)[smooth].max() < 0.01 * found.max()


def test_strain_inside_the_foam_goes_on_from_the_skin(series):
    foam = block(series, "foam")
    radius, outwards = about_the_punch(foam)
    below = (foam.points[:, 2] < 0) & (radius > 1e-9)
    hoop = outwards[below] / radius[below]
    found = foam.point_data["driving_strain_principal"][below]
    assert np.all(found > hoop - 1e-4)
    assert found.max() > 0.02


def test_the_foam_stays_outside_the_punch_which_is_as_deep_as_the_touch(series, touches):
    foam, punch = block(series, "foam"), block(series, "punch")
    low = (punch.points + punch.point_data["displacement_m"])[:, 2].min()
    assert low == pytest.approx(-touches[-1].depth_m, rel=1e-5)
    (given,) = SCENE.punches
    assert np.hypot(punch.points[:, 0] - given.x_m, punch.points[:, 1] - given.y_m).max() == pytest.approx(0.007)
    radius, outwards = about_the_punch(foam)
    height = (foam.points + foam.point_data["displacement_m"])[:, 2]
    inside = profile_of(given).signed_distance(radius + outwards, height - low).penetration
    assert 0 < inside.max() < 0.02 * touches[-1].depth_m  # the penalty's


@pytest.mark.parametrize("profile", ["flat", "sphere", "cone", "ellipse"])
def test_the_punch_is_drawn_on_its_own_outline(touches, tmp_path, profile):
    punch = replace(SCENE.punches[0], profile=profile)
    eitsim.write_press(replace(SCENE, punches=(punch,)), touches[-1:], tmp_path / "press.pvd")
    points = block(tmp_path / "press.pvd", "punch", 1).points
    radius = np.hypot(points[:, 0] - punch.x_m, points[:, 1] - punch.y_m)
    depth = profile_of(punch).signed_distance(radius, points[:, 2]).penetration
    assert np.abs(depth).max() < 1e-7


@pytest.mark.parametrize(("kind", "cells"), [("line", "line"), ("patch", "quad")])
def test_electrodes_lie_at_the_rim_as_wide_as_given(touches, tmp_path, kind, cells):
    scene = replace(SCENE, electrodes=eitsim.Electrodes(kind=kind, length_m=0.005))
    eitsim.write_press(scene, touches[-1:], tmp_path / "press.pvd")
    found = block(tmp_path / "press.pvd", "electrodes", 1)
    assert {one.type for one in found.cells} == {cells}
    first = found.points[found.point_data["electrode"] == 0]
    radius, angle = np.linalg.norm(first, axis=1), np.arctan2(first[:, 1], first[:, 0])
    assert np.ptp(angle) == pytest.approx(0.01 / 0.1)
    assert np.ptp(radius) == pytest.approx(0.005 if kind == "patch" else 0, abs=1e-12)
    assert len(np.unique(found.point_data["electrode"])) == 16


OUTLINED = eitsim.Body(eitsim.Outline("rectangle", width_m=0.2, height_m=0.12, holes_m=((-0.06, 0.0, 0.01),)))


@pytest.mark.thorough
@pytest.mark.parametrize(("electrodes", "cells"), [
    (eitsim.Electrodes(first_angle_rad=0.54), ["line"]),  # one around a corner
    (eitsim.Electrodes(kind="surface", count=4, x_m=(-0.08, 0.08, 0.08, -0.08), y_m=(-0.05, -0.05, 0.05, 0.05),
                       shape="disc"), ["triangle", "line"])])
def test_an_outline_is_cut_towards_its_nearest_edge_and_drawn_with_its_electrodes(touches, tmp_path, electrodes, cells):
    scene = replace(SCENE, body=OUTLINED, electrodes=electrodes)
    eitsim.write_press(scene, touches[-1:], tmp_path / "press.pvd")
    foam, found = block(tmp_path / "press.pvd", "foam", 1), block(tmp_path / "press.pvd", "electrodes", 1)
    inside = from_edge_m(OUTLINED, foam.points[:, :2])
    assert inside.min() > -1e-3  # chords of the round hole
    assert foam.points[:, 1].min() == pytest.approx(-0.06, abs=1e-9)
    assert foam.points[:, 0].min() > 0.02 - 1e-9  # the nearest edge is the lower one
    assert volumes(foam.points + foam.point_data["displacement_m"], foam.cells).min() > 0
    assert [one.type for one in found.cells] == cells
    number = found.point_data["electrode"]
    np.testing.assert_array_equal(np.unique(number), np.arange(-1, electrodes.count))
    on_edge = np.abs(from_edge_m(OUTLINED, found.points[:, :2])) < 1e-9
    assert on_edge[number == -1].all()
    if electrodes.kind == "line":
        assert on_edge.all()
        for k in range(electrodes.count):
            own = found.points[number == k]
            assert np.linalg.norm(np.diff(own, axis=0), axis=1).sum() == pytest.approx(0.01)
    else:
        assert from_edge_m(OUTLINED, found.points[number >= 0, :2]).min() > 0.004


def test_a_depth_is_reached_in_equal_steps():
    punch = eitsim.Punch(depth_m=0.002)
    assert loaded(punch, 0.25) == replace(punch, depth_m=0.0005)


@pytest.mark.parametrize("scene", [
    replace(SCENE, punches=SCENE.punches * 2), replace(SCENE, hold=eitsim.Hold(time_s=(1.0,)))])
def test_what_has_no_series_says_so_before_anything_is_solved(scene):
    with pytest.raises(ValueError, match=r"\(.pvd\) is built for one touch, without a hold"):
        eitsim.press_of(scene, CARD)


def test_a_touch_without_displacements_inside_has_no_series(touches, tmp_path):
    with pytest.raises(ValueError, match="keeps no displacements inside the layer"):
        eitsim.write_press(SCENE, [replace(touches[0], section=None)], tmp_path / "press.pvd")
    assert not list(tmp_path.iterdir())


def test_a_shorter_series_leaves_nothing_of_a_longer_one(touches, tmp_path):
    for count in (2, 1):
        eitsim.write_press(SCENE, touches[-count:], tmp_path / "press.pvd")
    listed = {one.get("file") for one in ElementTree.parse(tmp_path / "press.pvd").iter("DataSet")}
    assert {f"press/{place.name}" for place in (tmp_path / "press").iterdir()} == listed
    assert sorted(place.name for place in tmp_path.iterdir()) == ["press", "press.pvd"]


@pytest.mark.parametrize("last", ["punch_001.vtu", "press.pvd"])
def test_an_interrupted_series_leaves_the_earlier_one_or_no_list(touches, tmp_path, monkeypatch, last):
    eitsim.write_press(SCENE, touches, tmp_path / "press.pvd")
    before = {place: place.read_bytes() for place in tmp_path.rglob("*.*")}

    def interrupted(whole):
        def write(mesh, place, **options):
            if Path(getattr(place, "name", place)).name.lstrip(".").startswith(last):
                raise KeyboardInterrupt
            whole(mesh, place, **options)
        return write

    for kind in (meshio.Mesh, ElementTree.ElementTree):
        monkeypatch.setattr(kind, "write", interrupted(kind.write))
    with pytest.raises(KeyboardInterrupt):
        eitsim.write_press(SCENE, touches[-1:], tmp_path / "press.pvd")
    assert sorted(place.name for place in tmp_path.iterdir()) == ["press"] + ["press.pvd"] * (last != "press.pvd")
    assert last == "press.pvd" or before == {place: place.read_bytes() for place in tmp_path.rglob("*.*")}


def test_a_folder_with_other_files_is_not_replaced(touches, tmp_path):
    (tmp_path / "press").mkdir()
    (tmp_path / "press" / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match=r"press.pvd: .* holds notes.txt, no part of a series. Choose another name"):
        eitsim.write_press(SCENE, touches[-1:], tmp_path / "press.pvd")
    assert [place.name for place in (tmp_path / "press").iterdir()] == ["notes.txt"]
