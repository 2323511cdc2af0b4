"""Skins that answer presses: the simulator as it solves scenes, within what tables hold; and the learned map."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import eitsim
import matcal
import surrogate
from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.mechanics.load_paths import build_table
from eitsim.mechanics.load_paths.build_table import build
from eitsim.mechanics.load_paths.table import shape_of
from eitsim.mechanics.load_paths.types import Table
from eitsim.sheet.sheet_conductance import untouched_conductance
from eitsim.simulation.material import material_of
from surrogate.live.controls import Controls
from surrogate.live.skins import FIELDS, SimulatedSkin, learned_skin, limits_of, simulated_skin

CARD = matcal.MaterialCard("foam", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
SCENE = eitsim.Scene(accuracy=eitsim.Accuracy(0.05))


@pytest.fixture(scope="module")
def table() -> Table:
    """Shallow load paths of a punch of 14 mm, whose error comes from a few touches."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build_table, "_CHECKS", 4)
        return build(shape_of(CARD.hyperfoam, SCENE.body, eitsim.Punch(diameter_m=0.014)), depths=(0.06, 0.075, 0.09))


@pytest.fixture(scope="module")
def skin(table: Table) -> SimulatedSkin:
    material = material_of(SCENE, CARD)
    baseline = untouched_readings(SCENE, untouched_conductance(material.skin, SCENE.skin))
    return SimulatedSkin(SCENE, material, table, baseline)


@pytest.mark.thorough
def test_a_press_is_answered_as_the_simulator_answers(skin: SimulatedSkin) -> None:
    found = skin.pressed(Controls(12.0, -20.0, 14.0, 0.3))
    punch = eitsim.Punch(x_m=0.012, y_m=-0.02, diameter_m=0.014, force_N=0.3)
    solved = eitsim.simulate(replace(SCENE, punches=(punch,)), CARD)
    signal = solved.readings.signal_V.ravel()
    assert found.problem == ""
    assert np.linalg.norm(found.signal_V - signal) < 0.01 * np.linalg.norm(signal)
    assert np.allclose(skin.baseline_V, solved.readings.baseline_V.ravel(), rtol=1e-9)
    assert found.fields["reach_mm"] == 6 * 7
    for name in FIELDS:
        parts = np.array(found.fields[name]["parts"])
        assert np.abs(parts).max() == 1
        assert abs(parts[-1]) < 0.05  # little is left at the end of the profile
    assert 0.01 < found.fields["strain"]["largest"] < 1


@pytest.mark.slow
def test_a_press_on_a_rectangle_is_answered_as_the_simulator_answers() -> None:
    scene = replace(SCENE, body=replace(SCENE.body, edge=eitsim.Outline("rectangle", width_m=0.2, height_m=0.15)),
                    electrodes=eitsim.Electrodes(count=8, width_m=0.02))
    material, kind = material_of(scene, CARD), eitsim.Punch(diameter_m=0.014)
    table = build(shape_of(CARD.hyperfoam, scene.body, kind), depths=(0.055, 0.075, 0.1))
    skin = SimulatedSkin(scene, material, table,
                         untouched_readings(scene, untouched_conductance(material.skin, scene.skin)))
    found = skin.pressed(Controls(-20.0, 12.0, 14.0, 0.3))
    punch = eitsim.Punch(x_m=-0.02, y_m=0.012, diameter_m=0.014, force_N=0.3)
    solved = eitsim.simulate(replace(scene, punches=(punch,)), CARD)
    assert solved.readings is not None
    signal = solved.readings.signal_V.ravel()
    assert found.problem == ""
    assert np.linalg.norm(found.signal_V - signal) < 0.01 * np.linalg.norm(signal)
    assert set(FIELDS) < set(found.fields)
    assert "too close to the nearest edge" in skin.pressed(Controls(0.0, 60.0, 14.0, 0.3)).problem


@pytest.mark.parametrize(("press", "why"), [((0.0, 0.0, 14.0, 40.0), "too deep"),
                                            ((92.0, 0.0, 14.0, 0.3), "rim"), ((0.0, 0.0, 14.0, 0.01), "light")])
def test_a_press_that_no_table_serves_is_named_at_once(skin: SimulatedSkin, press: tuple[float, ...], why: str) -> None:
    found = skin.pressed(Controls(*press))
    assert why in found.problem
    assert not found.signal_V.any()


def test_the_simulated_sensor_is_that_of_the_model(inner_model: surrogate.Model, skin: SimulatedSkin, table: Table,
                                                   tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    matcal.write_card(CARD, tmp_path / "card.json")
    asked: list[Any] = []
    monkeypatch.setattr("surrogate.live.skins.table_for", lambda shape, run: (asked.append(shape), (table, ""))[1])
    with pytest.raises(ValueError, match="differ by"):
        simulated_skin(replace(inner_model, baseline_V=2 * skin.baseline_V), tmp_path / "card.json")
    (tmp_path / "scene.toml").write_text("[electrodes]\ncount = 8\n")
    model = replace(inner_model, baseline_V=skin.baseline_V)
    with pytest.raises(ValueError, match="not those that the model was trained on"):
        simulated_skin(model, tmp_path / "card.json", scene_path=tmp_path / "scene.toml")
    assert not asked
    found = simulated_skin(model, tmp_path / "card.json")
    assert np.allclose(found.baseline_V, skin.baseline_V, rtol=1e-12)
    assert asked[0].spans  # diameters vary
    assert np.array(asked[0].diameters) * 10 == pytest.approx([limits_of(model).diameters_mm[k] for k in (0, -1)])


def test_the_learned_skin_answers_a_row_of_its_training(inner_model: surrogate.Model) -> None:
    k = int(np.argmax(np.linalg.norm(inner_model.calibration.signal_V, axis=1)))
    touch, signal = inner_model.calibration.target[k, :4].tolist(), inner_model.calibration.signal_V[k]
    found = learned_skin(inner_model).pressed(Controls(*touch))
    assert np.linalg.norm(found.signal_V - signal) < 0.02 * np.linalg.norm(signal)


def test_what_may_be_pressed_is_what_was_trained(inner_model: surrogate.Model) -> None:
    limits, target = limits_of(inner_model), inner_model.calibration.target
    assert np.hypot(*target[:, :2].T).max() <= 100 - limits.gap_mm <= 100
    assert limits.start_mm == (0.0, 0.0)
    assert limits.force_N == inner_model.trained.highest[3]
    assert list(limits.diameters_mm) == sorted(limits.diameters_mm)
    assert limits.diameters_mm[-1] == pytest.approx(inner_model.trained.highest[2])
    with pytest.raises(ValueError, match="does not read d, F"):
        limits_of(replace(inner_model, names=("x0", "y0")))
