"""Ten thousand untouched frames whose noise grows with the reading are no touch, with a baseline file and without, and
where readings share it."""

import numpy as np
import pytest

from surrogate.data.samples import SweepSamples
from surrogate.model.model import Model
from surrogate.model.tracking.tracked import CALIBRATING, UNTOUCHED
from surrogate.model.tracking.tracker import Tracker
from touchcal.arrays import Array

FRAMES = 10_000


@pytest.mark.slow
@pytest.mark.parametrize("level_dB", [80, 60])
@pytest.mark.parametrize("given", [0, 200])
def test_proportional_noise_makes_no_touch(forward_model: Model, untouched_V: Array, given: int, level_dB: int) -> None:
    rng = np.random.default_rng(given + level_dB)
    frames = untouched_V * (1 + 10 ** (-level_dB / 20) * rng.normal(size=(FRAMES + given, len(untouched_V))))
    tracker = Tracker(forward_model, frames[:given] if given else None)
    states = [tracker.update(frame).state for frame in frames[given:]]
    assert states.count(CALIBRATING) == (0 if given else tracker.calibration - 1)
    assert set(states) <= {CALIBRATING, UNTOUCHED}


@pytest.mark.thorough
@pytest.mark.parametrize("given", [0, 20])
def test_white_noise_alone_is_no_drift(forward_model: Model, untouched_V: Array, given: int) -> None:
    """Twenty frames show shared noise that is none; what other frames say of it counts."""
    rng = np.random.default_rng(3)
    frames = untouched_V + 1e-4 * np.sqrt(np.mean(untouched_V**2)) * rng.normal(size=(300, len(untouched_V)))
    tracker = Tracker(forward_model, frames[:given] if given else None)
    assert {tracker.update(frame).flag for frame in frames[given:]} == {""}


def shared(kind: str, rng: np.random.Generator, frames: int, readings: int) -> Array:
    """(frames, readings) noise of variance 1, most of it shared."""
    own = rng.standard_normal((frames, readings))
    if kind == "current":
        return 0.8 * np.repeat(rng.standard_normal((frames, 16)), readings // 16, axis=1) + 0.6 * own
    if kind == "all":
        return 0.8 * rng.standard_normal((frames, 1)) + 0.6 * own
    for frame in range(1, frames):  # time
        own[frame] = 0.9 * own[frame - 1] + np.sqrt(1 - 0.9**2) * own[frame]
    return own


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["current", "all", "time"])
def test_shared_noise_makes_no_touch_and_hides_none(forward_model: Model, samples: SweepSamples, untouched_V: Array,
                                                    kind: str) -> None:
    """Noise of 0.05 % of each reading."""
    rng = np.random.default_rng(11)
    tracker = Tracker(forward_model)

    def states(volts: Array, frames: int) -> set[str]:
        noise = 5e-4 * shared(kind, rng, frames, len(volts))
        return {tracker.update(frame).state for frame in volts * (1 + noise)}

    assert states(untouched_V, FRAMES) == {CALIBRATING, UNTOUCHED}
    for signal in samples.signal_V[::20]:
        assert states(untouched_V + signal, 15) - {UNTOUCHED}
        states(untouched_V, 40)
