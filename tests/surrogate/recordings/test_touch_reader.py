"""The reader whole: it reads, refuses, flags, is stored, and is what the commands use."""

import errno
import json
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

import eitsim
import surrogate
from surrogate.cli.main import app
from surrogate.model.recorded.learn_presses import choice
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.recorded.reader_scores import read_split, split_rows
from surrogate.recordings import press_reader, touch_reader
from surrogate.recordings.press_reader import PressReader
from surrogate.recordings.presses import Presses, taken
from surrogate.recordings.touch_reader import Reading
from surrogate.recordings.worth import NothingToRead
from touchcal.arrays import Array
from touchcal.errors import InputFileError

from .conftest import labels_at, short_networks, synthetic_places, synthetic_presses, synthetic_signal

Pressed = tuple[Presses, Array]


@pytest.fixture(scope="module")
def quick() -> object:
    """Few, short networks: what is tested here does not depend on how well they learn."""
    with short_networks():
        yield


@pytest.fixture(scope="module")
def reader(presses: Pressed, quick: object) -> PressReader:
    return press_reader.fit(presses[0], labels_at(presses[1]))


def place_read(reader: PressReader, presses: Presses) -> Reading:
    found = press_reader.read(reader, presses).place
    assert found
    return found


def test_new_presses_are_read_and_held(reader: PressReader) -> None:
    new, place = synthetic_presses(5, 200)
    found = place_read(reader, new)
    assert reader.place
    error = np.linalg.norm(found.value - place, axis=1).mean()
    assert error < 1.3 * reader.place.held_out[:6].min()
    assert 0.8 < np.mean(np.abs(found.value - place) <= found.bounds.half_width) < 0.99
    assert sum(map(bool, press_reader.read(reader, new).flag)) < 10


def test_the_choice_names_the_families_that_read(reader: PressReader) -> None:
    assert reader.place
    (said,) = choice(reader)
    for name, weight in zip(touch_reader.FAMILIES, reader.place.weights, strict=True):
        assert (f"{name} {weight:.2f}" in said) == (weight > 0)


@pytest.mark.slow
def test_labels_of_other_presses_are_refused(presses: Pressed, quick: object) -> None:
    refused = 0
    for seed in range(100, 106):
        try:
            press_reader.fit(presses[0], labels_at(np.random.default_rng(seed).permutation(presses[1])))
        except NothingToRead as refusal:
            refused += "nothing to read here of the place" in str(refusal)
    assert refused >= 5  # chance reaches the level of the test once in 20 times


def test_too_few_presses_are_refused(presses: Pressed) -> None:
    few = taken(presses[0], np.arange(9))
    with pytest.raises(ValueError, match="9 labelled presses are too few"):
        press_reader.fit(few, labels_at(presses[1][:9]))


def test_a_dead_channel_costs_little_and_flags_nothing(reader: PressReader) -> None:
    new, place = synthetic_presses(6, 50)
    dead = new.signal.copy()
    dead[:, 9] = np.nan
    lacking = replace(new, signal=dead)
    whole, found = place_read(reader, new), place_read(reader, lacking)
    flags = [sum(map(bool, press_reader.read(reader, one).flag)) for one in (new, lacking)]
    assert flags[1] <= flags[0] + 1
    assert np.all(found.bounds.half_width > 0)
    miss = [np.linalg.norm(one.value - place, axis=1).mean() for one in (whole, found)]
    assert miss[1] < 1.5 * miss[0]


def test_strange_and_weak_patterns_are_flagged(reader: PressReader) -> None:
    new, _ = synthetic_presses(7, 2)
    strange = np.random.default_rng(0).standard_normal(new.signal[0].shape) * np.abs(new.signal).mean()
    found = press_reader.read(reader, replace(new, signal=np.stack([strange, 1e-3 * new.signal[1]])))
    assert "unlike" in found.flag[0]
    assert "weaker" in found.flag[1]


def drifting(seed: int, count: int, apart: int, noise: float = 0.0) -> tuple[Presses, Array]:
    """Synthetic presses against the untouched frame of `apart` presses before, which drifts along two axes; noise of
    the touched frames over the mean signal."""
    rng = np.random.default_rng(seed)
    place = synthetic_places(rng, count)
    signal = synthetic_signal(place, np.ones(count))
    size = np.abs(signal).mean()
    signal = signal + noise * size * rng.standard_normal(signal.shape)
    axes = np.random.default_rng(99).standard_normal((2, signal.shape[1]))
    rest = size * np.cumsum(rng.standard_normal((count, 2)), axis=0) @ axes * 0.3
    rest += 0.005 * size * rng.standard_normal(rest.shape)
    old = rest[np.maximum(np.arange(count) - apart, 0)]
    return Presses(np.arange(count).astype(np.str_), 2 * np.arange(count) + 1, signal + rest - old,
                   np.full_like(signal, np.nan), np.full(count, 2.0 * apart + 1), rest,
                   np.arange(0.0, 2 * count, 2), np.arange(1.0, 2 * count + 1, 2)), place


@pytest.fixture(scope="module")
def of_drift(quick: object) -> PressReader:
    known, place = drifting(1, 60, 0)
    return press_reader.fit(known, labels_at(place))


def test_an_old_untouched_frame_is_read_by_what_drift_spares(of_drift: PressReader) -> None:
    new, there = drifting(2, 60, 15)
    found = place_read(of_drift, new)
    assert all("older than any in training, and the intervals are wider" in flag
               for flag in press_reader.read(of_drift, new).flag)
    as_if_new = place_read(of_drift, replace(new, age=np.zeros(60)))
    miss = [np.linalg.norm(one.value - there, axis=1).mean() for one in (found, as_if_new)]
    assert miss[0] < 0.7 * miss[1]


@pytest.mark.thorough
def test_intervals_hold_where_the_untouched_frame_is_as_old_as_training_could_show(quick: object) -> None:
    known, place = drifting(1, 60, 0, 0.05)
    reader = press_reader.fit(known, labels_at(place))
    held, width = [], []
    for apart in (0, 15):
        new, there = drifting(3, 300, apart, 0.05)
        found = place_read(reader, new)
        held.append(np.mean(np.abs(found.value - there) <= found.bounds.half_width))
        width.append(found.bounds.half_width.mean())
    assert min(held) > 0.8
    assert max(held) < 0.99
    assert width[1] > width[0]


def test_a_frame_older_than_training_could_show_is_said_so(of_drift: PressReader) -> None:
    new, _ = drifting(2, 5, 0)
    flag = press_reader.read(of_drift, replace(new, age=np.full(5, 1e4))).flag
    assert all("so much that the intervals may not hold" in one for one in flag)


def test_a_split_tests_rows_that_did_not_train(presses: Pressed, quick: object) -> None:
    for split in ("random", "time"):
        train, test = split_rows(60, split, 0)
        assert sorted([*train, *test]) == list(range(60))
    assert split_rows(60, "time", 0)[1].min() == 48
    (tested,) = read_split(presses[0], labels_at(presses[1]), "time")
    found = tested.score
    assert found.in_ellipse is not None
    assert (found.output, found.trained, found.tested) == ("place", 48, 12)
    assert found.error < 0.3 * found.mean_error


def test_a_stored_reader_reads_the_same_and_a_changed_one_is_refused(reader: PressReader, tmp_path: Path) -> None:
    model = PressModel(reader, "difference", 60, 60, 0, (), 1.5)
    model.save(tmp_path)
    again = surrogate.load(tmp_path)
    new, _ = synthetic_presses(8, 5)
    one, two = (place_read(part.reader, new) for part in (model, again))
    np.testing.assert_array_equal(one.value, two.value)
    np.testing.assert_array_equal(one.bounds.half_width, two.bounds.half_width)
    text = json.loads((tmp_path / "model.json").read_text())
    (tmp_path / "model.json").write_text(json.dumps(text | {"presses": 61}))
    with pytest.raises(InputFileError, match="was changed"):
        surrogate.load(tmp_path)
    for schema in (1, 14):  # 14: readers that knew no distance to what was taught
        (tmp_path / "model.json").write_text(json.dumps(text | {"schema": schema}))
        with pytest.raises(InputFileError, match=rf"schema {schema}, method .* is not one that this version reads"):
            surrogate.load(tmp_path)


@pytest.fixture
def kept_back(reader: PressReader, presses: Pressed, tmp_path: Path) -> tuple[Path, Array]:
    """A folder with a model, its 60 presses and 40 others in one recording, and labels of them all but the last; and
    their places."""
    PressModel(reader, "difference", 60, 60, 0, (), 1.5).save(tmp_path / "model")
    new, place = synthetic_presses(8, 40)
    signal, place = np.vstack([presses[0].signal, new.signal]), np.vstack([presses[1], place])
    frames = pd.DataFrame(signal, columns=[f"v_{k:03d}" for k in range(signal.shape[1])])
    frames.insert(0, "touch", [f"t{k}" for k in range(100)])
    frames.to_csv(tmp_path / "frames.csv", index=False)
    pd.DataFrame({"touch": frames["touch"], "x_mm": place[:, 0], "y_mm": place[:, 1], "d_mm": 10.0}).iloc[:99].to_csv(
        tmp_path / "touches.csv", index=False)
    return tmp_path, place


def test_presses_kept_back_are_scored_as_predict_reads_them_and_trained_ones_separately(
        kept_back: tuple[Path, Array]) -> None:
    folder, place = kept_back
    model, frames, labels = (f"{folder}/{name}" for name in ("model", "frames.csv", "touches.csv"))
    run = CliRunner()
    found = run.invoke(app, ["evaluate", model, frames, "--labels", labels, "--json"])
    assert found.exit_code == 0, found.output
    scores = json.loads(found.stdout)
    table = surrogate.load(model).predict(eitsim.read_recording(frames, kind="difference"))
    assert {*scores["outputs"]} == {"x0", "y0"}
    for axis, name in enumerate(("x0", "y0")):
        for part, rows in (("train", slice(60)), ("new", slice(60, 99))):
            one, target, read = scores["outputs"][name][part], place[rows, axis], table.iloc[rows]
            error = read[f"{name}_mm"].to_numpy() - target
            held = (target >= read[f"{name}_lo90_mm"]) & (target <= read[f"{name}_hi90_mm"])
            assert (one["n"], one["unit"], one["coverage_50"]) == (len(target), "mm", None)
            assert one["coverage_90"] == pytest.approx(held.mean())
            assert one["mse"] == pytest.approx(np.mean(error**2))
            assert one["mae"] == pytest.approx(np.abs(error).mean())
            assert one["r2"] == pytest.approx(1 - np.mean(error**2) / target.var())
    assert scores["predict_ms"] > 0
    assert "does not read: d_mm" in scores["scored"]
    shown = run.invoke(app, ["evaluate", model, frames, "--labels", labels, "--verbose"])
    cells = [row_of(line.split("│")[1:-1]) for line in shown.stdout.splitlines()]
    one = scores["outputs"]["x0"]["new"]
    assert ["x0", "new", f"{one['rmse']:.4g} mm", f"{one['r2']:.4f}", f"-/{100 * one['coverage_90']:.0f}/-",
            f"{one['half_width_90']:.4g}", "39"] in cells


def test_presses_that_cannot_be_read_are_left_out_of_the_scores_and_said(kept_back: tuple[Path, Array]) -> None:
    folder, _ = kept_back
    frames = pd.read_csv(folder / "frames.csv")
    frames.iloc[70, 1:150] = np.nan
    frames.iloc[60:].to_csv(folder / "frames.csv", index=False)
    found = CliRunner().invoke(app, ["evaluate", f"{folder}/model", f"{folder}/frames.csv", "--labels",
                                     f"{folder}/touches.csv", "--json"])
    scores = json.loads(found.stdout)
    assert {part: one["n"] for part, one in scores["outputs"]["x0"].items()} == {"all": 38}
    assert "1 of 39 frames have no value and are left out; 1 of 39 frames are flagged" in scores["scored"]


def test_an_audit_vouches_for_presses_that_all_lack_a_channel(kept_back: tuple[Path, Array]) -> None:
    folder, _ = kept_back
    frames = pd.read_csv(folder / "frames.csv")
    frames["v_009"] = np.nan
    frames.to_csv(folder / "frames.csv", index=False)
    given = ["audit", f"{folder}/model", f"{folder}/frames.csv", "--labels", f"{folder}/touches.csv"]
    found = CliRunner().invoke(app, given)
    assert "in 100 of 100 frames v_009 is dead and left out" in found.stdout
    verdict = json.loads(CliRunner().invoke(app, [*given, "--json"]).stdout)["verdict"]
    assert verdict["frames"] > 80
    assert found.exit_code == (0 if verdict["holds"] else 3)


def test_what_cannot_be_scored_is_refused(kept_back: tuple[Path, Array]) -> None:
    folder, _ = kept_back
    (folder / "cm.csv").write_text("touch,x_cm\nt1,1\n")
    (folder / "depth.csv").write_text("touch,depth_mm\nt1,1\n")
    (folder / "others.csv").write_text("touch,x_mm\nother,1\n")
    pd.read_csv(folder / "frames.csv").iloc[:, :100].to_csv(folder / "narrow.csv", index=False)
    given = [folder / "frames.csv", "--labels", folder / "touches.csv"]
    cases = [(given[:1], "got 0 files of labels for .*frames.csv. Give one --labels touches.csv for each"),
             ([folder / "frames.csv", *given], "got 1 files of labels"),
             ([*given[:2], folder / "cm.csv"], "cm.csv, line 1: x_cm in a unit that .*; give x_mm .10 times as large"),
             ([*given[:2], folder / "depth.csv"], "depth.csv: its labels are depth_mm, and the model reads x_mm, y_mm"),
             ([*given[:2], folder / "others.csv"], "others.csv: none of its 1 touches is one of the recording's"),
             ([folder / "narrow.csv", *given[1:]], "narrow.csv, line 2: 99 readings a frame"),
             ([*given, "--noise-db", "80"], "Leave out --noise-db")]
    for words, message in cases:
        refused = CliRunner().invoke(app, ["evaluate", f"{folder}/model", *map(str, words)])
        assert re.search(message, str(refused.exception)), refused.exception


def row_of(cells: Sequence[object]) -> list[str]:
    return [str(one).strip() for one in cells]


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, "no space left")


@pytest.mark.slow
def test_the_commands_train_and_predict(tmp_path: Path, quick: object, monkeypatch: pytest.MonkeyPatch) -> None:
    presses, place = synthetic_presses(9, 40)
    names = [f"v_{k:03d}" for k in range(presses.signal.shape[1])]
    frames = pd.DataFrame(presses.signal, columns=names)
    frames.insert(0, "touch", [f"t{k}" for k in range(40)])
    frames.to_csv(tmp_path / "frames.csv", index=False)
    pd.DataFrame({"touch": frames["touch"], "x_mm": place[:, 0], "y_mm": place[:, 1]}).iloc[:30].to_csv(
        tmp_path / "touches.csv", index=False)
    (tmp_path / "sensor.toml").write_text('[readings]\nkind = "difference"\n')
    (tmp_path / "model").mkdir()
    for name in ("model.json", "evaluation.json", "predictions.parquet"):  # of an earlier model of a sweep
        (tmp_path / "model" / name).write_text("{}")
    run = CliRunner()
    trained = run.invoke(app, ["train", f"{tmp_path}/frames.csv", "--labels", f"{tmp_path}/touches.csv", "--sensor",
                               f"{tmp_path}/sensor.toml", "--out", f"{tmp_path}/model", "--workers", "1"])
    assert trained.exit_code == 0, trained.output
    assert "kernel ridge" in trained.output
    assert sorted(path.name for path in (tmp_path / "model").iterdir()) == ["arrays.npz", "model.json"]
    for one in (tested.score for tested in surrogate.load(tmp_path / "model").tested):
        row = [one.split, one.trained, one.tested, one.output, f"{one.error:.3g} mm", f"{one.ridge_error:.3g}",
               f"{one.mean_error:.3g}", ", ".join(f"{100 * part:.0f}" for part in one.coverage),
               ", ".join(f"{half:.3g}" for half in one.half_width), f"{100 * (one.in_ellipse or 0):.0f}"]
        assert " ".join(map(str, row)) in [" ".join(line.split()) for line in trained.output.splitlines()]
    found = run.invoke(app, ["predict", f"{tmp_path}/model", f"{tmp_path}/frames.csv", "--out", f"{tmp_path}/out.csv"])
    assert found.exit_code == 0, found.output
    table = pd.read_csv(tmp_path / "out.csv")
    assert [*table] == ["touch", "x0_mm", "x0_lo90_mm", "x0_hi90_mm", "y0_mm", "y0_lo90_mm", "y0_hi90_mm",
                        "x0_y0_correlation", "x0_y0_ellipse90", "flag"]
    assert table["touch"].tolist() == frames["touch"].tolist()
    assert np.hypot(table["x0_mm"] - place[:, 0], table["y0_mm"] - place[:, 1])[30:].mean() < 12
    again = surrogate.load(tmp_path / "model").predict(
        eitsim.read_recording(tmp_path / "frames.csv", kind="difference"))
    np.testing.assert_allclose(again["x0_mm"], table["x0_mm"], rtol=1e-5)
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        (tmp_path / "out.csv").write_text("earlier")
        assert run.invoke(app, ["predict", f"{tmp_path}/model", f"{tmp_path}/frames.csv", "--out",
                                f"{tmp_path}/out.csv"]).exit_code
        assert (tmp_path / "out.csv").read_text() == "earlier"
    for option in (["--scale-baseline", "no"], ["--rate", "20"]):
        refused = run.invoke(app, ["predict", f"{tmp_path}/model", f"{tmp_path}/frames.csv", *option])
        assert f"Leave out {option[0]}." in str(refused.exception)
    refused = run.invoke(app, ["export", f"{tmp_path}/model", "--out", f"{tmp_path}/network.pt"])
    assert "a model of a recording, whose presses alone it knows" in str(refused.exception)
    refused = run.invoke(app, ["train", f"{tmp_path}/frames.csv", "--out", f"{tmp_path}/other"])
    assert isinstance(refused.exception, ValueError)
    assert "which needs its labels: give --labels touches.csv" in str(refused.exception)


def test_what_was_not_taught_is_wider_than_what_was() -> None:
    presses, place = synthetic_presses(3, 200)
    left = np.flatnonzero(place[:, 0] < 0)[:30]
    reader = press_reader.fit(taken(presses, left), labels_at(place[left]))
    rest = np.setdiff1d(np.arange(200), left)
    found = reader.whole(taken(presses, rest)).place
    assert found
    assert reader.place
    grown = reader.place.near.widening(reader.place.direction.view.of(reader.signals.whole(taken(presses, rest))))
    half, x = found.bounds.half_width.mean(axis=1), place[rest, 0]
    assert grown[x > 25].mean() > 1.3 * grown[x < 0].mean()
    assert half[x > 25].mean() > 1.3 * half[x < 0].mean()
    inside = np.abs(found.value - place[rest]) <= found.bounds.half_width
    assert min(inside[x < 0].mean(), inside[x > 25].mean()) > 0.85
