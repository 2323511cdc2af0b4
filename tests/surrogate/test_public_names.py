"""The public names of surrogate: light to import, and enough to train, keep, score and use a model."""

import doctest
import inspect
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch

import eitsim
import matcal
import surrogate
from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.dataset.parquet import read_dataset
from surrogate.data.baseline_frame import untouched
from surrogate.data.samples import SweepSamples
from surrogate.learners.registry import METHODS
from surrogate.live.export_page import export_page
from surrogate.model.predict import columns
from touchcal.arrays import Array

from .conftest import baseline, draw
from .recordings.conftest import short_networks

NAMES = ("x0", "F", "sigma_max", "A_c")


def test_the_names_are_those_that_are_listed() -> None:
    assert surrogate.__all__ == ["Estimate", "Labels", "Learner", "METHODS", "Model", "PressModel", "SetModel", "Skin",
                                 "SweepModel", "TouchMap", "TouchSets", "Tracked", "Tracker", "Training", "cramer_rao",
                                 "evaluate", "learn", "learn_session", "learn_sets", "load", "read_labels",
                                 "read_touch_sets", "touch_map", "train"]
    assert all(getattr(surrogate, name) is not None for name in surrogate.__all__)
    assert surrogate.METHODS is METHODS


def test_importing_the_package_imports_nothing_heavy() -> None:
    heavy = ("numpy", "scipy", "pandas", "torch", "typer")
    code = f"import sys, surrogate; sys.exit(any(name in sys.modules for name in {heavy}))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.fixture(scope="module")
def model(sweep: Path) -> surrogate.Model:
    return surrogate.train(sweep, "ridge", NAMES, seed=1)


def test_a_folder_a_data_set_and_its_rows_train_the_same(model: surrogate.Model, sweep: Path,
                                                         samples: SweepSamples) -> None:
    for data in (read_dataset(sweep), samples):
        again = surrogate.train(data, "ridge", "A_c, sigma_max,F,x0", seed=1)
        assert again.names == NAMES
        assert np.array_equal(again.learner.estimate(samples.signal_V, 0.0).value,
                              model.learner.estimate(samples.signal_V, 0.0).value)


def test_predictions_are_in_si_and_those_of_the_command(model: surrogate.Model, samples: SweepSamples,
                                                        tmp_path: Path, command: Callable[..., Any]) -> None:
    frames, baseline = samples.baseline_V[:5] + samples.signal_V[:5], samples.baseline_V[0]
    model.save(tmp_path / "model")
    found = surrogate.load(tmp_path / "model").predict(frames, baseline)
    pd.DataFrame(np.vstack([baseline, frames])).to_csv(tmp_path / "frames.csv", index=False, header=False)
    assert not command("surrogate", "predict", "model", "frames.csv", "--out", "out.csv", cwd=tmp_path).returncode
    written = pd.read_csv(tmp_path / "out.csv", keep_default_na=False)
    assert list(found) == [c.replace("_mm2", "_m2").replace("_mm", "_m").replace("_kPa", "_Pa")
                           for c in columns(model)[1:]]
    for ours, theirs, per in (("x0_m", "x0_mm", 1e3), ("F_N", "F_N", 1), ("sigma_max_Pa", "sigma_max_kPa", 1e-3),
                              ("A_c_hi90_m2", "A_c_hi90_mm2", 1e6)):
        assert np.allclose(found[ours] * per, written[theirs].astype(float), rtol=1e-4)
    assert found["flag"].tolist() == written["flag"].tolist()


def test_one_frame_serves_and_noise_follows_from_untouched_frames(model: surrogate.Model,
                                                                  samples: SweepSamples) -> None:
    baseline, frame = samples.baseline_V[0], samples.baseline_V[0] + samples.signal_V[0]
    several = baseline + 1e-4 * np.random.default_rng(0).normal(size=(50, len(baseline)))
    quiet, loud = model.predict(frame), model.predict(frame, several)
    assert len(quiet) == 1
    few = several[:5]
    stated = model.predict(frame, few.mean(axis=0), noise_V=untouched(few).noise_V)
    pd.testing.assert_frame_equal(model.predict(frame, few), stated)  # of so few frames the noise is one number
    assert not loud.equals(model.predict(frame, several.mean(axis=0)))
    pd.testing.assert_frame_equal(quiet, model.predict(frame, model.baseline_V, noise_V=0.0))



def test_wrong_frames_are_refused_and_a_strange_baseline_is_cautioned(model: surrogate.Model,
                                                                      samples: SweepSamples) -> None:
    with pytest.raises(ValueError, match=r"frames_V has the shape \(7,\); expected \(n, 208\)"):
        model.predict(np.zeros(7))
    with pytest.raises(ValueError, match="finite number of volts"):
        model.predict(samples.baseline_V[:1], noise_V=-1.0)
    with pytest.warns(UserWarning, match="other sign"):
        model.predict(samples.baseline_V[:1], -samples.baseline_V[0])


def test_a_folder_is_scored_as_its_rows_are(model: surrogate.Model, sweep: Path, samples: SweepSamples) -> None:
    by_folder, by_rows = (surrogate.evaluate(model, data, noise_dB=[80]).scores for data in (sweep, samples))
    assert by_folder["outputs"] == by_rows["outputs"]
    assert by_folder["noise"] == by_rows["noise"]


def test_other_data_are_refused(tmp_path: Path, sweep: Path) -> None:
    with pytest.raises(ValueError, match="no such folder"):
        surrogate.train(tmp_path / "none")
    data = read_dataset(sweep)
    vars(data)["table"] = data.table.assign(outcome="refused")
    with pytest.raises(ValueError, match=r"data set.*none of its .* rows is ok"):
        surrogate.train(data)


@pytest.fixture
def folder(forward_model: surrogate.Model, sweep: Path, tmp_path: Path) -> Path:
    """What the examples read: a data set, models, a card, and synthetic recordings with their labels."""
    forward_model.save(tmp_path / "model")
    (tmp_path / "sweep").symlink_to(sweep)
    (tmp_path / "scene.toml").write_text("[punch]\nx_mm = 20\nforce_N = 0.5\n[accuracy]\nsignal = 0.05\n")
    matcal.write_card(matcal.MaterialCard("foam", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"), None,
                                          matcal.Conductivity(30.0, [-2, 2, -1], (0, 0.4))), tmp_path / "card.json")
    touch, signal = draw(40, 1, (14.0,))
    record(tmp_path / "frames.csv", [str(one) for one in range(40)], signal)
    labels = pd.DataFrame({"touch": range(40), "x_mm": touch[:, 0], "y_mm": touch[:, 1]})
    labels.to_csv(tmp_path / "touches.csv", index=False)
    one, other = signal[0], signal[1]
    record(tmp_path / "two_places.csv", [str(number) for number in range(12)], [one, other, one + other] * 4)
    down = [f"{number},{place}" for number in range(12) for place in ("A", "B", "AB")[number % 3]]
    (tmp_path / "places.csv").write_text("\n".join(["touch,place", *down]))
    recording = eitsim.read_recording(tmp_path / "frames.csv")
    known = surrogate.read_labels(tmp_path / "touches.csv")
    with short_networks():
        surrogate.learn(recording, known).save(tmp_path / "presses")
    return tmp_path


def record(path: Path, touches: list[str], signal: Iterable[Array]) -> None:
    """Write presses between untouched frames, with noise."""
    rng, rows = np.random.default_rng(0), []
    for touch, one in zip(touches, signal, strict=True):
        for name, change in (("", 0.0), (touch, one)):
            rows.append([len(rows), name, *(baseline() + change + 1e-5 * rng.standard_normal(208))])
    pd.DataFrame(rows, columns=["index", "touch", *voltage_columns(208)]).to_csv(path, index=False)


@pytest.mark.slow
def test_every_function_has_an_example_that_runs(folder: Path, samples: SweepSamples,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    given = {"np": np, "torch": torch, "eitsim": eitsim, "matcal": matcal, "surrogate": surrogate,
             "export_page": export_page, "baseline_V": samples.baseline_V[0],
             "frames_V": samples.baseline_V[:5] + samples.signal_V[:5]}
    finder, runner = doctest.DocTestFinder(), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    with short_networks():
        for thing in (surrogate, export_page, eitsim.frames, *(getattr(surrogate, name) for name in surrogate.__all__)):
            if callable(thing) or thing is surrogate:
                tried = sum(runner.run(test).attempted for test in finder.find(thing, globs=dict(given)))
                assert tried or not inspect.isfunction(thing), thing
    assert runner.summarize(verbose=False).failed == 0
