"""Places to press next: what they promise is what a refit finds, they spread, and the command names them."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from eitsim.sensors.sensor_file import read_sensor
from surrogate.cli.main import app
from surrogate.recordings import networks, templates
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.pattern_process import matern
from surrogate.recordings.physics.expectation import expectation_of
from surrogate.recordings.suggestion.next_presses import LENGTH, NOISE, SHARE, next_presses
from touchcal.arrays import Array

from .conftest import synthetic_places, synthetic_presses, synthetic_signal

RADIUS = 50.0
NONE = np.empty((0, 2))


def disc(count: int, radius: float) -> Array:
    """Places (n, 2) of a square grid over a disc."""
    axis = np.linspace(-radius, radius, count)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    return grid[np.linalg.norm(grid, axis=1) <= radius]


def variance(pressed: Array) -> float:
    """Mean variance of the map over the disc after presses, by its definition."""
    there, length = disc(61, SHARE * RADIUS), LENGTH * RADIUS
    shared = matern(there, pressed, length)
    known = matern(pressed, pressed, length) + NOISE * np.eye(len(pressed))
    return float(1 - np.mean(np.sum(shared * np.linalg.solve(known, shared.T).T, axis=1)))


def test_gains_are_what_presses_take_from_the_variance() -> None:
    first = np.array([[10.0, 20.0], [-30.0, 5.0]])
    found = next_presses(RADIUS, first, 6)
    after = [variance(np.vstack([first, found.place[:count]])) for count in range(7)]
    np.testing.assert_allclose(found.gain, -np.diff(after), rtol=0.05)
    assert np.all(np.diff(found.gain) < 1e-9)


def test_a_suggested_press_gains_more_than_any_of_many_others() -> None:
    first = np.array([[10.0, 20.0], [-30.0, 5.0]])
    found = next_presses(RADIUS, first, 1)
    others = [variance(np.vstack([first, one])) for one in disc(13, SHARE * RADIUS)[:, None]]
    assert variance(np.vstack([first, found.place])) < min(others) + 1e-3


def test_presses_spread_over_the_body_and_avoid_those_before() -> None:
    found = next_presses(RADIUS, NONE, 20)
    assert np.linalg.norm(found.place, axis=1).max() <= SHARE * RADIUS * 1.001
    between = np.linalg.norm(found.place[:, None] - found.place, axis=-1) + 1e3 * np.eye(20)
    assert between.min() > 0.2 * RADIUS
    left = disc(20, SHARE * RADIUS)
    left = left[left[:, 0] < 0]
    assert np.all(next_presses(RADIUS, left, 4).place[:, 0] > 0)


def test_labels_outside_the_body_about_the_origin_say_where_it_lies() -> None:
    middle = np.array([400.0, -100.0])
    found = next_presses(RADIUS, middle + np.array([[-40.0, 10.0], [40.0, -10.0], [0.0, 41.0], [5.0, -41.0]]), 3)
    np.testing.assert_allclose(found.middle, middle)
    assert np.linalg.norm(found.place - middle, axis=1).max() <= SHARE * RADIUS * 1.001


@pytest.mark.parametrize("pressed", [[[101.0, 0.0], [90.0, 0.0]], [[150.0, 150.0], [160.0, 140.0]]])
def test_labels_outside_the_body_that_do_not_say_where_it_lies_are_refused(pressed: list[list[float]]) -> None:
    with pytest.raises(ValueError, match=r"the press at \(1.*\) mm lies outside the body, of radius 100 mm"):
        next_presses(100.0, np.array(pressed), 3)


def test_more_places_than_are_compared_are_refused() -> None:
    with pytest.raises(ValueError, match="100000 places to press next; ask for 1 to"):
        next_presses(RADIUS, NONE, 100000)


@pytest.mark.slow
def test_suggested_presses_teach_more_than_random_ones() -> None:
    rng = np.random.default_rng(5)
    tested = synthetic_places(rng, 200)
    asked = next_presses(60 / SHARE, NONE, 15).place
    miss: list[list[float]] = [[], []]
    for turn in range(4):
        c, s = np.cos(turn), np.sin(turn)
        for place, errors in zip((asked @ np.array([[c, -s], [s, c]]), synthetic_places(rng, 15)), miss, strict=True):
            signal = synthetic_signal(place, np.ones(15))
            signal += 0.1 * np.abs(signal).mean() * rng.standard_normal(signal.shape)
            fitted = templates.fit(signal, place, time_blocks(15), compress=False).templates
            read = fitted.read(synthetic_signal(tested, np.ones(200)))[0]
            errors.append(float(np.linalg.norm(read - tested, axis=1).mean()))
    assert np.mean(miss[0]) < 0.8 * np.mean(miss[1])


def written(folder: Path, count: int) -> list[str]:
    """A synthetic recording with labels of its first `count` presses, and the arguments that train on it."""
    presses, place = synthetic_presses(9, 30)
    frames = pd.DataFrame(presses.signal, columns=[f"v_{k:03d}" for k in range(presses.signal.shape[1])])
    frames.insert(0, "touch", presses.name)
    frames.to_csv(folder / "frames.csv", index=False)
    pd.DataFrame({"touch": presses.name, "x_mm": place[:, 0], "y_mm": place[:, 1]}).iloc[:count].to_csv(
        folder / "touches.csv", index=False)
    (folder / "sensor.toml").write_text('[readings]\nkind = "difference"\n')
    return ["train", f"{folder}/frames.csv", "--labels", f"{folder}/touches.csv", "--sensor", f"{folder}/sensor.toml",
            "--out", f"{folder}/model", "--workers", "1"]


def test_the_command_suggests_before_the_first_press_and_after_few(tmp_path: Path) -> None:
    arguments, run = written(tmp_path, 4), CliRunner()
    first = run.invoke(app, ["train", "none.csv", "--sensor", f"{tmp_path}/sensor.toml", "--out", f"{tmp_path}/model",
                             "--suggest", "5"])
    assert first.exit_code == 0, first.output
    assert "no model is trained yet" in first.output
    table = pd.read_csv(tmp_path / "model" / "suggested.csv")
    assert [*table] == ["x_mm", "y_mm", "expected_gain"]
    np.testing.assert_allclose(table.to_numpy()[:, :2], next_presses(100, NONE, 5).place, rtol=1e-5)
    few = run.invoke(app, [*arguments, "--suggest", "3", "--json"])
    assert few.exit_code == 0, few.output
    said = json.loads(few.output)
    assert (said["presses"], said["model"], said["earlier_model"], len(said["suggested"])) == (4, None, None, 3)
    (tmp_path / "model" / "model.json").write_text("{}")
    again = run.invoke(app, [*arguments, "--suggest", "3", "--json"])
    assert json.loads(again.output)["earlier_model"] == f"{tmp_path}/model"
    said = run.invoke(app, [*arguments, "--suggest", "3"]).output
    assert "that of an earlier training stays in" in said
    refused = run.invoke(app, arguments)
    assert "4 labelled presses are too few" in str(refused.exception)


def test_a_recording_that_cannot_be_read_leaves_no_folder(tmp_path: Path) -> None:
    arguments = written(tmp_path, 14)
    (tmp_path / "frames.csv").unlink()
    failed = CliRunner().invoke(app, [*arguments, "--suggest", "3"])
    assert "frames.csv" in str(failed.exception)
    assert not (tmp_path / "model").exists()


def test_sweeps_are_refused_where_labels_have_no_place(tmp_path: Path) -> None:
    arguments = written(tmp_path, 14)
    labels = pd.read_csv(tmp_path / "touches.csv").rename(columns={"x_mm": "depth_mm"})
    labels.to_csv(tmp_path / "touches.csv", index=False)
    refused = CliRunner().invoke(app, [*arguments, "--simulated", f"{tmp_path}"])
    assert "--simulated says how patterns depend on the place" in str(refused.exception)


@pytest.mark.thorough
def test_on_a_body_that_is_no_disc_nothing_is_expected_or_suggested(tmp_path: Path,
                                                                    monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(networks, "MOST_STEPS", 40)
    monkeypatch.setattr(networks, "HIDDEN", (32,))
    arguments, run = written(tmp_path, 11), CliRunner()
    (tmp_path / "sensor.toml").write_text('[body]\noutline = "rectangle"\nwidth_mm = 300\nheight_mm = 60\n'
                                          '[readings]\nkind = "difference"\n')
    for further in (["--suggest", "3"], ["--simulated", f"{tmp_path}"]):
        refused = run.invoke(app, [*arguments, *further])
        assert "are for discs, and the body of" in str(refused.exception)
    done = run.invoke(app, [*arguments, "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.output)["left_out"][-1] == "The body is no disc, so that no model of the sensor is used."
    with pytest.raises(ValueError, match="the body has the outline 'rectangle'"):
        expectation_of(read_sensor(tmp_path / "sensor.toml"))


@pytest.mark.slow
def test_the_command_trains_from_physics_and_a_sweep_and_then_suggests(tmp_path: Path, sweep: Path,
                                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(networks, "MOST_STEPS", 40)
    monkeypatch.setattr(networks, "HIDDEN", (32,))
    arguments, run = written(tmp_path, 14), CliRunner()
    done = run.invoke(app, [*arguments, "--suggest", "2", "--simulated", f"{sweep}", "--json"])
    assert done.exit_code == 0, done.output
    said = json.loads(done.output)
    assert said["sensor"] == "sensor file"
    assert len(said["suggested"]) == 2
    assert "go on from the model of the sensor" in said["choice"][0]
    (tmp_path / "sensor.toml").write_text('[electrodes]\ncount = 8\n[readings]\nkind = "difference"\n')
    refused = run.invoke(app, [*arguments, "--simulated", f"{sweep}"])
    assert "it simulates 16 electrodes, and the sensor has 8" in str(refused.exception)
