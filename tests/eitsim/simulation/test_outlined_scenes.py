"""Scenes with an outline: solved whole where edges are far, refused by name near them and where only discs serve."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from eitsim.scene.scene import Accuracy, Body, Drive, Electrodes, Punch, Scene, rim_gap_m
from eitsim.sensors.calibration.calibrate import check_electrodes
from eitsim.sensors.inspection import inspect
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor
from eitsim.simulation.derivatives.readings import check_differentiable
from eitsim.simulation.plan import least_gap_m, make_plan, rim_effect
from eitsim.simulation.result_json import result_document
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from surrogate.data.sensor_ring import ring_of

CARD = MaterialCard("one", Hyperfoam([9530.0], [8.0], [0.0], "longterm"), None,
                    Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
SKIN = Body(thickness_m=0.005, outline="rectangle", width_m=0.12, height_m=0.08, holes_m=((-0.04, 0.0, 0.004),))
SCENE = Scene(SKIN, (Punch(0.01, 0.0, 0.01, force_N=0.2),), electrodes=Electrodes(count=16, width_m=0.008),
              accuracy=Accuracy(0.02))


def at(x_m: float, y_m: float, scene: Scene = SCENE) -> Scene:
    return replace(scene, punches=(replace(scene.punches[0], x_m=x_m, y_m=y_m),))


def test_a_touch_far_from_edges_is_that_of_the_disc_of_the_area():
    """The rim of that disc is no nearer than the edges, and what it changes is in the plan's bound."""
    found = simulate(SCENE, CARD)
    assert found.outcome == "ok", found.message
    assert found.readings is not None
    assert found.readings.method == "mesh"
    assert found.readings.signal_V.shape == (16, 13)
    assert found.error_estimate["signal"] < 0.02
    axisymmetric = next(d for d in found.plan.decisions if d.decision.startswith("mechanics axisymmetric"))
    assert "disc of the outline's area" in axisymmetric.reason
    alone = rim_effect(rim_gap_m(SKIN, SCENE.punches[0]), 0.005, "principal")
    assert 2 * alone < axisymmetric.error_bound < 3 * alone  # edges above and below, and askew
    wide = simulate(Scene(Body(0.2, 0.005), SCENE.punches, accuracy=SCENE.accuracy), CARD)
    own = found.touches[0].depth_error + axisymmetric.error_bound
    assert own < 5e-3
    assert found.touches[0].depth_m == pytest.approx(wide.touches[0].depth_m, rel=own)
    document = result_document(found, SCENE, CARD)
    assert document["scene"]["body"]["outline"] == "rectangle"


@pytest.mark.parametrize(("x_m", "y_m"), [(0.01, 0.03), (0.05, 0.0), (-0.03, 0.01)])
def test_a_touch_near_an_edge_or_a_hole_is_refused_with_the_gap_that_is_solved(x_m, y_m):
    refused = make_plan(at(x_m, y_m), CARD).refusal
    keep = least_gap_m(SCENE)
    assert "edges of outlines other than the disc are not solved yet" in refused
    assert f"a gap of {keep * 1e3:.0f} mm" in refused
    assert rim_gap_m(SKIN, at(x_m, y_m).punches[0]) < keep
    assert simulate(at(x_m, y_m), CARD).outcome == "refused"


def test_the_least_gap_parts_what_is_solved_from_what_is_not_in_a_corner():
    """There two edges are as near; along one edge a touch may lie nearer, between three it must keep more."""
    scene = replace(SCENE, body=replace(SKIN, width_m=0.4, height_m=0.4, holes_m=()))
    gap, edge = least_gap_m(scene), 0.2 - 0.005
    assert 2 * rim_effect(gap, 0.005, "principal") <= 0.01
    for shift, solved in ((1e-4, True), (-1e-3, False)):
        corner = edge - gap - shift
        assert (make_plan(at(corner, corner, scene), CARD).refusal == "") is solved
    assert make_plan(at(0.0, edge - gap + 1e-3, scene), CARD).refusal == ""
    strip = replace(SCENE, body=replace(SKIN, width_m=0.4, height_m=2 * (gap + 0.0051), holes_m=()))
    assert make_plan(at(0.0, 0.0, strip), CARD).refusal == ""
    assert "not solved yet" in make_plan(at(edge - gap - 1e-4, 0.0, strip), CARD).refusal


@pytest.mark.parametrize("y_m", [0.036, 0.06])
def test_a_punch_over_the_edge_is_refused(y_m):
    refused = make_plan(at(0.0, y_m), CARD).refusal
    assert "not solved yet" in refused
    assert "from the nearest edge of the skin" in refused
    assert "move the punch inwards to a gap of" in refused


def test_touches_near_each_other_are_refused_and_far_ones_solved():
    pair = (Punch(0.0, 0.0, 0.008, force_N=0.1), Punch(0.013, 0.0, 0.008, force_N=0.1))
    near = make_plan(replace(SCENE, punches=pair), CARD).refusal
    assert "touches near each other on outlines other than the disc are not solved yet" in near
    far = (Punch(-0.005, 0.0, 0.008, force_N=0.1), Punch(0.03, 0.0, 0.008, force_N=0.1))
    assert make_plan(replace(SCENE, punches=far), CARD).refusal == ""


def test_exact_says_that_edges_stay_left_out():
    plan = make_plan(SCENE, CARD, exact=True)
    assert plan.refusal == ""
    assert any("exact does not change it" in d.reason for d in plan.decisions if d.error_bound > 0)


def test_what_serves_discs_alone_says_so(tmp_path: Path):
    with pytest.raises(ValueError, match="skins with an outline in \\[body\\] are not learned yet"):
        ring_of(SCENE)
    with pytest.raises(ValueError, match="sensitivities are not built for skins with an outline"):
        check_differentiable(SCENE)
    sensor = Sensor(SCENE.body, SCENE.skin, SCENE.electrodes, Drive())
    with pytest.raises(ValueError, match="the instrument model is built for discs"):
        check_electrodes(sensor)
    frames = Recording(np.ones((3, 208)), np.arange(3.0), None, np.array(["", "", ""]), "voltage", tmp_path / "a.csv")
    with pytest.raises(ValueError, match="does not serve a skin with an outline"):
        inspect(frames, sensor)
