"""Frames between which a channel's gain drifted: read with and without counting it, and named."""

from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pandas as pd
import pytest

import surrogate
from surrogate.data.frame_drift import by_gain, frame_drift
from surrogate.data.samples import SweepSamples
from surrogate.learners.novelty import fit_novelty, one_column
from surrogate.model.drift_choice import drift_groups
from touchcal.arrays import Array

GAIN, NOISE_V = 1e-3, 2e-6


@pytest.fixture(scope="module")
def model(forward_model: surrogate.Model) -> surrogate.Model:
    return forward_model


@pytest.fixture(scope="module")
def touches(synthetic: Callable[..., tuple[Array, Array]]) -> tuple[Array, Array]:
    return synthetic(24, 77)


def frames_of(model: surrogate.Model, signal: Array, gain: Array) -> Array:
    """Frames (n, readings) whose channels have changed by gains (n, electrodes), with noise."""
    clean = model.baseline_V + signal + gain @ by_gain(model.ring, model.baseline_V).T
    return clean + NOISE_V * np.random.default_rng(0).standard_normal(clean.shape)


def one_channel(count: int) -> tuple[Array, Array]:
    channel = np.arange(count) % 16
    return channel, GAIN * np.where(np.arange(count) % 2, 1, -1)[:, None] * np.eye(16)[channel]


def place_error(table: pd.DataFrame, touch: Array) -> Array:
    return np.hypot(table["x0_m"] * 1e3 - touch[:, 0], table["y0_m"] * 1e3 - touch[:, 1]).to_numpy()


@pytest.mark.slow
def test_a_counted_drift_costs_little_and_intervals_hold(model: surrogate.Model,
                                                         touches: tuple[Array, Array]) -> None:
    touch, signal = touches
    frames = frames_of(model, signal, one_channel(len(touch))[1])
    free = model.predict(frames_of(model, signal, np.zeros((len(touch), 16))), noise_V=NOISE_V)
    blind = model.predict(frames, noise_V=NOISE_V)
    counted = model.predict(frames, noise_V=NOISE_V, gain_drift=GAIN)
    off, with_drift, without = (np.sqrt(np.mean(place_error(one, touch) ** 2)) for one in (blind, counted, free))
    assert off > 3 * with_drift
    assert with_drift < 2 * without
    inside = (counted["F_lo90_N"] <= touch[:, 3]) & (touch[:, 3] <= counted["F_hi90_N"])
    assert inside.mean() >= 0.8


def test_no_gain_one_gain_and_all_gains_are_parted(model: surrogate.Model, touches: tuple[Array, Array]) -> None:
    drift, rng = frame_drift(model.ring, model.baseline_V, GAIN), np.random.default_rng(4)
    channel, one = one_channel(8)
    gain = np.concatenate([np.zeros((8, 16)), one, GAIN * rng.standard_normal((8, 16))])
    signal = frames_of(model, touches[1], gain) - model.baseline_V
    span = fit_novelty(model.ring, model.calibration.signal_V)
    share = np.empty((24, 16))  # of the stated standard deviation that each gain of a frame keeps
    seen = []
    for rows, root in drift_groups(drift, span, signal, NOISE_V):
        share[rows] = np.linalg.norm(root, axis=0) / np.linalg.norm(drift.gain, axis=0)
        seen += rows.tolist()
    assert sorted(seen) == list(range(24))
    assert np.all(share[:8] < 0.2)
    assert np.array_equal(share[8:16] > 0.9, np.eye(16)[channel] == 1)
    assert np.all(share[16:] > 0.99)


@pytest.mark.slow
def test_no_drift_leaves_answers_as_they_are(model: surrogate.Model, touches: tuple[Array, Array]) -> None:
    frames = frames_of(model, touches[1], np.zeros((24, 16)))
    plain, none = (model.predict(frames, noise_V=NOISE_V, gain_drift=gain) for gain in (0.0, 1e-12))
    values = ["x0_m", "y0_m", "F_N"]
    assert np.allclose(plain[values], none[values], rtol=1e-3, atol=1e-5)


def test_no_gain_explains_a_signal_that_leaves_nothing_to_explain(model: surrogate.Model) -> None:
    span = fit_novelty(model.ring, model.calibration.signal_V)
    gain = frame_drift(model.ring, model.baseline_V, GAIN).gain
    reversed_V = -model.calibration.signal_V  # strange by its sign alone
    assert not one_column(span, reversed_V, gain, 0.0)[2].any()


@pytest.mark.thorough
def test_the_channel_of_a_strange_frame_is_named(model: surrogate.Model, touches: tuple[Array, Array]) -> None:
    channel, gain = one_channel(24)
    flags = model.predict(frames_of(model, touches[1], 5 * gain), noise_V=NOISE_V)["flag"]
    named = [f"gain of channel {k} (from 0) had drifted" in flag for k, flag in zip(channel, flags, strict=True)]
    assert np.mean(named) > 0.7
    assert not any("gain of channel" in flag for flag in model.predict(
        frames_of(model, touches[1], 0 * gain), noise_V=NOISE_V)["flag"])


def test_other_methods_say_that_they_know_no_drift(samples: SweepSamples, touches: tuple[Array, Array]) -> None:
    ridge = surrogate.train(samples, method="ridge", outputs="x0,y0,F", seed=0)
    with pytest.raises(ValueError, match="`method` forward does"):
        ridge.predict(ridge.baseline_V + touches[1], gain_drift=GAIN)


@pytest.mark.slow
def test_the_command_counts_drift(model: surrogate.Model, touches: tuple[Array, Array], tmp_path: Path,
                                  command: Callable[..., CompletedProcess[str]]) -> None:
    model.save(tmp_path / "model")
    frames = frames_of(model, touches[1][:4], one_channel(4)[1])
    np.savetxt(tmp_path / "frames.csv", np.vstack([model.baseline_V, frames]), delimiter=",")
    words = ("predict", "model", "frames.csv", "--noise-V", NOISE_V)
    done = command("surrogate", *words, "--drift", "gain=0.001", "--out", "found.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rest = model.predict(frames, model.baseline_V, noise_V=NOISE_V, gain_drift=GAIN)
    assert np.allclose(pd.read_csv(tmp_path / "found.csv")["x0_mm"], rest["x0_m"] * 1e3, rtol=1e-3)
    for drift, named in (("gain=a", "'gain=a' holds no number"), ("contact=0.1,gain", "'gain' holds no number"),
                         ("gains=0.1", "'gains=0.1' is not known"), ("contact=0.01", "--scene"),
                         ("gain=0.1,gain=0.2", "'gain=0.2' names gain again")):
        refused = command("surrogate", *words, "--drift", drift, cwd=tmp_path)
        assert refused.returncode == 2
        assert named in refused.stderr
