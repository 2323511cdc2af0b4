"""Touches in corners, strips and next to holes: circles about the punch cut where the outline cuts them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.harmonics.arcs import OffsetDisc, OffsetOutline, circles, harmonics_at, orders
from eitsim.mechanics.load_paths.build_table import build
from eitsim.mechanics.load_paths.rim_table import near_rim_from
from eitsim.mechanics.load_paths.several_edges import near_edges_from, summed_changes
from eitsim.mechanics.load_paths.table import shape_of, touch_from
from eitsim.mechanics.rim.correction import RimCorrection
from eitsim.mechanics.rim.solve_near_rim import COARSE, rim_change
from eitsim.scene.edges.outline import Outline
from eitsim.scene.nearest_edge import straight_edges
from eitsim.scene.scene import Body, Punch
from eitsim.sheet.sheet_conductance import changes
from eitsim.simulation.build_rim_table import Grid, build_rim
from eitsim.simulation.near_edges import solve_near_rim
from matcal.laws.hyperfoam import Hyperfoam

LAW = Hyperfoam([9530.0], [8.0], [0.0], "longterm")
BODY = Body()
PUNCH = Punch(diameter_m=0.014, force_N=0.5)


def outline(*loops: np.ndarray) -> OffsetOutline:
    """Closed polygons, the holes clockwise."""
    return OffsetOutline(np.vstack(loops), np.vstack([np.roll(loop, -1, axis=0) for loop in loops]))


def rectangle(left: float, right: float, down: float, up: float) -> np.ndarray:
    return np.array([[-left, -down], [right, -down], [right, up], [-left, up]])


def round_loop(radius: float, x: float, count: int = 400) -> np.ndarray:
    t = np.arange(count) / count * 2 * np.pi
    return np.column_stack([x + radius * np.cos(t), radius * np.sin(t)])


def turned(loop: np.ndarray, angle: float) -> np.ndarray:
    return loop @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def change(edge: OffsetOutline | OffsetDisc) -> RimCorrection:
    return rim_change(LAW, BODY, PUNCH, COARSE, edge)


@pytest.mark.parametrize("loops", [
    (rectangle(0.05, 0.008, 0.03, 0.02),),
    (rectangle(0.05, 0.02, 0.03, 0.02), round_loop(0.006, 0.01, 90)[::-1]),
    (np.array([[-0.03, -0.02], [0.06, -0.02], [0.06, 0.01], [0.01, 0.01], [0.01, 0.05], [-0.03, 0.05]]),)])
def test_parts_of_circles_add_up_to_the_area_and_its_moments(loops):
    """Sums over circles of 1, x and y against the polygon's, by the divergence theorem."""
    edge = outline(*loops)
    r = (np.arange(1000) + 0.5) / 1000 * 0.09
    angle, share = edge.sampled(r, 40)
    weight = share * 2 * np.pi * r[:, None] * (0.09 / 1000)
    found = [weight.sum(), np.sum(weight * r[:, None] * np.cos(angle)), np.sum(weight * r[:, None] * np.sin(angle))]
    (x, y), (u, v) = edge.start.T, edge.end.T
    cross = x * v - u * y
    known = [cross.sum() / 2, np.sum(cross * (x + u)) / 6, np.sum(cross * (y + v)) / 6]
    np.testing.assert_allclose(found, known, rtol=1e-3, atol=1e-5 * known[0])


def test_harmonics_are_orthonormal_and_the_second_of_each_order_is_a_quarter_period_on():
    angle = (np.arange(32) + 0.5)[None] / 32 * 2 * np.pi
    cosine, sine = (part[0] for part in harmonics_at(angle, 10, True))
    gram = cosine @ cosine.T / 32
    np.testing.assert_allclose(gram, np.diag([1.0, 0.0, *np.ones(8)]), atol=1e-12)
    m = orders(10, True)[2::2]
    for table in (cosine, sine):
        later = harmonics_at(np.broadcast_to(angle - np.pi / 2 / m[:, None], (len(m), 32)), 10, True)
        of = later[0] if table is cosine else later[1]
        for i in range(len(m)):
            np.testing.assert_allclose(table[3 + 2 * i], of[i, 2 + 2 * i], atol=1e-12)


def test_a_circle_that_nothing_cuts_is_whole():
    whole = circles(outline(rectangle(0.05, 0.05, 0.05, 0.05)), np.array([0.0, 0.01, 0.04]), 6, 12)
    assert not whole.cut.any()
    cut = circles(outline(rectangle(0.05, 0.05, 0.05, 0.05)), np.array([0.06, 0.08]), 6, 12)
    np.testing.assert_allclose(cut.inside, [1 - 4 * math.acos(5 / 6) / math.pi, 0.0], atol=1e-12)


@pytest.mark.slow
def test_one_straight_edge_is_the_rim_of_a_large_disc_at_any_bearing():
    """Half a turn, symmetric, and a whole one on an outline that is askew."""
    gap = 0.011
    rim = change(OffsetDisc(100.0, 100.0 - gap))
    for angle in (0.0, 0.7):
        edge = change(outline(turned(rectangle(0.3, gap, 0.3, 0.3), angle)))
        assert edge.depth_m == pytest.approx(rim.depth_m, rel=2e-3)
        assert edge.area == pytest.approx(rim.area, rel=2e-3)
        at = np.stack(np.meshgrid(np.linspace(-0.02, 0.005, 13), np.linspace(-0.02, 0.02, 15)), axis=-1).reshape(-1, 2)
        known, _ = changes(rim.field, at)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        found, _ = changes(edge.field, at @ turn.T)
        found = turn.T @ found @ turn
        assert np.sqrt(np.mean((found - known) ** 2)) < 0.03 * np.sqrt(np.mean((known - np.eye(2)) ** 2))


@pytest.mark.slow
def test_a_polygon_of_400_corners_is_the_disc():
    rim = change(OffsetDisc(0.05, 0.04))
    edge = change(outline(round_loop(0.05 / math.sqrt(np.sinc(2 / 400)), -0.04)))
    assert edge.depth_m == pytest.approx(rim.depth_m, rel=2e-3)


@pytest.mark.slow
def test_a_corner_adds_more_than_its_edges_and_is_symmetric_about_its_diagonal():
    one = change(outline(rectangle(0.3, 0.01, 0.3, 0.3))).depth_m
    corner = change(outline(rectangle(0.3, 0.01, 0.3, 0.01)))
    assert corner.depth_m > 2 * one
    at = np.array([[0.003, -0.008], [-0.012, 0.009], [0.005, -0.014]])
    found, _ = changes(corner.field, at)
    mirrored, _ = changes(corner.field, at[:, ::-1])
    np.testing.assert_allclose(mirrored, found[:, ::-1, ::-1], atol=1e-6)


@pytest.mark.thorough
def test_far_edges_add_up():
    """What two edges change, 1.4 and 1.7 thicknesses from the punch's edge, is their sum to a tenth, in a strip as in a
    corner."""
    near, far = 0.021, 0.024
    each = [change(OffsetDisc(100.0, 100.0 - gap)) for gap in (near, far)]
    at = np.array([[0.012, 0.002], [-0.012, 0.004], [0.0, 0.011], [0.016, -0.005], [0.003, 0.02]])
    for loop, other in ((rectangle(far, near, 0.3, 0.3), [-1.0, 0.0]), (rectangle(0.3, near, 0.3, far), [0.0, 1.0])):
        both, summed = change(outline(loop)), summed_changes(each, [np.array([1.0, 0.0]), np.array(other)])
        assert summed.depth_m == pytest.approx(both.depth_m, rel=0.1)
        known, found = changes(both.field, at)[0], changes(summed.field, at)[0]
        assert np.linalg.norm(found - known) < 0.1 * np.linalg.norm(known - np.eye(2))
        alone = changes(each[0].field, at)[0]
        assert np.linalg.norm(alone - known) > 0.15 * np.linalg.norm(known - np.eye(2))


RECTANGLE = Body(Outline("rectangle", width_m=0.12, height_m=0.08))


@pytest.mark.parametrize(("body", "place", "reach", "known"), [
    (RECTANGLE, (0.05, 0.03), 0.04, {(1, 0): 0.01, (0, 1): 0.01}),
    (RECTANGLE, (0.0, 0.0), 0.045, {(0, 1): 0.04, (0, -1): 0.04}),
    (RECTANGLE, (0.0, 0.0), 0.03, {}),
    (replace(RECTANGLE, edge=replace(RECTANGLE.outline, corner_radius_m=0.01)), (0.05, 0.03), 0.04, {}),
    (replace(RECTANGLE, edge=replace(RECTANGLE.outline, corner_radius_m=0.01)), (0.0, 0.03), 0.04, {(0, 1): 0.01}),
    (replace(RECTANGLE, edge=replace(RECTANGLE.outline, holes_m=((0.0, 0.0, 0.005),))),
     (0.0, 0.03), 0.02, {(0, 1): 0.01}),
    (replace(RECTANGLE, edge=replace(RECTANGLE.outline, holes_m=((0.0, 0.0, 0.005),))),
     (0.0, 0.03), 0.03, {}),
    (Body(Outline("polygon", points_m=((0, 0), (0.1, 0), (0.1, 0.04), (0.04, 0.04), (0.04, 0.1), (0, 0.1)))),
     (0.035, 0.035), 0.02, {}),
    (Body(Outline("polygon", points_m=((0, 0), (0.1, 0), (0.0, 0.1)))), (0.02, 0.02), 0.025, {(-1, 0): 0.02,
                                                                                          (0, -1): 0.02})])
def test_straight_edges_are_those_that_alone_bound_the_skin_about_a_place(body, place, reach, known):
    found = straight_edges(body.outline, place, reach)
    assert {tuple(np.round(towards, 6).tolist()): pytest.approx(away) for towards, away in found} == known


@pytest.mark.slow
def test_a_corner_from_a_table_of_one_straight_edge_is_that_solved_with_all_edges():
    """The depth to the stated error, where one edge alone misses a third of what the corner adds."""
    paths = build(shape_of(LAW, RECTANGLE, Punch()), depths=(0.055, 0.075, 0.1, 0.13))
    grid = Grid((0.6, 0.9, 1.2, 1.6), (0.06, 0.08, 0.1, 0.125), (0.6, 1.2, 1.6), (0.06, 0.1, 0.125))
    table = replace(paths, rim=build_rim(paths, grid=grid))
    punch = Punch(0.053 - 0.008, 0.033 - 0.011, 0.014, force_N=0.35)
    alone = touch_from(table, LAW, RECTANGLE, punch)
    assert alone is not None
    found, one = near_edges_from(table, alone, RECTANGLE, punch, 0.01), near_rim_from(table, alone, RECTANGLE, punch)
    assert found is not None
    assert one is not None
    assert found.rim is not None
    assert found.rim.error_estimate is not None
    assert np.all(found.rim.error_estimate >= 0.01)
    known = solve_near_rim(LAW, RECTANGLE, punch, all_edges=True)
    added = known.depth_m - alone.depth_m
    assert found.depth_m == pytest.approx(known.depth_m, abs=0.15 * added)
    assert known.depth_m - one.depth_m > 0.25 * added
    assert known.rim is not None
    at = np.stack(np.meshgrid(np.linspace(-0.02, 0.014, 12), np.linspace(-0.02, 0.017, 12)), axis=-1).reshape(-1, 2)
    true, found_at = changes(known.rim, at)[0], changes(found.rim, at)[0]
    assert np.linalg.norm(found_at - true) < 0.3 * np.linalg.norm(true - np.eye(2))
