"""Scenes with an outline: solved far from edges and near one or several, refused by name where only discs serve."""

from dataclasses import replace
from typing import Any

import meshio
import numpy as np
import pytest

from eitsim.cli.output_files import OutputFiles, check_output_files
from eitsim.electrics.forward.sheet_fields import write_skin_vtu
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Outline
from eitsim.scene.edges.outline_electrodes import middles_m
from eitsim.scene.polygons import edge_distance_m
from eitsim.scene.results import Readings
from eitsim.scene.scene import Accuracy, Body, Electrodes, Punch, Scene, rim_gap_m
from eitsim.sheet.sheet_conductance import added_metric, touched_conductance
from eitsim.simulation.derivatives.readings import check_differentiable
from eitsim.simulation.edge_effects import least_gap_m, rim_effect
from eitsim.simulation.error_budget import explain_excess
from eitsim.simulation.foam_fields import write_vtu
from eitsim.simulation.near_edges import solve_near_rim
from eitsim.simulation.plan import make_plan
from eitsim.simulation.result_json import result_document
from eitsim.simulation.routes.route import Case
from eitsim.simulation.simulate import simulate, solve_scene
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

CARD = MaterialCard("one", Hyperfoam([9530.0], [8.0], [0.0], "longterm"), None,
                    Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
SKIN = Body(Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((-0.04, 0.0, 0.004),)), 0.005)
SCENE = Scene(SKIN, (Punch(0.01, 0.0, 0.01, force_N=0.2),), electrodes=Electrodes(count=16, width_m=0.008),
              accuracy=Accuracy(0.02))


def skin(**change: Any) -> Body:
    return replace(SKIN, edge=replace(SKIN.outline, **change))


SOFT = replace(SCENE, electrodes=replace(SCENE.electrodes, soft=True))


def at(x_m: float, y_m: float, scene: Scene = SCENE) -> Scene:
    return replace(scene, punches=(replace(scene.punches[0], x_m=x_m, y_m=y_m),))


def test_a_touch_far_from_edges_is_that_of_the_disc_of_the_area():
    """The rim of that disc is no nearer than the edges, and what it changes is in the plan's bound."""
    found = simulate(SCENE, CARD)
    assert found.outcome == "ok", found.message
    assert found.readings is not None
    assert found.readings.method == "multipole"
    assert any("its rings scatter" in made.decision for made in found.plan.decisions)
    assert found.readings.signal_V.shape == (16, 13)
    assert found.error_estimate["signal"] < 0.02
    axisymmetric = next(d for d in found.plan.decisions if d.decision.startswith("mechanics axisymmetric"))
    assert "disc of the outline's area" in axisymmetric.reason
    alone = rim_effect(rim_gap_m(SKIN, SCENE.punches[0]), 0.005, "principal")
    assert 2 * alone < axisymmetric.error_bound < 3 * alone  # edges above and below, and askew
    wide = simulate(Scene(Body(Disc(0.2), 0.005), SCENE.punches, accuracy=SCENE.accuracy), CARD)
    own = found.touches[0].depth_error + axisymmetric.error_bound
    assert own < 5e-3
    assert found.touches[0].depth_m == pytest.approx(wide.touches[0].depth_m, rel=own)
    document = result_document(found, SCENE, CARD)
    assert document["scene"]["body"]["outline"] == "rectangle"


@pytest.mark.slow
@pytest.mark.parametrize(("x_m", "y_m"), [(0.051, 0.031), (-0.03, 0.01)])
def test_a_touch_near_a_corner_or_a_hole_is_solved_with_all_edges(x_m, y_m):
    """The depth differs from that with the nearest edge alone by more than it is off, and the readings follow."""
    scene = replace(at(x_m, y_m), electrodes=replace(SCENE.electrodes, soft=True))
    assert rim_gap_m(SKIN, scene.punches[0]) < least_gap_m(SCENE)
    found = solve_scene(scene, CARD, bodies=False)
    assert found.outcome == "ok", found.message
    made = next(d for d in found.plan.decisions if "near several edges" in d.decision)
    assert made.error_bound < 0.01
    (touch,) = found.touches
    assert touch.rim is not None
    assert touch.rim.whole_turn
    one = solve_near_rim(CARD.hyperfoam, SKIN, scene.punches[0])
    assert abs(touch.depth_m / one.depth_m - 1) > one.depth_error
    assert found.error_estimate["signal"] < 0.15


@pytest.mark.slow
def test_a_touch_near_one_straight_edge_is_solved_in_three_dimensions():
    scene = at(0.01, 0.03, SOFT)
    found = solve_scene(scene, CARD, bodies=False)
    assert found.outcome == "ok", found.message
    edge = next(d for d in found.plan.decisions if d.decision.startswith("mechanics in three dimensions near one edge"))
    assert "5.0 mm from the nearest edge or hole of the skin, 1.0 thicknesses, taken as a straight one" in edge.reason
    assert edge.error_bound < 0.01 < rim_effect(0.005, 0.005, "principal")
    (touch,) = found.touches
    assert touch.rim is not None
    np.testing.assert_allclose(touch.rim.towards, [0.0, 1.0], atol=1e-12)
    wide = Body(Disc(2.0), 0.005)
    near = solve_near_rim(CARD.hyperfoam, wide, replace(scene.punches[0], x_m=1.99, y_m=0.0))
    assert touch.depth_m == pytest.approx(near.depth_m, rel=5e-4)
    added, by_rim = (one.depth_m - solve_touch(CARD.hyperfoam, body, scene.punches[0]).depth_m
                     for one, body in ((touch, SKIN), (near, wide)))
    assert added == pytest.approx(by_rim, rel=0.25)  # 0.2 % of the depth, which the meshes resolve to a fifth
    assert added > 1e-3 * touch.depth_m


@pytest.mark.slow
@pytest.mark.parametrize(("x_m", "y_m"), [(0.01, 0.03), (0.051, 0.031), (-0.03, 0.01)])
def test_fields_near_edges_are_those_that_the_electrics_sampled(x_m, y_m, tmp_path):
    """On the skin to rounding, in the foam to what its coarser mesh costs; and foam fills the skin up to the edge."""
    scene = at(x_m, y_m, SOFT)
    found = solve_scene(scene, CARD, bodies=False)
    pairs = tuple(zip(scene.punches, found.touches, strict=True))
    check_output_files(scene, OutputFiles(fields=tmp_path / "fields.vtu", skin=tmp_path / "skin.vtu"))
    write_vtu(found.touches[0], tmp_path / "fields.vtu")
    write_skin_vtu(scene, found.touches, CARD.conductivity, tmp_path / "skin.vtu", [0])
    skin = meshio.read(tmp_path / "skin.vtu")
    metric, _ = added_metric(skin.points[:, :2], pairs)
    largest = np.sqrt(np.linalg.eigvalsh(metric)[:, 1]) - 1
    np.testing.assert_allclose(skin.point_data["largest_in_plane_strain"], largest, atol=1e-9)
    sheet = touched_conductance(skin.points[:, :2], pairs, scene.skin, CARD.conductivity)
    written = skin.point_data["sheet_conductance_S"].reshape(-1, 3, 3)[:, :2, :2]
    np.testing.assert_allclose(written, sheet, rtol=1e-9, atol=1e-12)
    foam = meshio.read(tmp_path / "fields.vtu")
    assert foam.point_data["displacement_m"][:, 2].min() == pytest.approx(-found.touches[0].depth_m, rel=0.01)
    top = np.abs(foam.points[:, 2]) < 1e-12
    plane = foam.points[top, :2]
    assert edge_distance_m(SKIN.outline, plane).min() > -1e-4  # chords of the round hole
    gradient = foam.point_data["deformation_gradient"].reshape(-1, 3, 3)[top]
    own = (np.swapaxes(gradient, 1, 2) @ gradient)[:, :2, :2]
    metric, _ = added_metric(plane, pairs)
    away = np.linalg.norm(plane - [x_m, y_m], axis=1)
    under, outside = away < 0.004, (away > 0.0075) & (away < 0.02)  # about the punch's edge meshes differ
    alone, _ = added_metric(plane, ((scene.punches[0], replace(found.touches[0], rim=None)),))
    off, added = (np.sqrt(np.mean((one - metric)[outside] ** 2)) for one in (own, alone))
    print("strain of the foam's own mesh off, r.m.s.", off, "of what edges add", off / added)
    assert np.abs(own - metric)[under].max() < 0.01 * np.abs(metric - np.eye(2)).max()
    assert off < 0.5 * added


def test_the_least_gap_is_solved_in_a_corner_without_three_dimensions():
    """There two edges are as near; along one edge a touch may lie nearer."""
    scene = replace(SCENE, body=skin(width_m=0.4, height_m=0.4, holes_m=()))
    gap, edge = least_gap_m(scene), 0.2 - 0.005
    assert 2 * rim_effect(gap, 0.005, "principal") <= 0.01
    for shift, alone in ((1e-4, True), (-1e-3, False)):
        scene_at = at(edge - gap - shift, edge - gap - shift, scene)
        assert make_plan(scene_at, CARD).refusal == ""
        assert Case(scene_at).near is not alone
    assert not Case(at(0.0, edge - gap + 1e-3, scene)).near
    deep = edge - gap + 6e-3
    assert make_plan(at(0.0, deep, scene), CARD).refusal == ""
    corner = make_plan(at(deep, deep, scene), CARD)
    assert corner.refusal == ""
    assert any("near several edges" in d.decision for d in corner.decisions)


def test_electrodes_cost_by_the_gap_to_the_nearest():
    """Those along the outer edge little next to a hole far from it, pads by where they lie."""
    hole = replace(SCENE, body=skin(width_m=0.2, height_m=0.2, holes_m=((0.0, 0.0, 0.005),)))
    assert Case(at(0.013, 0.0, hole)).near
    assert Case(at(0.013, 0.0, hole)).by_electrodes < 1e-4 < 0.1 < Case(at(0.0, 0.092, hole)).by_electrodes
    pads = Electrodes(count=4, kind="surface", x_m=(-0.05, 0.05, 0.05, -0.05), y_m=(-0.05, -0.05, 0.05, 0.05),
                      width_m=0.004)
    costs = [Case(at(x, x, replace(hole, electrodes=pads))).by_electrodes for x in (0.02, 0.035, 0.05)]
    assert costs[0] < costs[1] < costs[2] == Case(at(0.051, 0.05, replace(hole, electrodes=pads))).by_electrodes


def test_a_note_says_what_to_write_where_electrodes_give_way():
    plan, one_V = make_plan(at(0.01, 0.03), CARD, bodies=False), np.ones((1, 1))
    readings = Readings(one_V, one_V, one_V, one_V, 0.0, 0.0, 0, 0.0)
    note = explain_excess(0.02, 0.3, 0.01, plan, readings)
    assert note.endswith("most of that \"electrodes do not stiffen the layer\". Where yours give way, as paint, foil "
                         "and thin wires do, write soft = true in [electrodes].")
    soft = make_plan(replace(at(0.01, 0.03), electrodes=replace(SCENE.electrodes, soft=True)), CARD)
    assert "soft = true" not in explain_excess(0.02, 0.3, 0.01, soft, readings)
    assert explain_excess(0.3, 0.3, 0.01, plan, readings) == ""


@pytest.mark.parametrize("y_m", [0.036, 0.06])
def test_a_punch_over_the_edge_is_refused(y_m):
    refused = make_plan(at(0.0, y_m), CARD).refusal
    assert "the nearest edge of the skin; change x_mm and y_mm so that the punch lies" in refused
    assert "mm further onto the skin" in refused


def test_a_punch_wider_than_the_skin_is_not_sent_elsewhere():
    wide = replace(SCENE, punches=[Punch(0.0, 0.0, 0.3, force_N=1.0)])
    assert "so that it fits nowhere" in make_plan(wide, CARD).refusal


PAIR = (Punch(0.0, 0.0, 0.008, force_N=0.1), Punch(0.013, 0.0, 0.008, force_N=0.1))


def test_touches_near_each_other_are_solved_together_and_next_to_an_edge_with_all_edges():
    assert make_plan(replace(SCENE, punches=PAIR), CARD).refusal == ""
    askew = tuple(replace(punch, x_m=punch.x_m - 0.006, y_m=0.03) for punch in PAIR)
    plan = make_plan(replace(SOFT, punches=askew), CARD)
    assert plan.refusal == ""
    made = [d.decision.split(",")[0] for d in plan.decisions if "three dimensions" in d.decision]
    assert made == ["mechanics in three dimensions near several edges"] * 2 + [
        "touches 1 and 2 solved together in three dimensions"]
    stiff = [d.kind for d in make_plan(replace(SCENE, punches=askew), CARD).decisions]
    assert stiff.count("general") == 3
    far = (Punch(-0.005, 0.0, 0.008, force_N=0.1), Punch(0.03, 0.0, 0.008, force_N=0.1))
    assert make_plan(replace(SCENE, punches=far), CARD).refusal == ""
    stuck = tuple(replace(punch, friction="stick") for punch in askew)
    made = [d.kind for d in make_plan(replace(SCENE, punches=stuck), CARD).decisions]
    assert made.count("general") == 3


@pytest.mark.slow
def test_touches_near_each_other_and_an_edge_give_readings():
    """A pair along the upper edge, symmetric about x = 0, in what it does and what is read of opposite electrodes."""
    pair = tuple(Punch(x, 0.03, 0.008, force_N=0.1) for x in (-0.0065, 0.0065))
    body = skin(holes_m=())
    scene = replace(SCENE, body=body, punches=pair, electrodes=replace(SCENE.electrodes, soft=True))
    found = simulate(scene, CARD)
    assert found.outcome == "ok", found.message
    assert found.readings is not None
    one, other = found.touches
    assert one.depth_m == pytest.approx(other.depth_m, rel=1e-6)
    near = solve_near_rim(CARD.hyperfoam, body, pair[0]).depth_m
    assert 1e-4 < abs(one.depth_m / near - 1) < 0.05
    assert found.error_estimate["signal"] < 0.04
    z = found.readings.impedance_Ohm
    middles = middles_m(body.outline, scene.electrodes)
    mirror = [int(np.argmin(np.linalg.norm(middles - at * [-1, 1], axis=1))) for at in middles]
    assert np.linalg.norm(z[np.ix_(mirror, mirror)] - z) < 1e-3 * np.linalg.norm(z)


@pytest.mark.slow
def test_touches_near_each_other_on_a_polygon_of_400_corners_are_those_on_the_disc():
    turn = 2 * np.pi * (np.arange(400) + 0.5) / 400
    radius = 0.06 * np.sqrt(2 * np.pi / (400 * np.sin(2 * np.pi / 400)))
    corners = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    polygon = Body(Outline("polygon", points_m=tuple((x, y) for x, y in corners.tolist())), 0.005)
    pair = (PAIR[0], Punch(0.010, 0.006, 0.010, force_N=0.2))
    scene = Scene(Body(Disc(0.06), 0.005), pair, electrodes=Electrodes(count=16, width_m=0.008),
                  accuracy=Accuracy(0.02))
    disc, outlined = (simulate(replace(scene, body=body), CARD) for body in (scene.body, polygon))
    for found in (disc, outlined):
        assert found.outcome == "ok", found.message
        assert all(touch.rim is not None and touch.rim.neighbour for touch in found.touches)
    assert disc.readings is not None
    assert outlined.readings is not None
    for one, other in zip(disc.touches, outlined.touches, strict=True):
        assert other.depth_m == pytest.approx(one.depth_m, rel=1e-9)
        np.testing.assert_allclose(other.signal_errors, one.signal_errors, rtol=0.5)
    missed = np.linalg.norm(outlined.readings.signal_V - disc.readings.signal_V)
    assert missed < 1e-3 * np.linalg.norm(disc.readings.signal_V)


def test_exact_says_that_edges_stay_left_out():
    plan = make_plan(SCENE, CARD, exact=True)
    assert plan.refusal == ""
    assert any("exact does not change it" in d.reason for d in plan.decisions if d.error_bound > 0)


def test_derivatives_near_an_edge_say_what_to_do():
    check_differentiable(SCENE)
    with pytest.raises(ValueError, match=r"not built for a touch near the edge of an outline.* larger signal in"):
        check_differentiable(at(0.01, 0.03))


def test_derivatives_of_a_leaning_punch_are_refused():
    with pytest.raises(ValueError, match="a punch that leans or has a shape"):
        check_differentiable(Scene(punches=[Punch(diameter_m=0.014, force_N=1.0, tilt_rad=0.1)]))
