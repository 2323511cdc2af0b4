"""Two touches solved together: symmetry, balance, an independent reference, and where both ways meet."""

from functools import cache

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.rim.axis_transfer import cubics, view, view_all_around
from eitsim.mechanics.rim.interaction import clusters, interaction
from eitsim.mechanics.rim.solve_near_rim import COARSE, Resolution, on_two_meshes
from eitsim.scene.choices import Why
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, Scene, Skin, scene_from
from eitsim.sheet.sheet_conductance import surface_metric, touched_conductance
from eitsim.simulation.choose import choose_ways
from eitsim.simulation.near_edges import solved_together
from eitsim.simulation.plan import make_plan
from eitsim.simulation.routes import pair
from eitsim.simulation.routes.route import Case
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.choice import Choice

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])
LAW = Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4))
CARD = MaterialCard("Table 1", FOAM, None, LAW)
TINY, TINIEST = Resolution(12.0, 4, 9), Resolution(16.0, 3, 7)
# Depth added to a pair of 14 mm punches under 1 N by the neighbour, relative, by gap in mm: a patch of hexahedra whose
# end is the plane of symmetry between both (the signed values of test_neighbours.TOGETHER)
REFERENCE = {30: -3.7e-4, 20: -1.75e-3, 15: -3.2e-3, 10: -2.1e-3, 6: 1.11e-2}


@cache
def alone(punch: Punch) -> Touch:
    return solve_touch(FOAM, Body(), Punch(0.0, 0.0, punch.diameter_m, punch.force_N, depth_m=punch.depth_m))


@cache
def solved(one: Punch, other: Punch, coarse: Resolution = TINY, fine: Resolution = COARSE) -> tuple[Touch, Touch]:
    return solved_together((alone(one), alone(other)), FOAM, Body(), (one, other), coarse=coarse, fine=fine)


def equal(gap_mm: float, force_N: float = 1.0, turn: float = 0.0) -> tuple[Punch, Punch]:
    x, y = (7 + gap_mm / 2) / 1e3 * np.array([np.cos(turn), np.sin(turn)])
    return Punch(-x, -y, force_N=force_N), Punch(x, y, force_N=force_N)


UNEQUAL = Punch(-0.012, 0.004, 0.014, 0.6), Punch(0.006, -0.001, 0.010, 0.3)


def metric(points, punches, touches):
    found = [surface_metric(points, *touch)[0] for touch in zip(punches, touches, strict=True)]
    return found[0] + found[1] - np.eye(2)


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "change"), REFERENCE.items())
def test_depths_are_those_of_half_the_foam_before_a_plane_of_symmetry(gap, change):
    punches = equal(gap)
    found = solved(*punches)[0].depth_m / alone(punches[0]).depth_m - 1
    print(gap, found, change)
    assert found == pytest.approx(change, rel=0.3)


@pytest.mark.slow
def test_an_equal_pair_is_symmetric_however_it_lies():
    for turn in (0.0, 0.7):
        punches = equal(30, turn=turn)
        touches = solved(*punches, TINIEST, TINY)
        assert touches[0].depth_m == pytest.approx(touches[1].depth_m, rel=1e-8)
        points = np.random.default_rng(1).uniform(-0.03, 0.03, (200, 2))
        sheets = [touched_conductance(p, tuple(zip(punches, touches, strict=True)), Skin(), LAW)
                  for p in (points, -points)]
        np.testing.assert_allclose(sheets[0], sheets[1], rtol=1e-7)
    assert touches[0].depth_m == pytest.approx(solved(*equal(30), TINIEST, TINY)[0].depth_m, rel=1e-8)


SKIN = Body(Outline("rectangle", width_m=0.6, height_m=0.6), 0.01)


@cache
def on_skin(x_m: float, y_m: float, gap_m: float, turn: float, *, edges: bool) -> tuple[Touch, Touch]:
    way = (0.007 + gap_m / 2) * np.array([np.cos(turn), np.sin(turn)])
    pair = [Punch(x_m + side * way[0], y_m + side * way[1], force_N=0.3) for side in (-1, 1)]
    first, second = (solve_touch(FOAM, SKIN, punch) for punch in pair)
    return solved_together((first, second), FOAM, SKIN, pair, coarse=TINY, fine=COARSE, edges=edges)


@pytest.mark.slow
def test_far_from_edges_a_pair_with_all_edges_is_that_without():
    """All around the punches and without a symmetry, however the pair lies."""
    without = on_skin(0.0, 0.0, 0.01, 0.0, edges=False)
    base = solve_touch(FOAM, SKIN, Punch(force_N=0.3)).depth_m
    for turn, rel in ((0.0, 1e-6), (0.6, 0.02)):
        for found, own in zip(on_skin(0.0, 0.0, 0.01, turn, edges=True), without, strict=True):
            assert found.rim.whole_turn
            assert found.depth_m - base == pytest.approx(own.depth_m - base, rel=rel)
        pairs = on_skin(0.0, 0.0, 0.01, turn, edges=True)
        way = 0.012 * np.array([np.cos(turn), np.sin(turn)])
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        points = np.random.default_rng(4).uniform(-0.03, 0.03, (400, 2))
        sheets = [touched_conductance(at, tuple((Punch(*(side * w), force_N=0.3), touch) for side, touch in zip(
            (-1, 1), touches, strict=True)), Skin(), LAW) for at, w, touches in (
                (points, np.array([0.012, 0.0]), without), (points @ rotation.T, way, pairs))]
        turned = rotation @ sheets[0] @ rotation.T
        assert np.abs(sheets[1] - turned).max() < 0.01 * np.abs(turned).max()


@pytest.mark.slow
def test_near_an_edge_touches_far_from_each_other_are_those_alone_there():
    (one, _) = on_skin(0.0, 0.285, 0.06, 0.0, edges=True)
    punch = Punch(-0.037, 0.285, force_N=0.3)
    alone = solve_touch(FOAM, SKIN, punch)
    alone_there, base = on_two_meshes(alone, FOAM, SKIN, punch, coarse=TINY, fine=COARSE).touch, alone.depth_m
    print((one.depth_m - base) / base, (alone_there.depth_m - base) / base)
    assert one.depth_m - base == pytest.approx(alone_there.depth_m - base, rel=0.03)
    assert alone_there.depth_m > 1.001 * base


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, np.pi / 2])
def test_near_an_edge_both_frames_find_the_same_surface_between_the_punches(turn):
    """Along the edge, where the pair is symmetric, and across it."""
    gap, y = 0.008, 0.285 if turn == 0 else 0.275
    touches = on_skin(0.0, y, gap, turn, edges=True)
    way = np.array([np.cos(turn), np.sin(turn)])
    punches = [Punch(*(np.array([0.0, y]) + side * (0.007 + gap / 2) * way), force_N=0.3) for side in (-1, 1)]
    if turn == 0:
        assert touches[0].depth_m == pytest.approx(touches[1].depth_m, rel=1e-7)
    across = np.linspace(-0.014, 0.014, 41)[:, None] * np.array([-way[1], way[0]])
    one, other = (metric(np.array([0.0, y]) + across + side * 1e-7 * way, punches, touches) for side in (-1, 1))
    base = [solve_touch(FOAM, SKIN, punch) for punch in punches]
    added = one - metric(np.array([0.0, y]) + across, punches, base)
    print(np.linalg.norm(one - other) / np.linalg.norm(added), np.abs(added).max())
    assert np.linalg.norm(one - other) < 0.2 * np.linalg.norm(added)
    assert np.abs(added).max() > 1e-3


@pytest.mark.slow
def test_forces_are_kept_or_follow_a_given_depth():
    touches = solved(*UNEQUAL)
    assert [touch.force_N for touch in touches] == pytest.approx([0.6, 0.3], rel=1e-8)
    assert [touch.sigma_ave_Pa * touch.contact_area_m2 for touch in touches] == pytest.approx([0.6, 0.3], rel=1e-8)
    held = tuple(Punch(p.x_m, p.y_m, p.diameter_m, None, depth_m=touch.depth_m)
                 for p, touch in zip(UNEQUAL, touches, strict=True))
    again = solved(*held)
    assert [touch.depth_m for touch in again] == pytest.approx([touch.depth_m for touch in touches], rel=1e-8)
    print([touch.force_N for touch in again], [alone(punch).force_N for punch in held])
    assert [touch.force_N for touch in again] == pytest.approx([0.6, 0.3], rel=5e-4)
    assert all(abs(alone(punch).force_N / force - 1) > 2e-3 for punch, force in zip(held, (0.6, 0.3), strict=True))


@pytest.mark.slow
def test_both_frames_find_the_same_surface_between_the_punches():
    touches = solved(*UNEQUAL)
    assert touches[0].rim is not None
    towards = touches[0].rim.towards
    assert towards is not None
    middle = np.array([UNEQUAL[0].x_m, UNEQUAL[0].y_m]) + (
        0.007 + (np.hypot(0.018, 0.005) - 0.012) / 2) * towards
    across = np.array([-towards[1], towards[0]])
    points = middle + np.linspace(-0.02, 0.02, 41)[:, None] * across
    one, other = (metric(points + side * 1e-7 * towards, UNEQUAL, touches) for side in (-1, 1))
    added = one - metric(points, UNEQUAL, [alone(punch) for punch in UNEQUAL])
    print(np.abs(one - other).max(), np.abs(added).max(), np.linalg.norm(one - other) / np.linalg.norm(added))
    assert np.linalg.norm(one - other) < 0.2 * np.linalg.norm(added)
    assert np.abs(added).max() > 1e-3


def test_far_touches_are_those_alone_within_the_stated_bound():
    punches = equal(24, 0.5)
    touches = solved(*punches, TINIEST, TINY)
    bound = interaction(tuple((punch, alone(punch)) for punch in punches))
    change = abs(touches[0].depth_m / alone(punches[0]).depth_m - 1)
    print(change, bound)
    assert 1e-5 < change < bound["depth"]
    assert touches[0].depth_error < alone(punches[0]).depth_error + change


def test_what_neither_knows_is_refused():
    one, other = equal(10)
    for punches, why in (((one, Punch(other.x_m, friction="stick")), Why.PAIR_FRICTION), (equal(2.9), Why.PAIR_GAP),
                         ((*equal(10), Punch(0.06)), Why.MORE_THAN_TWO)):
        problem = pair.Pair().serves(Case(Scene(punches=punches), tuple(range(len(punches)))))
        assert isinstance(problem, Choice)
        assert problem.kind is why
    assert isinstance(pair.Pair().serves(Case(Scene(punches=(one, other)), (0, 1))), float)


def test_clusters_hold_those_that_matter_to_each_other():
    row = [Punch(x) for x in (-0.04, -0.02, 0.02, 0.04)]
    assert clusters(Body(), row, 0.03) == ((0, 1), (2, 3))
    assert clusters(Body(), row[:3], 1e-4) == ((0, 1, 2),)
    assert clusters(Body(), row[1:3], 0.03) == clusters(Body(), row[:1], 0.03) == ()


def test_the_plan_says_who_is_solved_together_and_who_cannot_be():
    close = [{"x_mm": 0}, {"x_mm": 22}]
    scene = scene_from({"punch": close})
    plan = make_plan(scene, CARD)
    assert not plan.refusal
    assert next(d.decision for d in plan.decisions if "touches" in d.decision) == (
        "touches 1 and 2 solved together in three dimensions")
    loose = scene_from({"punch": close, "accuracy": {"signal": 0.9}})
    assert choose_ways(loose)[1] == ()
    assert [way.case.touches for way in choose_ways(loose, exact=True)[1]] == [(0, 1)]
    for others in ([close[1] | {"friction": "stick"}], [close[1] | {"x_mm": 16}], [close[1], {"x_mm": -22}]):
        _, (together,) = choose_ways(scene_from({"punch": [close[0], *others]}))
        assert together.route.kind == "general"
    refusal = make_plan(scene_from({"punch": [close[0], close[1] | {"x_mm": 14.2}]}), CARD).refusal
    assert "from a gap of 0.3 mm on" in refusal
    assert "Leave 24 mm between them" in refusal
    at_rim = make_plan(scene_from({"punch": [{"x_mm": 68}, {"x_mm": 46}]}), CARD)
    assert not at_rim.refusal
    near = [d.decision for d in at_rim.decisions if d.decision.startswith(("mechanics in three", "touches 1 and 2"))]
    assert near == ["mechanics in three dimensions about the touch"] * 2 + [
        "touches 1 and 2 solved together in three dimensions"]
    separation = make_plan(scene_from({"punch": [*close, {"x_mm": -48}]}), CARD)
    assert not separation.refusal
    assert sum("solved" in d.decision and "touches" in d.decision for d in separation.decisions) == 2


@pytest.mark.slow
def test_a_scene_of_two_close_touches_gives_readings(monkeypatch):
    monkeypatch.setattr(pair, "COARSE", TINY)
    monkeypatch.setattr(pair, "FINE", COARSE)
    raw = [{"x_mm": -11, "force_N": 0.15}, {"x_mm": 11, "force_N": 0.15}]
    scene = scene_from({"punch": raw})
    result = simulate(scene, CARD)
    simple = simulate(scene_from({"punch": raw, "accuracy": {"signal": 0.9}}), CARD)
    assert result.readings is not None
    assert simple.readings is not None
    assert (result.outcome, result.readings.method) == ("ok", "mesh")
    assert result.interaction == {"signal": 0, "depth": 0, "strain": 0}
    assert result.touches[0].depth_m != simple.touches[0].depth_m
    missed = np.linalg.norm(result.readings.signal_V - simple.readings.signal_V)
    missed /= np.linalg.norm(result.readings.signal_V)
    print("signal changes by", missed, result.error_estimate, simple.interaction)
    assert result.error_estimate["signal"] < 0.01
    assert missed < simple.interaction["signal"] + result.error_estimate["signal"]


def test_a_field_is_the_same_from_either_axis():
    columns, rows = np.linspace(0, 6, 121), np.linspace(-1, 0, 41)
    r, z = np.meshgrid(columns, rows, indexing="ij")
    # harmonics 0 and 1: u = (x + z, 0, x z) about the other axis, in its mirrored frame
    amplitude = np.zeros((r.size, 3, 3))
    amplitude[:, 0, 0], amplitude[:, 0, 2] = r.ravel() / 2, r.ravel() / 8**0.5
    amplitude[:, 1, 2] = -r.ravel() / 8**0.5
    amplitude[:, 0, 1], amplitude[:, 1, 1] = z.ravel() / 2**0.5, -z.ravel() / 2**0.5
    amplitude[:, 2, 1] = (r * z).ravel() / 2**0.5
    rng = np.random.default_rng(2)
    radius, angle, height = rng.uniform(0, 1.2, 50), rng.uniform(0, np.pi, 50), rng.uniform(-1, 0, 50)
    seen = view(columns, rows, 3, 2.5, radius, angle, height)
    x = 2.5 - radius * np.cos(angle)
    turn = np.array([[np.cos(angle), np.sin(angle), 0 * angle], [-np.sin(angle), np.cos(angle), 0 * angle],
                     [0 * angle, 0 * angle, 0 * angle + 1]]).transpose(2, 0, 1)
    moved = np.column_stack([-(x + height), 0 * x, x * height])
    np.testing.assert_allclose(seen.displacement(amplitude), np.einsum("nij,nj->ni", turn, moved), atol=1e-12)
    slope = np.zeros((50, 3, 3))
    slope[:, 0, 0], slope[:, 0, 2], slope[:, 2, 0], slope[:, 2, 2] = 1, -1, -height, x
    want = turn @ slope @ turn.transpose(0, 2, 1)
    np.testing.assert_allclose(seen.gradient(amplitude), want.reshape(-1, 9), atol=1e-11)


def test_a_field_is_the_same_from_either_axis_all_around():
    """u = (x + z, 2 y, x z) about the other axis, by harmonics of a whole turn."""
    columns, rows = np.linspace(0, 6, 121), np.linspace(-1, 0, 41)
    r, z = np.meshgrid(columns, rows, indexing="ij")
    amplitude = np.zeros((r.size, 3, 6))
    # (1 +- 2)/2 r of order 0 and 2, z of order 1; order 2 of u_theta is that of sin 2t with the same sign as in u_r
    amplitude[:, 0, 0], amplitude[:, 0, 4] = 1.5 * r.ravel(), -r.ravel() / 8**0.5
    amplitude[:, 1, 4] = r.ravel() / 8**0.5
    amplitude[:, 0, 2], amplitude[:, 1, 2] = z.ravel() / 2**0.5, -z.ravel() / 2**0.5
    amplitude[:, 2, 2] = (r * z).ravel() / 2**0.5
    rng = np.random.default_rng(2)
    radius, angle, height = rng.uniform(0.1, 1.2, 50), rng.uniform(0, 2 * np.pi, 50), rng.uniform(-1, 0, 50)
    other = np.array([1.5, -2.0])
    seen = view_all_around(columns, rows, 6, other, radius, angle, height)
    x, y = radius * np.cos(angle) - other[0], radius * np.sin(angle) - other[1]
    turn = np.array([[np.cos(angle), np.sin(angle), 0 * angle], [-np.sin(angle), np.cos(angle), 0 * angle],
                     [0 * angle, 0 * angle, 0 * angle + 1]]).transpose(2, 0, 1)
    moved = np.column_stack([x + height, 2 * y, x * height])
    np.testing.assert_allclose(seen.displacement(amplitude), np.einsum("nij,nj->ni", turn, moved), atol=1e-12)
    slope = np.zeros((50, 3, 3))
    slope[:, 0, 0], slope[:, 0, 2], slope[:, 1, 1], slope[:, 2, 0], slope[:, 2, 2] = 1, 1, 2, height, x
    want = turn @ slope @ turn.transpose(0, 2, 1)
    np.testing.assert_allclose(seen.gradient(amplitude), want.reshape(-1, 9), atol=1e-11)


def test_cubics_are_exact_for_cubics_on_any_line():
    line = np.sort(np.random.default_rng(3).uniform(0, 1, 9))
    at = np.linspace(line[0], line[-1], 30)
    first, value, slope = cubics(line, at)
    nodes = line[first[:, None] + np.arange(4)]
    np.testing.assert_allclose(np.sum(value * nodes**3, axis=1), at**3, atol=1e-12)
    np.testing.assert_allclose(np.sum(slope * nodes**3, axis=1), 3 * at**2, atol=1e-10)
