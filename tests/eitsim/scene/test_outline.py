"""Outlines of skins: areas, distances to edges, what comes back of a scene, and what is refused."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from eitsim.scene.edges.outline import Outline
from eitsim.scene.nearest_edge import quarter_distances_m
from eitsim.scene.polygons import area_m2, centroid_m, edge_distance_m
from eitsim.scene.scene import Body, Punch, Scene, rim_gap_m, scene_from, scene_tables

SIZES = {"outline": "rectangle", "width_mm": 120, "height_mm": 80}
RECTANGLE = Body(Outline("rectangle", width_m=0.12, height_m=0.08))
# an L, clockwise and with its first corner repeated
L_SHAPE = Body(Outline("polygon",
    points_m=((0, 0), (0, 0.2), (0.08, 0.2), (0.08, 0.08), (0.2, 0.08), (0.2, 0), (0, 0)),
                                  holes_m=((0.04, 0.15, 0.01), ((0.1, 0.02), (0.12, 0.02), (0.11, 0.05)))))


def test_round_corners_and_round_holes_keep_the_area_of_their_arcs():
    body = Body(Outline("rectangle", width_m=0.12, height_m=0.08, corner_radius_m=0.02, holes_m=((0.01, 0.0, 0.015),)))
    assert area_m2(body.outline) == pytest.approx(0.12 * 0.08 - (4 - math.pi) * 0.02**2 - math.pi * 0.015**2, rel=1e-12)
    whole = Body(Outline("rectangle", width_m=0.2, height_m=0.2, corner_radius_m=0.1))
    assert whole.edge.size_m == pytest.approx(0.1, rel=1e-12)
    away = np.hypot(*whole.outline.loops[0].T)
    assert np.abs(away - 0.1).max() < 5e-4 * 0.1


def test_the_outer_edge_turns_counter_clockwise_and_holes_the_other_way():
    outer, *holes = L_SHAPE.outline.loops
    assert len(outer) == 6
    assert area_m2(L_SHAPE.outline) == pytest.approx(0.2**2 - 0.12**2 - math.pi * 0.01**2 - 0.02 * 0.03 / 2)
    turns = [np.sum(a[:, 0] * np.roll(a[:, 1], -1) - np.roll(a[:, 0], -1) * a[:, 1]) for a in (outer, *holes)]
    assert turns[0] > 0
    assert max(turns[1:]) < 0
    np.testing.assert_allclose(centroid_m(RECTANGLE.outline), 0, atol=1e-15)


def test_distances_to_edges_and_holes_are_those_of_many_points_on_them():
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.02, 0.22, (200, 2))
    way = np.linspace(0, 1, 2001)[:, None]
    edges = np.vstack([a + way * (b - a) for loop in L_SHAPE.outline.loops
                       for a, b in zip(loop, np.roll(loop, -1, axis=0), strict=True)])
    nearest = cKDTree(edges).query(points)[0]
    found = edge_distance_m(L_SHAPE.outline, points)
    assert np.all(nearest >= np.abs(found) - 1e-12)
    assert np.all(nearest**2 <= found**2 + (0.2 / 2000 / 2) ** 2 + 1e-12)
    x, y = points.T
    on = (x > 0) & (y > 0) & (x < 0.2) & (y < 0.2) & ~((x > 0.08) & (y > 0.08)) & (np.hypot(x - 0.04, y - 0.15) > 0.01)
    on &= ~((y > 0.02) & (np.abs(x - 0.11) < 0.01 * (0.05 - y) / 0.03))
    np.testing.assert_array_equal(found > 0, on)


def test_distances_by_quarters_are_those_to_the_four_sides():
    """Quarters part at 45 degrees to the nearest side, along which the same side may lie."""
    np.testing.assert_allclose(quarter_distances_m(RECTANGLE.outline, (0.0, 0.0)),
                               [0.04, 0.04 * 2**0.5, 0.04, 0.04 * 2**0.5], rtol=1e-2)
    np.testing.assert_allclose(np.sort(quarter_distances_m(RECTANGLE.outline, (0.045, 0.026)))[:2], [0.014, 0.015],
                               rtol=1e-3)


def test_the_gap_of_a_punch_is_that_to_the_nearest_edge():
    assert rim_gap_m(RECTANGLE, Punch(0.05, 0.0, 0.014)) == pytest.approx(0.003)
    assert rim_gap_m(RECTANGLE, Punch(0.0, 0.05, 0.014)) == pytest.approx(-0.017)
    assert rim_gap_m(L_SHAPE, Punch(0.04, 0.12, 0.014)) == pytest.approx(0.013, abs=2e-5)


@pytest.mark.parametrize("body", [SIZES | {"corner_radius_mm": 10,
                                           "holes_mm": [[10, 0, 5], [[30, 0], [40, 0], [35, 9]]]},
                                  {"outline": "polygon", "points_mm": [[0, 0], [100, 0], [90, 80]], "thickness_mm": 5}])
def test_a_scene_with_an_outline_comes_back_from_its_tables(body):
    scene = scene_from({"body": body, "electrodes": {"count": 8}})
    tables = scene_tables(scene)
    assert {key: value for key, value in tables["body"].items() if key in body} == body
    assert "radius_mm" not in tables["body"]
    assert scene_from(tables) == scene


def test_the_tables_of_a_disc_know_no_outline():
    assert scene_tables(Scene())["body"] == {"radius_mm": 100.0, "thickness_mm": 10.0}


@pytest.mark.parametrize(("body", "said"), [
    ({"outline": "polygon", "points_mm": [[0, 0], [10, 10], [10, 0], [0, 10]]},
     "points_mm in \\[body\\]: the edges from \\(0, 0\\) and from \\(10, 0\\) mm cross"),
    ({"outline": "polygon", "points_mm": [[0, 0], [10, 0], [5, 0], [5, 10]]}, "cross or touch"),
    ({"outline": "polygon", "points_mm": [[0, 0], [10, 0]]}, "three points"),
    ({"outline": "polygon", "points_mm": [[0, 0], [10, 0], [10, 0], [0, 10]]}, "given twice in a row"),
    ({"outline": "polygon"}, "points_mm in \\[body\\]: is missing"),
    ({"outline": "polygon", "points_mm": [[k, k * k % 7] for k in range(2001)]}, "at most 2000 are taken"),
    ({"outline": "rectangle", "width_mm": 120}, "height_mm in \\[body\\]: is missing"),
    (SIZES | {"corner_radius_mm": 41}, "0 to half of the shorter side, 40, got 41"),
    (SIZES | {"holes_mm": [[56, 0, 5]]}, "a hole touches the outline"),
    (SIZES | {"holes_mm": [[0, 0, 5], [8, 0, 5]]}, "a hole touches another hole"),
    (SIZES | {"holes_mm": [[0, 0, 15], [0, 0, 5]]}, "hole 2 lies in another hole"),
    (SIZES | {"holes_mm": [[90, 0, 5]]}, "hole 1 lies outside the outline"),
    (SIZES | {"holes_mm": [[0, 0, -5]]}, "of a positive radius"),
    (SIZES | {"holes_mm": [20, 0, 4]}, "\\[\\[20, 0, 4\\]\\]"),
    ({"outline": "polygon", "points_mm": [[0, 10], [10, 0], [10, 10], [5, -9]]}, "the edges from \\(5, -9\\) and"),
    (SIZES | {"holes_mm": [[0, 0]]}, "circles \\[x, y, radius\\]"),
    (SIZES | {"radius_mm": 50}, "radius_mm in \\[body\\] has no effect with an outline"),
    (SIZES | {"points_mm": [[0, 0], [1, 0], [0, 1]]}, "points_mm in \\[body\\]: has no effect with outline = "
     "\"rectangle\"; leave it out, or write outline = \"polygon\""),
    ({"width_mm": 50}, "width_mm in \\[body\\]: has no effect with outline = \"disc\"; leave it out, or "
     "write outline = \"rectangle\""),
    ({"holes_mm": [[20, 0, 4]]}, "leave it out, or write outline = \"rectangle\" or \"polygon\""),
    ({"outline": "oval"}, "'oval' is unknown; known: disc, rectangle, polygon"),
    (SIZES | {"width_mm": -3}, "width_mm in \\[body\\]: must be positive"),
])
def test_what_is_no_outline_is_refused_by_its_key(body, said):
    with pytest.raises(ValueError, match=said):
        scene_from({"body": body})


def test_an_outline_made_in_python_is_checked_and_takes_arrays():
    with pytest.raises(ValueError, match="cross or touch"):
        Body(Outline("polygon", points_m=((0, 0), (0.1, 0.1), (0.1, 0), (0, 0.1))))
    with pytest.raises(ValueError, match="circles \\[x, y, radius\\]"):
        Body(Outline("rectangle", width_m=0.1, height_m=0.1, holes_m=[[0, 0]]))
    body = Body(Outline("polygon", points_m=np.array([[0, 0], [0.1, 0], [0, 0.1]]), holes_m=[[0.02, 0.02, 0.005]]))
    assert hash(body) == hash(Body(Outline("polygon", points_m=body.outline.points_m,
                                     holes_m=body.outline.holes_m)))
