"""Edges of a skin: how far places are from them, and which presses they refuse."""

import numpy as np
import pytest

from eitsim.scene.edges.outline import Outline
from eitsim.scene.polygons import edge_distance_m
from eitsim.scene.scene import Body, Electrodes
from surrogate.data.skin_edges import SLACK_MM, Circle, Polygons
from surrogate.data.skin_from_above import skin_of

L_WITH_HOLE = Body(Outline("polygon", holes_m=((0.03, 0.09, 0.006),), points_m=(
    (0.0, 0.0), (0.12, 0.0), (0.12, 0.06), (0.06, 0.06), (0.06, 0.12), (0.0, 0.12))), 0.005)
GAP_MM, DIAMETER_MM = 11.0, 10.0


@pytest.fixture(scope="module")
def edges() -> Polygons:
    return Polygons(skin_of(L_WITH_HOLE.outline, Electrodes(count=12, width_m=0.008)).loops_mm)


def places() -> list[tuple[float, float]]:
    found = np.random.default_rng(1).uniform(-10, 130, (300, 2))
    return [(float(x), float(y)) for x, y in found]


def test_distances_are_those_of_the_outline(edges: Polygons) -> None:
    known = 1e3 * edge_distance_m(L_WITH_HOLE.outline, 1e-3 * np.array(places()))
    assert [edges.distance_mm(one) for one in places()] == pytest.approx(known.tolist(), abs=1e-9)


def test_presses_in_holes_and_near_edges_are_refused(edges: Polygons) -> None:
    away = np.array([edges.distance_mm(one) for one in places()])
    refused = np.array([edges.refuses(one, DIAMETER_MM, GAP_MM) for one in places()])
    assert 10 < np.sum(~refused) < 250
    assert np.array_equal(refused, away < GAP_MM - SLACK_MM)
    assert edges.refuses((30.0, 90.0), 1.0, 0.0)  # in the hole
    assert not edges.refuses((30.0, 30.0), 59.0, 5.0)
    assert edges.refuses((30.0, 30.0), 61.0, 5.0)  # the punch overhangs


def test_a_circle_pulls_instead_of_refusing() -> None:
    circle = Circle((1.0, 2.0), 50.0)
    assert circle.held((61.0, 82.0), 40.0) == pytest.approx((7.0, 10.0))
    assert circle.held((3.0, 4.0), 40.0) == (3.0, 4.0)
    assert not circle.refuses((49.0, 2.0), 20.0, 40.0)


def test_places_near_two_edges_are_refused_where_one_alone_is_known(edges: Polygons) -> None:
    """Within 20 mm of an edge all others within 20 mm must lie on its line."""
    alone = Polygons(edges.loops_mm, 20.0)
    for place, known in (((90.0, 12.0), True), ((108.0, 30.0), True), ((108.0, 12.0), False), ((45.0, 45.0), True),
                         ((48.0, 48.0), False), ((48.0, 75.0), False), ((30.0, 104.0), False), ((30.0, 30.0), True)):
        assert not edges.refuses(place, 10.0, 5.0)
        assert alone.refuses(place, 10.0, 5.0) is not known, place
