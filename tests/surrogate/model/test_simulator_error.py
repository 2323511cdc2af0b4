from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from surrogate.data.samples import STATED_PER_SD, SweepSamples, read_samples, take
from surrogate.model.model import Model
from surrogate.model.predict import predict, prepare
from surrogate.model.train import train

ERROR = 0.01
RESULTS = Path(__file__).parents[3] / "benchmarks" / "results"


def learned(samples: SweepSamples, error: float, method: str) -> Model:
    """A model of touches away from the rim, whose simulator states this error of its signals."""
    inner = take(samples, np.hypot(*samples.target[:, :2].T) < 45)
    return train(replace(inner, signal_sd=np.full(len(inner), error)), method, ("x0", "F"), 1)


def held(model: Model, samples: SweepSamples) -> tuple[float, float]:
    """The part of forces in their 90 % intervals where signals are off by ERROR, and the median half width, N."""
    inner = take(samples, np.hypot(*samples.target[:, :2].T) < 45)
    off = ERROR * np.random.default_rng(5).normal(size=(len(inner), 1))
    found = predict(prepare(model, model.baseline_V), model.baseline_V + inner.signal_V * (1 + off))
    error = found.value[:, 1] - inner.target[:, 3]
    return (float(np.mean((error <= found.below[:, 1]) & (-error <= found.above[:, 1]))),
            float(np.median(found.half_width[:, 1])))


@pytest.mark.slow
def test_the_simulators_own_error_is_in_the_intervals(samples: SweepSamples) -> None:
    """Without it forces that a simulator one per cent off stands for lie outside their intervals."""
    assert held(learned(samples, 0.0, "forward"), samples)[0] < 0.6
    assert held(learned(samples, ERROR, "forward"), samples)[0] >= 0.85


def test_methods_without_a_covariance_count_it_by_their_calibration(samples: SweepSamples) -> None:
    assert held(learned(samples, ERROR, "ridge"), samples)[1] > held(learned(samples, 0.0, "ridge"), samples)[1]


def test_the_error_is_that_of_the_training_rows(samples: SweepSamples, make_dataset: Callable[..., Path],
                                                tmp_path: Path) -> None:
    assert np.all(samples.signal_sd == 0)
    stated = np.linspace(0.001, 0.02, 30)
    np.testing.assert_allclose(read_samples(make_dataset(tmp_path / "set", 30, 4, signal_error=stated)).signal_sd,
                               stated / STATED_PER_SD)
    assert learned(samples, ERROR, "forward").record["training"]["simulator_error"] == pytest.approx(ERROR)


@pytest.mark.slow
def test_signals_may_be_taken_for_exact(samples: SweepSamples) -> None:
    stated = replace(samples, signal_sd=np.full(len(samples), ERROR))
    assert train(stated, "forward", "F", 1, exact_signals=True).record["training"]["simulator_error"] == 0


def test_what_a_row_states_is_as_many_standard_deviations_as_finer_meshes_found() -> None:
    measured = pd.read_csv(RESULTS / "touch_errors.csv").query("profile == 'flat'")
    assert len(measured) >= 25
    part = measured["signal_error"] / measured["signal_estimate"]
    assert np.sqrt(np.mean(part**2)) == pytest.approx(1 / STATED_PER_SD, rel=0.1)
