"""Sweeps on curved skins: places are even over the area, rows repeat, and touches moved to a place are those solved
there."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import eitsim
from eitsim.mechanics.curved.moved_touches import MovedShape, solved_table
from eitsim.mechanics.curved.solve_on_surface import solve_on_surface
from eitsim.mechanics.general.layer import layer_surface
from eitsim.scene.curved.curved_scene import CurvedScene
from eitsim.scene.scene import Punch
from eitsim.scene.surfaces.cylinder import Cylinder
from eitsim.sweeps.design.card_draws import cards_for
from eitsim.sweeps.design.design import Design, design_from, read_design, scene_at, tables_at
from eitsim.sweeps.run import forecast
from eitsim.sweeps.run.moved_table_choice import moved_shape
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm")
CARD = MaterialCard("foam", FOAM, conductivity=Conductivity(30.0, np.array([-2.0, 2, -1]), (0, 0.4)))
FOREARM = Path(__file__).parents[3] / "examples/forearm.toml"
ARM = {"surface": "cylinder", "radius_mm": 45, "length_mm": 180, "thickness_mm": 8}
ELECTRODES = {"at_mm": [[x, y, z] for x in (-40, 40) for y, z in ((45, 0), (0, 45), (-45, 0), (0, -45))],
              "width_mm": 10}
BALL_RINGS = [[38 * np.cos(a), 38 * np.sin(a), 12 * up] for up in (1, -1) for a in np.pi / 2 * np.arange(4)]


def arm(**punch: object) -> Design:
    return design_from({"scenes": 400, "seed": 3, "body": ARM, "electrodes": ELECTRODES, "punch": punch})


def test_places_are_even_over_the_area_that_the_punch_may_touch() -> None:
    design = arm(diameter_mm=12, place={"gap_mm": 14})
    places = np.array([tables_at(design, k)["punch"][0]["at_mm"] for k in range(400)])
    np.testing.assert_allclose(np.hypot(places[:, 1], places[:, 2]), 45)
    x, angle = places[:, 0], np.arctan2(places[:, 1], places[:, 2])
    assert np.abs(x).max() <= 90 - 6 - 14
    assert np.abs(x).max() > 67
    for values, low, high in ((x, -70, 70), (angle, -np.pi, np.pi)):
        share = (np.sort(values) - low) / (high - low)
        assert np.abs(share - (np.arange(400) + 0.5) / 400).max() < 1.63 / 20  # Kolmogorov-Smirnov at 1 %
    scene = scene_at(design, 7)
    assert isinstance(scene, CurvedScene)
    np.testing.assert_allclose(1e3 * scene.places_m[0], places[7])
    assert scene.body is scene_at(design, 8).body


def test_listed_places_are_taken_to_the_surface_and_what_a_design_cannot_hold_is_named(tmp_path: Path) -> None:
    design = arm(at_mm={"list": [[0, 0, 46], [10, 44, 0]]}, force_N=1)
    assert [tables_at(design, k)["punch"][0]["at_mm"] for k in range(2)] == [[0, 0, 45], [10, 45, 0]]
    text = FOREARM.read_text(encoding="utf-8")
    (tmp_path / "design.toml").write_text("scenes = 5\n" + text, encoding="utf-8")
    assert scene_at(read_design(tmp_path / "design.toml"), 0).punches == scene_at(
        read_design(tmp_path / "design.toml"), 4).punches
    for punch, message in (({"place": {"within_mm": 3}}, "place in .* takes gap_mm alone on a curved skin"),
                           ({"place": {}, "at_mm": [0, 0, 45]}, None),
                           ({"place": {"gap_mm": 1}, "at_mm": [0, 0, 45]}, "both place and at_mm"),
                           ({"place": {"gap_mm": 90}}, "finds no place that keeps 90 mm"),
                           ({"at_mm": [0, 0]}, "must hold x, y and z of a place")):
        if message is None:
            arm(**punch)
        else:
            with pytest.raises(ValueError, match=message):
                arm(**punch)
    with pytest.raises(ValueError, match="one touch a scene"):
        design_from({"scenes": 2, "touches": 2, "body": ARM, "electrodes": ELECTRODES, "punch": {}})
    with pytest.raises(ValueError, match="lies on flat skins"):
        design_from({"scenes": 2, "fields": {}, "body": ARM, "electrodes": ELECTRODES, "punch": {}})


def test_a_plan_counts_the_touches_of_a_cylinders_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    times = {"cpu_s": 29.0, "mechanics_cpu_s": 26.0, "electrics_cpu_s": 2.5}
    row = {"outcome": "ok", "message": "", "dv_000": 0.0, **times}
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path))
    monkeypatch.setattr(forecast, "_some_rows", lambda design, cards: [row])
    design = arm(diameter_mm=12, force_N=[0.5, 1.5], place={"gap_mm": 14})
    expected = forecast.forecast(design, CARD, 2)
    nodes = len(moved_shape(design, cards_for(None, design.seed, CARD)).load_nodes)
    assert nodes > 1
    assert (expected.tables, expected.table_cpu_s) == (nodes, 26.0 * nodes)
    assert expected.wall_s == pytest.approx((26.0 * nodes + 400 * expected.row_cpu_s) / 2)
    assert expected.row_cpu_s < 4
    assert f"tables    {nodes} touches first, some" in "\n".join(forecast.lines(expected))


@pytest.mark.thorough
def test_rows_on_a_ball_have_the_readings_of_their_scenes(tmp_path: Path) -> None:
    design = design_from({"scenes": 2, "seed": 1, "body": {"surface": "sphere", "radius_mm": 40, "thickness_mm": 8},
                          "electrodes": {"at_mm": BALL_RINGS, "width_mm": 8}, "accuracy": {"signal": 0.02},
                          "punch": {"diameter_mm": 14, "force_N": [0.3, 0.6]}})
    data = eitsim.sweep(design, CARD, tmp_path)
    rows = data.ok
    assert len(rows) == 2
    np.testing.assert_allclose(np.linalg.norm(rows[["x_mm", "y_mm", "z_mm"]], axis=1), 40)
    alone = eitsim.simulate(scene_at(design, 1), CARD)
    assert alone.readings is not None
    signal = rows.loc[1, [name for name in rows if name.startswith("dv_")]].to_numpy(float)
    np.testing.assert_allclose(signal, alone.readings.signal_V.ravel(), rtol=1e-9, atol=1e-15)
    assert rows.loc[1, "F_N"] == pytest.approx(scene_at(design, 1).punches[0].force_N, rel=1e-12)


@pytest.mark.slow
def test_touches_between_the_loads_of_a_table_are_those_solved_anew() -> None:
    punch = Punch(profile="sphere", diameter_m=0.02, force_N=0.5)
    table = solved_table(MovedShape(FOAM, 0.045, 0.008, punch, "force_N", (0.3, 1.0), (0.02,), False))
    for force in (0.42, 0.8):
        pressed = replace(punch, force_N=force)
        assert table.serves(pressed)
        touch, field = table.touch(pressed)
        solution = solve_on_surface(FOAM, Cylinder(0.045, 0.5), 0.008, [pressed], np.array([[0.0, 0.0, 0.045]]))
        assert touch.depth_m == pytest.approx(solution.touches[0].depth_m, rel=2e-3)
        (group,) = solution.groups
        points, areas = layer_surface.surface_points(group.corrected.solved.field)
        for one, other, error in zip(*(layer_surface.nominal_moments(each, points, areas)
                                       for each in (field, group.field)), touch.signal_errors, strict=True):
            assert np.linalg.norm(one - other) < max(error, 0.02) * np.linalg.norm(other)
    assert not table.serves(replace(punch, force_N=1.2))
    assert not table.serves(replace(punch, diameter_m=0.018))
    assert not table.serves(replace(punch, tilt_rad=0.1))
