"""Which places a forward map knows: all of a disc, and of an outline those near one straight edge at most."""

import numpy as np
import pytest

from surrogate.data.sensor_ring import Ring, radial
from surrogate.forward_map.known_places import (
    CONVERGES,
    INNER,
    NearEdges,
    alone_mm,
    bounds_of,
    extent,
    known_place,
    near_edges_of,
    within,
)

HALF_MM = np.array([75.0, 50.0])  # half the rectangle's width and height


def test_rounding_takes_no_touch_out_of_a_range_of_one_diameter(ring: Ring) -> None:
    bounds = np.array([[3.0, 14.0, 0.1], [60.0, 14.0, 2.0]])
    touch = np.array([[1.0, 2.0, 14.0 - 1e-13, 1.0], [1.0, 2.0, 14.001, 1.0], [59.0, 12.0, 14.0, 1.0],
                      [0.0, 0.0, 14.0 + 1e-13, 2.0]])
    assert within(ring, bounds, None, touch).tolist() == [True, False, False, True]


def test_all_places_of_a_disc_are_known(ring: Ring) -> None:
    touch = np.array([[0.0, 0.0, 14.0, 1.0], [0.0, 99.0, 14.0, 1.0]])
    assert known_place(ring, 60.0, None, touch).all()


def test_of_a_rectangle_places_near_one_edge_are_known_and_its_corners_are_not(rectangle_ring: Ring) -> None:
    """As distances to its edges say, with small and large punches."""
    rng, count = np.random.default_rng(0), 2000
    touch = np.column_stack([*(rng.uniform(-half, half, count) for half in HALF_MM), rng.uniform(2, 30, count),
                             np.ones(count)])
    near, far = 0.95, 0.6
    alone = alone_mm(rectangle_ring, far)
    first, second = np.sort(HALF_MM - np.abs(touch[:, :2]), axis=1).T
    one = (first >= alone_mm(rectangle_ring, near)) & (second > alone) & (touch[:, 2] / 2 <= CONVERGES * first)
    found = known_place(rectangle_ring, near * rectangle_ring.radius_mm, NearEdges(far, 0.5), touch)
    np.testing.assert_array_equal(found, (first >= alone) | one)
    assert 0.1 < np.mean(one & (first < alone)) < np.mean(found) < 0.9
    np.testing.assert_array_equal(known_place(rectangle_ring, far * rectangle_ring.radius_mm, None, touch),
                                  first >= alone)


def test_touches_near_edges_leave_the_inner_ones_to_the_series() -> None:
    near, near_edge = np.linspace(0.0, 0.9, 91), np.linspace(0.0, 0.9, 91) > 0.6
    assert near_edges_of(near, np.zeros(91, bool)) == NearEdges(0.9, 0.9)
    found = near_edges_of(near, near_edge)
    assert found.far == 0.6
    assert found.inner == pytest.approx(0.6 * INNER)


def test_bounds_leave_the_gap_of_uniform_draws_but_not_towards_edges(ring: Ring, rectangle_ring: Ring) -> None:
    rng, count = np.random.default_rng(1), 50
    touch = np.column_stack([rng.uniform(-40, 40, (count, 2)), rng.uniform(10, 18, count), rng.uniform(0.1, 2, count)])
    for one, widened in ((ring, True), (rectangle_ring, False)):
        reached, (lowest, highest) = extent(one, touch), bounds_of(one, touch)
        span = np.ptp(reached, axis=0)
        np.testing.assert_allclose(highest - reached.max(axis=0), 2 / count * span * [widened, 1, 1], atol=1e-12)
        assert np.all(lowest >= reached.min(axis=0) / 2)
        assert within(one, np.array([lowest, highest]), None, touch).all()
    np.testing.assert_allclose(extent(rectangle_ring, touch)[:, 0] / rectangle_ring.radius_mm,
                               radial(rectangle_ring, touch))
