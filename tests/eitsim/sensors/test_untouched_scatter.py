"""Noise, lasting changes and what a touched less an untouched frame has of both, by untouched frames of every kind."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.companions import late_readings
from eitsim.sensors.recording import Recording
from eitsim.sensors.untouched_scatter import change_noise, drift, lasting, noise

LEVEL = np.exp(np.random.default_rng(0).normal(size=60))
SD = 1e-3


def scatter(kind: str, random: np.random.Generator, frames: int = 200) -> np.ndarray:
    """(frames, readings) of what is added to a level."""
    white, time = random.normal(size=(frames, LEVEL.size)), np.arange(frames)[:, None]
    if kind.startswith("ar"):
        lasts, out = float(kind[2:]), white.copy()
        for k in range(1, frames):
            out[k] = lasts * out[k - 1] + np.sqrt(1 - lasts**2) * white[k]
        return SD * out
    slow = {"white": 0.0, "ramp": 30 * (1 - np.exp(-time / 80)), "breath": 30 * np.sin(2 * np.pi * time / 20),
            "delays": 30 * np.sin(2 * np.pi * (time / 20 - np.arange(LEVEL.size) / LEVEL.size)),
            "walk": np.cumsum(2 * random.normal(size=white.shape), axis=0)}[kind]
    return SD * (white + slow)


def recording(values: np.ndarray, away: int = 1) -> Recording:
    """An untouched frame and `away` touched ones in turn."""
    touch = np.array(["a" if k % (away + 1) else "" for k in range(len(values))])
    return Recording(values, np.arange(len(values)), None, touch, "voltage", Path("a.csv"))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("kind", "expected"), [("white", 1.0), ("ramp", 1.0), ("breath", 1.0), ("delays", 1.0),
                                                ("walk", 1.4), ("ar0.5", 0.58), ("ar0.9", 0.23)])
def test_noise_is_the_floor_and_what_lasts_the_rest(kind: str, expected: float, seed: int) -> None:
    """expected: root of the spectral density at the highest frequency."""
    added = scatter(kind, np.random.default_rng(seed))
    values, size = LEVEL + added, np.sqrt(np.mean((LEVEL + added) ** 2))
    one, rest = noise(values), lasting(values)
    assert one is not None
    assert rest is not None
    assert 0.5 < one * size / (SD * expected) < 2
    assert np.hypot(one, rest) * size == pytest.approx(np.sqrt(np.mean(np.var(added, axis=0))), rel=0.3)
    assert not late_readings(values[1:] - values[0]).any()


@pytest.mark.parametrize("away", [1, 6])
@pytest.mark.parametrize("kind", ["white", "breath", "walk", "ar0.5", "ar0.9"])
def test_a_change_has_the_noise_of_frames_as_far_from_each_other(kind: str, away: int) -> None:
    added = scatter(kind, np.random.default_rng(3), 600)
    true = np.sqrt(np.mean((added[away:] - added[:-away]) ** 2))
    found = change_noise(recording(LEVEL + added, away), np.ones(LEVEL.size, dtype=bool))
    assert found is not None
    assert 0.5 < found / true < 2


def test_dead_channels_and_touches_that_are_not_marked_are_no_noise() -> None:
    random = np.random.default_rng(4)
    values, there = LEVEL + scatter("white", random, 400), np.arange(LEVEL.size) % 5 > 0
    values[:, ~there] = 0.0
    values[::20] += 1e3 * SD * random.normal(size=LEVEL.size)
    assert change_noise(recording(values, 2), there) == pytest.approx(np.sqrt(2) * SD, rel=0.1)
    size = np.sqrt(np.mean(values[:, there] ** 2))
    assert noise(np.where(there, values, np.nan)) == pytest.approx(SD / size, rel=0.15)


def test_a_map_of_the_readings_maps_their_noise() -> None:
    values, there = LEVEL + scatter("white", np.random.default_rng(5)), np.ones(LEVEL.size, dtype=bool)
    matrix = np.vstack([np.full((1, LEVEL.size), 1.0), np.zeros((1, LEVEL.size))])
    assert change_noise(recording(values), there, matrix) == pytest.approx(SD * np.sqrt(LEVEL.size), rel=0.2)


def test_steps_of_a_converter_hide_what_is_less() -> None:
    step = 10 * SD
    values = step * np.round((LEVEL + scatter("white", np.random.default_rng(6), 40)) / step)
    found = noise(values)
    assert found is not None
    assert 0.5 < found * np.sqrt(np.mean(values**2)) / (step / np.sqrt(12)) < 2


def test_few_frames_say_nothing() -> None:
    values = LEVEL + scatter("white", np.random.default_rng(7), 3)
    assert noise(values) is not None
    assert change_noise(recording(values), LEVEL > 0) is not None
    assert (noise(values[:2]), lasting(values[:2]), drift(values[:2])) == (None, None, None)
    assert change_noise(recording(values[:2]), LEVEL > 0) is None


def test_drift_is_from_the_first_frames_to_the_last() -> None:
    values = LEVEL * (1 + np.linspace(0, 0.1, 500)[:, None])
    assert drift(values) == pytest.approx(0.09, rel=0.1)
