from dataclasses import replace

import numpy as np
import pytest

from surrogate.data.samples import SweepSamples, take
from surrogate.model.train import train
from surrogate.model.trained import estimate, interval_scale
from surrogate.statistics.conformal import COVERAGE, normal


@pytest.fixture(scope="module")
def inner(samples: SweepSamples) -> SweepSamples:
    """Touches away from the rim, which take the least time to learn."""
    return take(samples, np.hypot(*samples.target[:, :2].T) < 40)


def peaked(samples: SweepSamples) -> SweepSamples:
    """Touches whose signals are scaled so that their norm grows and falls again with F, with its top at 0.06 N/mm d."""
    d, force = samples.target[:, 2:4].T
    load, size = force / (0.06 * d), np.linalg.norm(samples.signal_V, axis=1)
    return replace(samples, signal_V=samples.signal_V * (1e-3 * load * np.exp(1 - load) / size)[:, None])


def test_the_top_of_the_signal_and_forces_of_one_amplitude_are_found_for_each_diameter(inner: SweepSamples) -> None:
    found = train(peaked(inner), "forward", ("x0", "F"), 1).learner.amplitude()
    assert found is not None
    assert [one["d_mm"] for one in found["diameters"]] == pytest.approx([10, 12, 14, 16, 18], abs=0.3)
    for one in found["diameters"]:
        assert one["peak_N"] == pytest.approx(0.06 * one["d_mm"], abs=0.06)
        low, high = one["two_answers_N"]
        rms = np.interp([low, high], found["force_N"], one["rms_V"])
        assert rms[0] == pytest.approx(rms[1], rel=0.05)
        assert low == found["force_N"][0] or high == found["force_N"][-1]


def test_outputs_of_two_answers_have_intervals_no_narrower_than_their_likely_punches(inner: SweepSamples) -> None:
    """Most calibrating rows are sure of their branch; a factor below the normal one that they gave would draw the
    interval of a frame in doubt from the branch on which it ends."""
    names = ("x0", "y0", "F", "delta_max")
    for samples, twice in ((peaked(inner), True), (inner, False)):
        model = train(samples, "forward", names, 1)
        assert list(model.learner.branched(names)) == [False, False, twice, twice]
        sure = replace(model, calibration=replace(model.calibration, target=estimate(
            model, model.calibration.signal_V, 0.0).value))
        factor = interval_scale(sure, 0.0).factor[0]
        assert np.all(factor[:2] < 0.01)
        assert np.all(factor[2:] >= normal(COVERAGE)) == twice


def test_a_signal_that_only_grows_has_no_top(inner: SweepSamples) -> None:
    found = train(inner, "forward", ("x0", "F"), 1).learner.amplitude()
    assert found is not None
    assert [one["peak_N"] for one in found["diameters"]] == [None] * 5
    assert all(np.all(np.diff(one["rms_V"]) > 0) for one in found["diameters"])


def test_methods_without_a_map_tell_no_amplitude(inner: SweepSamples) -> None:
    assert train(inner, "ridge", ("x0", "F"), 1).learner.amplitude() is None
