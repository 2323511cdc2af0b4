from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection

from reports.document import style
from reports.document.numerals import percent, r_squared
from reports.surrogate import parity_figures, surrogate_tables
from reports.surrogate.surrogate_report import report, write
from surrogate.model.store import save_evaluation
from surrogate.statistics.metrics import score
from touchcal.errors import InputFileError

Reader = Callable[[Path], Any]
UNITS = {"x0": "mm", "A_c": "mm2"}


def make_predictions() -> pd.DataFrame:
    rng = np.random.default_rng(5)
    rows = []
    for name, unit in UNITS.items():
        for part, count in (("train", 28), ("val", 6), ("test", 6)):
            target = rng.uniform(10, 60, count)
            rows.append(pd.DataFrame({"part": part, "scene": range(count), "output": name, "unit": unit,
                                      "target": target, "value": target + rng.normal(size=count),
                                      "half_width_90": 1.6}))
    return pd.concat(rows, ignore_index=True)


def write_model(folder: Path, **changes: Any) -> pd.DataFrame:
    """A synthetic model folder: a description, scores and the predictions that they are computed from."""
    folder.mkdir(exist_ok=True)
    table = make_predictions()
    scores: dict[str, Any] = {}
    for name, unit in UNITS.items():
        for part in ("train", "val", "test"):
            chosen = ((table["output"] == name) & (table["part"] == part)).to_numpy()
            target, value, half = (table[key].to_numpy(float)[chosen] for key in ("target", "value", "half_width_90"))
            scores.setdefault(name, {})[part] = asdict(score(target, value, *[np.array([half] * 3)] * 2, unit))
    dataset = {"sha256": "cd" * 32, "rows": 40}
    net = {"gamma": 25.5, "parameters": 101, "epochs": 77, "stop": "the gradient vanished", "collapsed": False}
    model = {"schema": 1, "method": "trainbr", "outputs": [{"name": name} for name in UNITS], "seed": 4,
             "fit_s": 12.34, "versions": {"torch": "2.13.0"}, "training": {"x0": net, "A_c": net},
             "dataset": dataset | {"split": {"train": 28, "val": 6, "test": 6}}}
    evaluation = {"method": "trainbr", "dataset": dataset, "fit_s": 12.34, "predict_ms": 0.567, "outputs": scores,
                  "noise": []} | changes
    (folder / "model.json").write_text(json.dumps(model))
    save_evaluation(folder, evaluation, table)
    return table


def test_a_surrogate_report_holds_its_scores(tmp_path: Path, read_pdf: Reader) -> None:
    table, out = write_model(tmp_path / "model"), tmp_path / "s.pdf"
    write(tmp_path / "model", out)
    text = read_pdf(out).whole
    test = table[(table["output"] == "x0") & (table["part"] == "test")]
    error = test["value"] - test["target"]
    r2 = 1 - np.mean(error**2) / np.var(test["target"])
    r = np.corrcoef(test["target"], test["value"])[0, 1]
    assert f"{r:.4f}" != f"{r2:.4f}"
    assert "No noise was added" in text
    for value in (f"RMSE {np.sqrt(np.mean(error**2)):#.3g} mm", f"MSE {np.mean(error**2):#.3g} mm²",
                  f"R² {r2:.4f}, R {r:.4f}", f"{r2:.4f} {r:.4f} ", "12.3 s of CPU", "0.567 ms", "25.5",
                  "77", "the gradient vanished", "seed 4"):
        assert value in text
    assert "Contact area, predicted (mm²)" in text
    assert "mm⁴" in text
    for name in ("model.json", "evaluation.json", "predictions.parquet"):
        assert hashlib.sha256((tmp_path / "model" / name).read_bytes()).hexdigest()[:16] in text
    drawn = pd.read_csv(tmp_path / "s_files" / "parity_x0.csv")
    assert np.allclose(drawn["value"], table.loc[table["output"] == "x0", "value"])


def test_the_correlation_knows_neither_scale_nor_shift_and_none_where_nothing_varies() -> None:
    target = np.array([1.0, 2.0, 4.0])
    rows = pd.concat([pd.DataFrame({"part": part, "target": target, "value": value}) for part, value in
                      (("train", 3 * target + 5), ("val", -target), ("test", np.ones(3)))])
    found = parity_figures.correlations(rows)
    assert found == {"train": pytest.approx(1.0), "val": pytest.approx(-1.0)}


def test_a_surrogate_begins_with_its_verdict_and_carries_the_cautions_of_the_terminal(tmp_path: Path,
                                                                                      read_pdf: Reader) -> None:
    table = write_model(tmp_path / "model", interval_rows=6, few_interval_rows="6 calibrating rows are few.",
                        interval_caution="intervals were calibrated on rows without noise.",
                        material="material uncertainty is not in the intervals.", trained_range={"x0": [10.0, 60.0]})
    write(tmp_path / "model", tmp_path / "s.pdf")
    first = " ".join(read_pdf(tmp_path / "s.pdf").pages[0].split())
    held = table[(table["part"] == "test") & ((table["value"] - table["target"]).abs() <= 1.6)]
    least = min(held["output"].tolist().count(name) for name in UNITS) / 6
    for line in ("Position x, contact area good R²", f"hold {percent(least)} of 6 rows", "which are few",
                 "Before you use these numbers", "6 calibrating rows are few.",
                 "Intervals were calibrated on rows without noise.", "Material uncertainty is not in the intervals.",
                 "position x 10.0 to 60.0 mm"):
        assert line in first, line
    assert first.index("Position x, contact area") < first.index("12.3 s of CPU")


def test_a_noise_that_was_scored_is_shown(tmp_path: Path, read_pdf: Reader) -> None:
    noisy = {name: {"test": {"rmse": 3.21}} for name in UNITS}
    write_model(tmp_path / "model", noise=[{"db_below_baseline": 60.0, "db_below_signal": 12.5, "outputs": noisy}])
    write(tmp_path / "model", tmp_path / "s.pdf")
    text = read_pdf(tmp_path / "s.pdf").whole
    assert "60.0 dB" in text
    assert "3.21" in text
    assert "12.5 dB below the RMS of the signal" in text


def test_the_signal_over_force_is_drawn_with_its_tops(tmp_path: Path, read_pdf: Reader) -> None:
    force = [0.1, 0.5, 1.0, 2.0]
    turned = {"d_mm": 10.0, "rms_V": [1e-3, 4e-3, 3e-3, 2e-3], "peak_N": 0.5, "two_answers_N": [0.5, 2.0]}
    growing = {"d_mm": 18.0, "rms_V": [1e-3, 2e-3, 3e-3, 4e-3], "peak_N": None, "two_answers_N": None}
    amplitude = {"radius_mm": 0.0, "force_N": force, "diameters": [turned, growing]}
    write_model(tmp_path / "model", amplitude=amplitude)
    write(tmp_path / "model", tmp_path / "s.pdf")
    text = " ".join(read_pdf(tmp_path / "s.pdf").whole.split())
    assert "it has a top at 0.50 N at 10.0 mm" in text
    assert "between 0.50 and 2.0 N" in text
    drawn = pd.read_csv(tmp_path / "s_files" / "amplitude.csv")
    assert np.allclose(drawn.loc[drawn["d_mm"] == 10, "rms_mV"], [1, 4, 3, 2])
    write_model(tmp_path / "model", amplitude=amplitude | {"diameters": [growing]})
    assert any("grows with the force at every diameter" in plate.caption for plate in report(tmp_path / "model").plates)


def test_scores_of_another_data_set_and_constant_targets_are_said(tmp_path: Path, read_pdf: Reader) -> None:
    constant = {"mse": 1.5, "rmse": 1.22, "r2": None, "mae": 1.0, "n": 40, "coverage_90": 0.9, "unit": "mm"}
    write_model(tmp_path / "model", dataset={"sha256": "00" * 32, "rows": 40}, outputs={"x0": {"all": constant}})
    scores = json.loads((tmp_path / "model" / "evaluation.json").read_text())
    del scores["sha256"]
    table = pd.read_parquet(tmp_path / "model" / "predictions.parquet").assign(part="all")
    save_evaluation(tmp_path / "model", scores, table)
    write(tmp_path / "model", tmp_path / "s.pdf")
    text = read_pdf(tmp_path / "s.pdf").whole
    assert "another data set" in text
    assert "Position x not usable no R²: the targets do not vary" in text


def test_the_floor_of_the_physics_stands_beside_the_errors_under_noise(tmp_path: Path, read_pdf: Reader) -> None:
    noisy = {name: {"test": {"rmse": 3.0}} for name in UNITS}
    write_model(tmp_path / "model", noise=[{"db_below_baseline": 60.0, "db_below_signal": 12.5, "outputs": noisy}])
    limits = pd.DataFrame({"dataset": "cd" * 32, "noise_db": 60.0, "noise_V": 1e-3, "material": "known",
                           "output": ["x0", "A_c"], "unit": ["mm", "mm2"], "limit": [1.23, 2.0]})
    limits.to_csv(tmp_path / "model" / "limits.csv", index=False)
    write(tmp_path / "model", tmp_path / "s.pdf")
    text = read_pdf(tmp_path / "s.pdf").whole
    assert "least possible, material known" in text
    assert "1.23" in text
    assert "1.50 to 2.44 times as large (most: position x at 60.0 dB)" in text
    limits.assign(dataset="00" * 32).to_csv(tmp_path / "model" / "limits.csv", index=False)
    assert "limits.csv is of another data set" in str(report(tmp_path / "model").prose["limits"])
    limits.drop(columns="limit").to_csv(tmp_path / "model" / "limits.csv", index=False)
    with pytest.raises(InputFileError, match="column limit is missing"):
        report(tmp_path / "model")


def test_maps_of_the_limit_are_drawn_by_level(tmp_path: Path) -> None:
    """Made-up maps: the force is known best near the rim."""
    write_model(tmp_path / "model")
    angle = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    x, y = (np.r_[0.0, 50 * f(angle), 93 * f(angle)] for f in (np.cos, np.sin))
    sd = 0.2 - 0.0015 * np.hypot(x, y)
    rows = [pd.DataFrame({"noise_db": level, "material": material, "x_mm": x, "y_mm": y, "d_mm": 14.0, "F_N": 1.0,
                          "sd_x0_mm": 2 * sd * k, "sd_y0_mm": 2 * sd * k, "sd_d_mm": 9 * sd * k, "sd_F_N": sd * k})
            for level, k in ((60.0, 1.0), (80.0, 0.1)) for material in ("known", "posterior")]
    pd.concat(rows).to_csv(tmp_path / "model" / "limit_map.csv", index=False)
    with style.house():
        quiet, loud = (plate for plate in report(tmp_path / "model").plates if plate.name.startswith("limit_map_"))
    for words in ("noise 60.0 dB below", "a punch of 14.0 mm under 1.00 N", "force 0.200 and 0.0605 N"):
        assert words in loud.caption
    assert len(quiet.data["limit_map_80dB"]) == 2 * len(x)
    titles = [axes.get_title("left") for axes in quiet.figure.axes[:4]]
    assert titles == ["Position x", "Position y", "Punch diameter", "Force"]
    rows[0].drop(columns="sd_F_N").to_csv(tmp_path / "model" / "limit_map.csv", index=False)
    with pytest.raises(InputFileError, match="column sd_F_N is missing"):
        report(tmp_path / "model")


def test_a_method_without_a_record_of_its_training_has_an_empty_table() -> None:
    assert not surrogate_tables.training({}).rows


def test_the_training_of_networks_is_drawn(tmp_path: Path, read_pdf: Reader) -> None:
    """Two synthetic histories of E_D, E_W, gamma, alpha and beta."""
    write_model(tmp_path / "model")
    step = np.arange(1.0, 21.0)
    history = np.column_stack([28 / step**2, step, 30 - step, 0.1 * step, step**2])
    arrays = {f"learner.networks.trainings.{i}.history": history for i in (0, 1)}
    np.savez(tmp_path / "model" / "arrays.npz", allow_pickle=False, **arrays)
    write(tmp_path / "model", tmp_path / "s.pdf")
    text = read_pdf(tmp_path / "s.pdf").whole
    assert "over up to 20 steps" in text
    assert "ends at 0.0500 to 0.0500 of half the span, with 10.0 to 10.0 effective parameters" in text
    drawn = pd.read_csv(tmp_path / "s_files" / "history.csv")
    assert np.allclose(drawn["rms_error"][:20], 1 / step)


@pytest.mark.parametrize(("name", "old", "new"), [
    ("model.json", b'"seed": 4', b'"seed": 5'), ("evaluation.json", b'"predict_ms": 0.567', b'"predict_ms": 0.5'),
    ("evaluation.json", b"sha256", b"sha"), ("predictions.parquet", b"PAR1", b""),
    ("predictions.parquet", b"A_c", b"x_c")])
def test_scores_that_were_changed_are_refused_by_their_file(tmp_path: Path, name: str, old: bytes, new: bytes) -> None:
    write_model(tmp_path / "model")
    path = tmp_path / "model" / name
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    with pytest.raises(InputFileError, match=f"{name}: .*train it again"):
        report(tmp_path / "model")


@pytest.mark.parametrize("name", ["model.json", "evaluation.json", "predictions.parquet"])
def test_a_folder_that_is_no_model_is_named(tmp_path: Path, name: str) -> None:
    write_model(tmp_path / "model")
    (tmp_path / "model" / name).unlink()
    with pytest.raises(InputFileError, match=f"holds no {name}"):
        write(tmp_path / "model", tmp_path / "s.pdf")
    assert not (tmp_path / "s.pdf").exists()


@pytest.mark.parametrize(
    ("rows", "bars", "words"),
    [(30, 30, "(bars, cut at the frame)"), (3000, parity_figures.BARS, "(bars of 40 rows a panel, cut")],
)
def test_bars_of_many_rows_stay_apart(rows: int, bars: int, words: str) -> None:
    target = np.linspace(1.0, 2.0, rows)
    table = pd.DataFrame({"part": "test", "scene": range(rows), "unit": "N", "target": target, "value": target,
                          "half_width_90": 0.1})
    parts = {"test": asdict(score(target, target + 0.01, *[np.full((3, rows), 0.1)] * 2, "N"))}
    made = parity_figures.plate("F", table, parts)
    (axes,) = made.figure.axes
    (drawn,) = (one for one in axes.collections if isinstance(one, LineCollection))
    assert len(drawn.get_segments()) == bars
    assert rows in {np.size(line.get_xdata()) for line in axes.get_lines()}
    assert words in made.caption
    assert len(made.data["parity_F"]) == rows


def test_points_of_a_few_targets_stand_apart_and_each_panel_says_its_error() -> None:
    for target, moved in ((np.repeat([10.0, 12.0, 14.0], 20), True), (np.linspace(10.0, 14.0, 60), False)):
        table = pd.DataFrame({"part": "test", "scene": range(60), "unit": "mm", "target": target, "value": target + 0.5,
                              "half_width_90": 1.0})
        half = np.full((3, 60), 1.0)
        parts = {"test": asdict(score(target, target + 0.5, half, half, "mm"))}
        made = parity_figures.plate("d", table, parts)
        (axes,) = made.figure.axes
        (points,) = (line for line in axes.get_lines() if np.size(line.get_xdata()) == 60)
        away = np.abs(np.asarray(points.get_xdata(), float) - target)
        assert (away.max() > 0) == moved
        assert away.max() < 0.2
        assert np.array_equal(made.data["parity_d"]["target"], target)
        r = r_squared(parity_figures.correlations(table)["test"])
        assert [text.get_text() for text in axes.texts] == [f"RMSE 0.500 mm\nR² {parts['test']['r2']:.4f}, R {r}"]
