"""A method of surrogates is one file and one line of the registry."""

from __future__ import annotations

import doctest
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import surrogate
from surrogate.data.samples import Samples, take
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
LINE = Method("mean", "toy_learner:Mean", "mean of the training rows", "The mean of the training rows.")


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of the toy's module, which is registered."""
    (tmp_path / "toy_learner.py").write_text(TOY)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(METHODS, LINE.name, LINE)
    return tmp_path


def test_a_new_method_trains_stores_loads_predicts_and_is_scored(samples: Samples, toy: Path) -> None:
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


def test_a_new_method_stands_in_the_help(toy: Path) -> None:
    code = ("from surrogate.learners.registry import METHODS, Method; import sys\n"
            f"METHODS['mean'] = {LINE!r}\n"
            "sys.argv = ['surrogate', 'train', '--help']\n"
            "import surrogate.cli.main; surrogate.cli.main.main()")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "mean of the training" in " ".join(done.stdout.replace("│", " ").split()), done.stderr


def test_an_unknown_method_is_refused_with_the_known(samples: Samples) -> None:
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
