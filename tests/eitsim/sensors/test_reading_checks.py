"""Checks without a model: each says what was put in, and nothing of a perfect instrument."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors import reading_checks
from eitsim.sensors.recording import Recording

# Two currents between electrodes 0 and 2, exchanged, one of them twice, and one that 1 and 3 drive.
DRIVES = [(0, 2), (2, 0), (0, 2), (1, 3)]
PAIRS = np.array([(source, sink, k + 1, k) for source, sink in DRIVES for k in range(3)])


def frame(seed: int = 0) -> np.ndarray:
    """Readings of a reciprocal body at 1 A."""
    random = np.random.default_rng(seed).normal(size=(4, 4))
    z = random + random.T
    return np.array([z[p, s] - z[p, k] - z[m, s] + z[m, k] for s, k, p, m in PAIRS])


def recording(readings: np.ndarray) -> Recording:
    return Recording(readings, np.arange(len(readings)), None, np.array([""] * len(readings)), "voltage", Path("a.csv"))


def test_a_perfect_instrument_repeats_and_is_reciprocal() -> None:
    one = np.ones(len(PAIRS))
    for check in (reading_checks.repeats, reading_checks.source_against_sink):
        found = check(frame()[None], PAIRS, one, signed=True)
        assert found is not None
        assert found.most == pytest.approx(0, abs=1e-12)


def test_repeats_are_as_far_apart_as_they_were_made() -> None:
    values = frame()
    values[6:9] *= 1.03
    found = reading_checks.repeats(values[None], PAIRS, np.ones(len(PAIRS)), signed=True)
    assert found is not None
    assert (found.most, found.compared) == (pytest.approx(0.03), 1)


def test_currents_are_divided_out() -> None:
    current = np.repeat([1.0, 2.0, 3.0, 1.0], 3)
    found = reading_checks.repeats((frame() * current)[None], PAIRS, current, signed=True)
    assert found is not None
    assert found.most == pytest.approx(0, abs=1e-12)


def test_source_against_sink_of_voltages_counts_the_electrodes_voltages() -> None:
    """0.1 V more of one reading is 0.1 V more of all electrodes after it."""
    values = frame()
    values[3] += 0.1
    found = reading_checks.source_against_sink(values[None], PAIRS, np.ones(len(PAIRS)), signed=True)
    voltage = np.cumsum([0, *frame()[:3]])
    step = np.array([0, 0.1, 0.1, 0.1])
    assert found is not None
    assert found.most == pytest.approx(np.linalg.norm(step - step.mean()) / np.linalg.norm(voltage - voltage.mean()))
    magnitudes = reading_checks.source_against_sink(np.abs(values)[None], PAIRS, np.ones(len(PAIRS)), signed=False)
    assert magnitudes is not None
    assert magnitudes.most == pytest.approx(abs(abs(values[3]) - abs(values[0])) / np.linalg.norm(values[:3]))


def test_reciprocity_compares_drive_and_measurement_exchanged() -> None:
    pairs = np.array([(0, 1, 2, 3), (3, 2, 0, 1), (0, 2, 1, 3)])
    found = reading_checks.reciprocity(np.array([[1.0, -1.1, 5.0]]), pairs, np.ones(3), signed=True)
    assert found is not None
    assert (found.together, found.compared) == (pytest.approx(0.1), 1)
    assert reading_checks.reciprocity(np.ones((1, 2)), pairs[1:], np.ones(2), signed=True) is None


def test_dead_channels_and_electrodes() -> None:
    values = np.random.default_rng(2).normal(size=(12, len(PAIRS)))
    values[:, 3] = np.nan
    values[:, 4] = 0.0
    values[:, 5] = 0.7
    dead = reading_checks.dead_readings(recording(values))
    assert np.flatnonzero(dead).tolist() == [3, 4, 5]
    few = reading_checks.dead_readings(recording(values[:2]))
    assert np.flatnonzero(few).tolist() == [3, 4]  # of few bits: the same value twice is no fault
    uses_3 = (PAIRS[:, 2:] == 3).any(axis=1)
    uses = [(PAIRS[:, 2:] == k).any(axis=1) for k in range(4)]
    assert reading_checks.dead_electrodes(uses_3, uses) == {3: 1.0}
    assert reading_checks.dead_electrodes(np.zeros(len(PAIRS), bool), uses) == {}
    twice = recording(np.tile(values[:1, :3], (20, 1)))
    assert not reading_checks.dead_readings(twice).any()


def test_electrodes_are_silent_whose_readings_off_driven_electrodes_are_small_against_a_model() -> None:
    """Of 8 electrodes read by neighbours, those at electrode 3 are a hundredth; driven readings do not count."""
    pairs = np.array([(0, 1, k, (k + 1) % 8) for k in range(8)] + [(4, 5, k, (k + 1) % 8) for k in range(8)])
    model = np.random.default_rng(0).uniform(1, 2, len(pairs))
    at = (pairs[:, 2:] == 3).any(axis=1)
    off = ~(pairs[:, :2, None] == pairs[:, None, 2:]).any(axis=(1, 2))
    values = 7 * np.where(at & off, 0.01, 1.0) * model
    assert reading_checks.silent_electrodes(values, model, pairs, 8) == [3]
    assert reading_checks.silent_electrodes(7 * model, model, pairs, 8) == []
    assert reading_checks.silent_electrodes(np.full(16, np.nan), model, pairs, 8) == []


def test_frames_in_which_a_channel_was_lost_are_left_out_and_readings_near_zero_are_not_lost() -> None:
    readings = frame() + 5 + 1e-3 * np.random.default_rng(4).normal(size=(30, len(PAIRS)))
    readings[4, 2], readings[9, 5], readings[:, 7] = 0.0, 0.0, 0.0  # two drop-outs, and a channel that is dead
    readings[:, 8] = np.linspace(-1, 1, 30).round(1)
    found, dropped = reading_checks.without_drop_outs(recording(readings))
    assert dropped == 2
    assert found.index.tolist() == [k for k in range(30) if k not in (4, 9)]
