"""The edge next to a place: straight ones, parts of circles, and what other edges are how near."""

import math

import numpy as np
import pytest

from eitsim.scene.edges.outline import Outline
from eitsim.scene.nearest_edge import STRAIGHT_M, nearest_edge
from eitsim.scene.polygons import circle

RECTANGLE = Outline("rectangle", width_m=0.12, height_m=0.08)
DISC = Outline("polygon", points_m=tuple(map(tuple, circle((0.01, 0.0), 0.1, 400).tolist())))
L = Outline("polygon", points_m=((0, 0), (0.1, 0), (0.1, 0.04), (0.04, 0.04), (0.04, 0.1), (0, 0.1)))


def test_a_straight_edge_is_the_rim_of_a_wide_disc_and_the_others_are_the_rest():
    edge = nearest_edge(RECTANGLE, (0.02, 0.03))
    assert edge.disc_m == STRAIGHT_M
    assert edge.distance_m == pytest.approx(0.01, rel=1e-9)
    np.testing.assert_allclose(edge.towards, [0, 1], atol=1e-12)
    np.testing.assert_allclose(np.sort(edge.others_m)[:3], [0.04, 0.04 * math.sqrt(2), 0.08], rtol=0.01)


@pytest.mark.parametrize(("radius", "angle"), [(0.08, 0.3), (0.095, 2.0), (0.05, -1.0)])
def test_a_polygon_of_many_corners_is_the_disc(radius: float, angle: float):
    edge = nearest_edge(DISC, (0.01 + radius * math.cos(angle), radius * math.sin(angle)))
    assert edge.disc_m == pytest.approx(0.1, rel=0.01)
    assert edge.distance_m == pytest.approx(0.1 - radius, abs=1e-5)
    np.testing.assert_allclose(edge.towards, [math.cos(angle), math.sin(angle)], atol=0.004)
    assert np.isinf(edge.others_m).all()


def test_a_corner_is_another_edge_however_near():
    edge = nearest_edge(RECTANGLE, (0.05, 0.032))
    assert edge.distance_m == pytest.approx(0.008, rel=1e-6)
    assert edge.others_m.min() == pytest.approx(0.01, rel=0.01)


@pytest.mark.parametrize("at", [(0.0, 0.04), (0.06, 0.04)])
def test_on_the_edge_itself_the_distance_is_0(at: tuple[float, float]):
    edge = nearest_edge(RECTANGLE, at)
    assert edge.distance_m == pytest.approx(0.0, abs=1e-9)
    assert np.isfinite(edge.towards).all()


def test_at_a_corner_that_points_inwards_no_edge_is_alone():
    edge = nearest_edge(L, (0.03, 0.03))
    assert edge.distance_m == pytest.approx(0.01 * math.sqrt(2), rel=1e-6)
    assert edge.others_m.min() < 1.1 * edge.distance_m


def test_a_round_hole_is_no_straight_edge():
    holed = Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((0.0, 0.0, 0.006),))
    edge = nearest_edge(holed, (0.0, 0.012))
    assert edge.distance_m == pytest.approx(0.006, rel=0.01)
    assert edge.others_m.min() < 1.2 * edge.distance_m


def test_a_rounded_corner_counts_where_it_leaves_the_straight_edge():
    rounded = Outline("rectangle", width_m=0.12, height_m=0.08, corner_radius_m=0.02)
    edge = nearest_edge(rounded, (0.0, 0.03))
    assert edge.disc_m == STRAIGHT_M
    assert 0.04 < edge.others_m.min() < 0.06
