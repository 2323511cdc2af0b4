"""A method of surrogates is one file and one line of the registry."""

import doctest
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import surrogate
from eitsim.sensors.labels import Labels
from eitsim.sensors.recording import Recording
from surrogate.data.samples import SweepSamples, take
from surrogate.learners import base, registry
from surrogate.learners.registry import METHODS, Method
from surrogate.model.evaluate import evaluate
from surrogate.model.predict import predict, prepare
from surrogate.model.train import train
from surrogate.model.trained import estimate
from touchcal.code_version import ROOT, _code, _reached

TOY = '''
from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from numpy.typing import NDArray
from surrogate.learners.base import Learner, regression

@dataclass(frozen=True)
class Mean(Learner):
    value: NDArray[np.float64]
    variance: NDArray[np.float64]

    @classmethod
    def fit(cls, rows, training):
        target = rows.targets(training.names)
        return cls(target.mean(axis=0), target.var(axis=0))

    def estimate(self, signal_V, noise_V):
        return regression(np.tile(self.value, (len(signal_V), 1)), np.tile(self.variance, (len(signal_V), 1)))
'''
NEAR = '''
from __future__ import annotations
from dataclasses import dataclass
import numpy as np
from surrogate.learners.base import Learner, regression
from touchcal.arrays import Array

@dataclass(frozen=True)
class Near(Learner):
    signal: Array
    target: Array

    @classmethod
    def fit(cls, rows, training):
        return cls(rows.signal_V / np.linalg.norm(rows.signal_V, axis=1)[:, None], rows.targets(training.names))

    def estimate(self, signal_V, noise_V):
        apart = 1 - signal_V / np.linalg.norm(signal_V, axis=1)[:, None] @ self.signal.T
        weight = np.exp(-apart / 0.01)
        value = weight @ self.target / weight.sum(axis=1)[:, None]
        return regression(value, np.ones_like(value))
'''
LINE = Method("mean", "toy_learner:Mean", "mean of the training rows", "The mean of the training rows.")


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of the toy's module, which is registered."""
    (tmp_path / "toy_learner.py").write_text(TOY)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(METHODS, LINE.name, LINE)
    return tmp_path


def test_a_new_method_trains_stores_loads_predicts_and_is_scored(samples: SweepSamples, toy: Path) -> None:
    names = ("x0", "F")
    model = train(samples, "mean", names, seed=1)
    assert type(model.learner).__name__ == "Mean"
    trained = take(samples, np.isin(samples.row_hash, model.rows.row_hash[model.rows.part == 0])).targets(names)
    assert np.array_equal(estimate(model, samples.signal_V).value[0], trained.mean(axis=0))
    model.save(toy / "model")
    assert json.loads((toy / "model/model.json").read_text())["method"] == "mean"
    again = surrogate.load(toy / "model")
    assert type(again.learner) is type(model.learner)
    frames = samples.baseline_V[0] + samples.signal_V[:3]
    found = predict(prepare(again, samples.baseline_V[0]), frames)
    assert np.array_equal(found.value, np.tile(trained.mean(axis=0), (3, 1)))
    scores = evaluate(again, samples).scores
    assert scores["method"] == "mean"
    assert abs(scores["outputs"]["F"]["train"]["r2"]) < 1e-9


def test_a_new_method_learns_recorded_presses_too(samples: SweepSamples, monkeypatch: pytest.MonkeyPatch,
                                                  tmp_path: Path) -> None:
    """Weighted means of the training targets, by the nearness of signals: one file, one line."""
    (tmp_path / "near_learner.py").write_text(NEAR)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(METHODS, "near", Method("near", "near_learner:Near", "nearest rows", "The mean of near rows."))
    monkeypatch.setitem(sys.modules, "torch", None)  # families of networks are not needed
    names = np.array([f"t{k}" for k in range(60)])
    recording = Recording(samples.signal_V[:60], np.arange(60), None, names, "difference", tmp_path / "frames.csv")
    labels = Labels(names, ("x_mm", "y_mm", "F_N"), samples.target[:60, [0, 1, 3]])
    model = surrogate.learn(recording, labels, seed=1, method="near")
    assert (model.method, model.names) == ("near", ("x0", "y0"))
    assert "nothing to read here of F_N" in model.reader.left_out[0]
    assert {one.score.output: one.score.error < one.score.mean_error for one in model.tested}["place"]
    model.save(tmp_path / "model")
    again = surrogate.load(tmp_path / "model")
    new = replace(recording, readings=samples.signal_V[60:], index=np.arange(140), touch=np.full(140, "n"))
    pd.testing.assert_frame_equal(again.predict(new), model.predict(new))
    found = again.predict(new)
    held = (found["x0_lo90_mm"] <= samples.target[60:, 0]) & (samples.target[60:, 0] <= found["x0_hi90_mm"])
    assert 0.75 < held.mean() <= 1
    dead = new.readings.copy()
    dead[:, 3] = np.nan
    with pytest.warns(UserWarning, match="in 140 of 140 frames v_003 is dead and left out"):
        lacking = again.predict(replace(new, readings=dead))
    pd.testing.assert_series_equal(lacking["flag"], found["flag"])
    assert (lacking["x0_hi90_mm"] - lacking["x0_mm"] >= found["x0_hi90_mm"] - found["x0_mm"]).mean() > 0.9
    scores = surrogate.evaluate(again, replace(recording, source=tmp_path / "near_learner.py"), labels=labels).scores
    assert scores["outputs"]["x0"]["train"]["n"] == 60


def test_a_new_method_stands_in_the_help(toy: Path) -> None:
    code = ("from surrogate.learners.registry import METHODS, Method; import sys\n"
            f"METHODS['mean'] = {LINE!r}\n"
            "sys.argv = ['surrogate', 'train', '--help']\n"
            "import surrogate.cli.main; surrogate.cli.main.main()")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "mean of the training" in " ".join(done.stdout.replace("│", " ").split()), done.stderr


def test_an_unknown_method_is_refused_with_the_known(samples: SweepSamples) -> None:
    with pytest.raises(ValueError, match=f"'kriging' is unknown; known: {', '.join(METHODS)}"):
        train(samples, "kriging")


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_each_learner_is_where_its_line_says(method: Method) -> None:
    learner = method.learner()
    assert base.Learner in learner.__mro__
    assert f"{learner.__module__}:{learner.__name__}" == method.where


def test_the_hash_of_code_follows_the_registry() -> None:
    needed = {module for module, _ in _reached(_code(ROOT), ["surrogate.model.train"])}
    assert {method.where.partition(":")[0] for method in METHODS.values()} <= needed


def test_the_example_runs() -> None:
    assert doctest.testmod(base).failed == doctest.testmod(registry).failed == 0
