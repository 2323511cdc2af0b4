"""What the commands say of readers that hold too little, read too little, or have no sensor file."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import surrogate
from surrogate.cli.main import app
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.recorded.reader_scores import ReaderScore, found_wanting, wanting_words
from touchcal.arrays import Array

from .conftest import short_networks, synthetic_presses


def score(error: float, *coverage: float) -> ReaderScore:
    output, unit = ("place", "mm") if len(coverage) == 2 else ("F_N", "N")
    return ReaderScore("time", output, unit, 160, 40, 800, 200, error, error, 10.0, coverage,
                       (3.0,) * len(coverage), None)


def test_intervals_that_hold_too_little_are_found_by_presses_and_not_by_frames() -> None:
    assert found_wanting([score(2, 0.9, 0.8)])["coverage_below"] == []  # 80 % of 40 presses; of 200 it were no chance
    (found,) = found_wanting([score(2, 0.9, 0.62), score(1, 0.91)])["coverage_below"]
    assert (found["split"], found["output"], found["measured"], found["n"]) == ("time", "y_mm", 0.62, 40)
    assert len(wanting_words([score(2, 0.9, 0.62)])) == 1


def test_what_is_read_no_better_than_by_the_mean_is_found() -> None:
    (found,) = found_wanting([score(10.5, 0.9, 0.9), score(9.5, 0.9)])["worse_than_mean"]
    assert (found["output"], found["error"], found["mean_error"]) == ("place", 10.5, 10.0)
    assert len(wanting_words([score(10.5, 0.9, 0.9)])) == 1


def frames(seed: int, count: int, drift: float) -> tuple[pd.DataFrame, Array]:
    """Sixteen plain voltages under forces up to 3 N, an untouched row before each; signals drift off by a part that no
    untouched row shows."""
    rng = np.random.default_rng(seed)
    shape, rest = np.random.default_rng(9).standard_normal((2, 16))
    force = 0.1 + 2.9 * rng.random(count)
    volts = 20 + rest + np.zeros((2 * count, 16))
    volts[1::2] += (np.tanh(force / 4) * (1 + drift))[:, None] * shape
    volts += 0.005 * rng.standard_normal(volts.shape)
    table = pd.DataFrame(volts, columns=[f"v_{k:03d}" for k in range(16)])
    table.insert(0, "touch", ["" if k % 2 == 0 else f"t{k // 2}" for k in range(2 * count)])
    return table, force


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """A folder with a model of plain channels, and what training said in words and as JSON."""
    folder = tmp_path_factory.mktemp("plain")
    for name, seed, drift in (("known", 1, 0.0), ("other", 2, -0.25)):
        table, force = frames(seed, 120, drift)
        table.to_csv(folder / f"{name}.csv", index=False)
        pd.DataFrame({"touch": [f"t{k}" for k in range(120)], "F_N": force}).to_csv(folder / f"{name}_F.csv",
                                                                                   index=False)
    words = ["train", f"{folder}/known.csv", "--labels", f"{folder}/known_F.csv", "--out", f"{folder}/model",
             "--workers", "1"]
    with short_networks():
        said, described = (CliRunner().invoke(app, [*words, *more]) for more in ([], ["--json"]))
    assert said.exit_code == 0, said.output
    return folder, said.stdout, described.stdout


def test_plain_channels_are_learnt_without_a_sensor_file(trained: tuple[Path, str, str]) -> None:
    folder, said, described = trained
    assert "no model of the sensor is used" in " ".join(said.split())
    assert json.loads(described)["sensor"] is None
    assert json.loads(described)["coverage_below"] == []
    assert "caution" not in said
    model = surrogate.load(folder / "model")
    assert {one.score.output: one.score.error < 0.3 * one.score.mean_error for one in model.tested} == {"F_N": True}


def test_options_that_need_a_sensor_name_it(trained: tuple[Path, str, str]) -> None:
    folder, *_ = trained
    refused = CliRunner().invoke(app, ["train", f"{folder}/known.csv", "--labels", f"{folder}/known_F.csv", "--out",
                                       f"{folder}/new", "--suggest", "3"])
    assert "need the sensor: give --sensor" in str(refused.exception)


@pytest.mark.parametrize(("factor", "caution"), [(1, ""), (0.1, "Check that x_mm and y_mm are in mm"),
                                                 (2, "labelled places lie off the skin, which is 200 by 200 mm")])
def test_learn_says_what_labels_span_and_cautions_of_another_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                                  factor: float, caution: str) -> None:
    presses, place = synthetic_presses(9, 30)
    table = pd.DataFrame(presses.signal, columns=[f"v_{k:03d}" for k in range(presses.signal.shape[1])])
    table.insert(0, "touch", presses.name)
    table.to_csv(tmp_path / "frames.csv", index=False)
    at = factor * place
    pd.DataFrame({"touch": presses.name, "x_mm": at[:, 0], "y_mm": at[:, 1]}).to_csv(tmp_path / "t.csv", index=False)
    (tmp_path / "sensor.toml").write_text('[readings]\nkind = "difference"\n')
    words = ["learn", f"{tmp_path}/frames.csv", "--labels", f"{tmp_path}/t.csv", "--sensor", f"{tmp_path}/sensor.toml",
             "--out", f"{tmp_path}/model", "--method", "ridge", "--workers", "1"]
    learnt, learn = list[PressModel](), surrogate.learn
    monkeypatch.setattr(surrogate, "learn", lambda *given: learnt.append(learn(*given)) or learnt[0])
    said = CliRunner().invoke(app, words)
    assert said.exit_code == 0, said.output
    monkeypatch.setattr(surrogate, "learn", lambda *given: learnt[0])  # the same presses again
    low, high = at.min(axis=0), at.max(axis=0)
    assert f"labels: x_mm {low[0]:.3g} to {high[0]:.3g}, y_mm {low[1]:.3g} to {high[1]:.3g}\n" in said.stdout
    off = int((np.hypot(*at.T) > 100).sum())
    assert (f"caution: {off} of 30 labelled places lie off" in said.stdout) == bool(off)
    assert (caution in said.stdout) if caution else ("caution: labelled" not in said.stdout)
    assert caution in (json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)["caution"] or "")


def test_evaluate_says_where_intervals_hold_too_little(trained: tuple[Path, str, str]) -> None:
    folder, *_ = trained
    words = ["evaluate", f"{folder}/model", f"{folder}/other.csv", "--labels", f"{folder}/other_F.csv"]
    scores = json.loads(CliRunner().invoke(app, [*words, "--json"]).stdout)
    held = scores["outputs"]["F"]["all"]["coverage_90"]
    assert held < 0.75
    (found,) = scores["coverage_below"]
    assert (found["output"], found["part"], found["nominal"], found["n"]) == ("F", "all", 0.9, 120)
    assert found["measured"] == held
    assert "caution: F: the 90 % intervals hold" in CliRunner().invoke(app, words).stdout
    same = CliRunner().invoke(app, ["evaluate", f"{folder}/model", f"{folder}/known.csv", "--labels",
                                    f"{folder}/known_F.csv", "--json"])
    assert json.loads(same.stdout)["coverage_below"] == []
