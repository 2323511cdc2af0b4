"""Electrodes on skins with an outline: where they lie, in what forms they are given, and what is refused."""

import math

import numpy as np
import pytest

from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import middles_m, patch_loops, stretches_along
from eitsim.scene.electrodes import present
from eitsim.scene.polygons import signed_area
from eitsim.scene.scene import Body, Electrodes, Scene, read_scene, scene_from
from touchcal.errors import InputFileError

RECTANGLE = Body(Outline("rectangle", width_m=0.12, height_m=0.08))
TABLE = {"outline": "rectangle", "width_mm": 120, "height_mm": 80}
FOUR = {"kind": "surface", "x_mm": [-30, 30, -30, 30], "y_mm": [-20, -20, 20, 20], "count": 4}


def test_electrodes_are_even_along_the_edge_from_the_right_counter_clockwise():
    scene = Scene(RECTANGLE, electrodes=Electrodes(count=8))
    np.testing.assert_allclose(middles_m(RECTANGLE.outline, scene.electrodes), 1e-3 * np.array(
        [[60, 0], [50, 40], [0, 40], [-50, 40], [-60, 0], [-50, -40], [0, -40], [50, -40]]), atol=1e-12)
    turned = Scene(RECTANGLE, electrodes=Electrodes(count=8, first_angle_rad=math.pi / 2)).electrodes
    np.testing.assert_allclose(middles_m(RECTANGLE.outline, turned)[0], [0, 0.04], atol=1e-12)


def test_shares_positions_and_angles_name_the_same_places():
    expected = 1e-3 * np.array([[60, 0], [0, 40], [-60, 0], [0, -40]])
    for given in ({"shares": [0, 0.25, 0.5, 0.75]}, {"positions_mm": [0, 100, 200, 300]},
                  {"angles_deg": [0, 90, 180, 270]}):
        scene = scene_from({"body": TABLE, "electrodes": {"count": 4, **given}})
        np.testing.assert_allclose(middles_m(scene.body.outline, scene.electrodes), expected, atol=1e-12)


def test_stretches_are_as_long_as_their_widths_around_corners_too():
    electrodes = Electrodes(count=4, width_m=(0.01, 0.03, 0.01, 0.02), positions_m=(0.04, 0.1, 0.2, 0.36))
    np.testing.assert_allclose(np.diff(stretches_along(RECTANGLE.outline, electrodes))[:, 0], electrodes.width_m)


def test_patches_have_their_areas_places_and_turns():
    electrodes = Electrodes(kind="surface", count=4, x_m=(0, 0.02, 0.04, -0.02), y_m=(0, 0, 0, 0.01), width_m=0.008,
                            length_m=0.006, shape=("disc", "rectangle", "sector", "rectangle"),
                            turn_rad=(0, 0, math.pi, math.pi / 2), opening_rad=1.0)
    disc, plain, sector, turned = patch_loops(electrodes)
    areas = [signed_area(loop) for loop in (disc, plain, sector, turned)]
    np.testing.assert_allclose(areas, [math.pi * 0.004**2, 0.008 * 0.006, 0.5 * 0.006**2, 0.008 * 0.006], rtol=1e-12)
    np.testing.assert_allclose(np.ptp(plain, axis=0), [0.008, 0.006])
    np.testing.assert_allclose(np.ptp(turned, axis=0), [0.006, 0.008], atol=1e-15)
    assert sector[:, 0].max() == pytest.approx(0.04)


def test_grids_and_files_of_places_are_written_out(tmp_path):
    (tmp_path / "places.csv").write_text("x_mm,y_mm,shape,width_mm,length_mm\n-30,-20,disc,5,5\n30,-20,rectangle,6,4\n"
                                         "-30,20,disc,5,5\n30,20,disc,5,5\n")
    body = '[body]\noutline = "rectangle"\nwidth_mm = 120\nheight_mm = 80\n[electrodes]\nkind = "surface"\n'
    (tmp_path / "a.toml").write_text(body + 'places = "places.csv"\n')
    found = read_scene(tmp_path / "a.toml").electrodes
    assert (found.count, found.shape, found.width_m) == (4, ("disc", "rectangle", "disc", "disc"),
                                                         (0.005, 0.006, 0.005, 0.005))
    (tmp_path / "b.toml").write_text(body + "grid = [3, 2]\npitch_mm = [30, 20]\nwidth_mm = 5\n")
    found = read_scene(tmp_path / "b.toml").electrodes
    np.testing.assert_allclose(np.column_stack([found.x_m, found.y_m]), 1e-3 * np.array(
        [[-30, -10], [0, -10], [30, -10], [-30, 10], [0, 10], [30, 10]]))
    (tmp_path / "places.csv").write_text("x_mm,y_mm\n0,0\n1,wide\n")
    with pytest.raises(InputFileError, match="'wide' is no number"):
        read_scene(tmp_path / "a.toml")


def test_missing_electrodes_leave_the_others_where_they_are():
    line = Scene(RECTANGLE, electrodes=Electrodes(count=8, missing=(2,))).electrodes
    there, every = (middles_m(RECTANGLE.outline, one) for one in (present(line), line))
    np.testing.assert_allclose(there, np.delete(every, 2, axis=0))
    five = {**FOUR, "x_mm": [*FOUR["x_mm"], 0], "y_mm": [*FOUR["y_mm"], 0], "count": 5, "missing": [0],
            "shape": ["disc"] * 4 + ["rectangle"]}
    grid = scene_from({"body": TABLE, "electrodes": five}).electrodes
    np.testing.assert_allclose(middles_m(RECTANGLE.outline, present(grid)), middles_m(RECTANGLE.outline, grid)[1:])


@pytest.mark.parametrize(("electrodes", "said"), [
    ({"width_mm": 30}, "width_mm in \\[electrodes\\]: electrodes 8 and 9 .* overlap by 5 mm"),
    ({"kind": "patch"}, "a sector at the rim of a disc"),
    ({"count": 4, "shares": [0, 0.1, 0.2, 0.3], "angles_deg": [0, 90, 180, 270]}, "leave one of them out"),
    ({"count": 4, "shares": [0, 0.1]}, "shares in \\[electrodes\\]: must hold 4 numbers, one an electrode, got 2\\.$"),
    ({"angles_deg": [0, 90, 180, 270]}, "must hold 16 numbers, one an electrode, got 4; or write count = 4\\.$"),
    ({"positions_mm": [0, 90, 180, 270]}, "must hold 16 numbers, one an electrode, got 4; or write count = 4\\.$"),
    (FOUR | {"turn_deg": [0, 90, 180, 270, 0]}, "must hold 4 numbers, one an electrode, got 5\\.$"),
    ({"count": 3}, "count in \\[electrodes\\]: must be 4 to 64"),
    ({"shape": "disc", "x_mm": [1]}, "x_mm in \\[electrodes\\]: has no effect with kind = \"line\""),
    ({"contact_impedance_Ohm_m2": 1e-4}, "with kind = \"line\"; give contact_impedance_Ohm_m \\(impedance"),
    (FOUR | {"x_mm": [-58, 30, -30, 30]}, "electrode 0 \\(from 0\\) lies off the skin"),
    (FOUR | {"x_mm": [-90, 30, -30, 30]}, "electrode 0 \\(from 0\\) lies off the skin"),
    (FOUR | {"x_mm": [25, 30, -30, 30]}, "electrodes 0 and 1 \\(from 0\\) overlap"),
    (FOUR | {"x_mm": [30, 30, -30, 30], "width_mm": [2, 12, 4, 4]}, "electrodes 0 and 1 \\(from 0\\) overlap"),
    (FOUR | {"count": 5}, "must hold 5 numbers each"),
    (FOUR | {"shape": "star"}, "'star' is unknown; known: disc, rectangle, sector"),
    (FOUR | {"shape": "sector", "opening_deg": 200}, "opening_deg"),
    (FOUR | {"shares": [0, 0.1, 0.2, 0.3]}, "shares in \\[electrodes\\]: has no effect with kind = \"surface\""),
])
def test_electrodes_that_overlap_or_lie_off_the_skin_are_refused(electrodes, said):
    with pytest.raises(ValueError, match=said):
        scene_from({"body": TABLE, "electrodes": electrodes})


def test_an_electrode_over_a_hole_is_refused():
    with pytest.raises(ValueError, match=r"electrode 3 .* lies off the skin"):
        scene_from({"body": TABLE | {"holes_mm": [[31, 21, 1]]}, "electrodes": FOUR | {"width_mm": 8}})


@pytest.mark.parametrize("electrodes", [FOUR, {"count": 4, "shares": [0, 0.25, 0.5, 0.75]}])
def test_a_disc_says_that_it_needs_an_outline_for_them(electrodes):
    with pytest.raises(ValueError, match="needs an outline in \\[body\\]"):
        scene_from({"electrodes": electrodes})


def test_a_direction_without_edge_is_refused():
    horseshoe = [[0, 0], [100, 0], [100, 10], [10, 10], [10, 90], [100, 90], [100, 100], [0, 100]]
    with pytest.raises(ValueError, match="no edge lies at 0 degrees"):
        scene_from({"body": {"outline": "polygon", "points_mm": horseshoe}, "electrodes": {"count": 4}})
