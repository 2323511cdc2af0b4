"""Presses unlike those of training, synthetic: of another session, stronger, noisier, against another untouched frame.
Frames without a flag are held, and few of the same session have one."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.sensors.labels import Labels
from surrogate.model.recorded import plain_reader
from surrogate.recordings import press_reader
from surrogate.recordings.press_reader import PressReader, read
from surrogate.recordings.presses import Presses, taken
from surrogate.statistics.unlikeness import ELSEWHERE
from touchcal.arrays import Array

from .conftest import labels_at, short_networks, synthetic_presses

SIZE = 6.0  # of an untouched reading, over the mean size of a touched one's change


def against_rest(seed: int, count: int, gain: Array, rest: Array) -> tuple[Presses, Array]:
    """Presses of a session in which each reading has a gain, an untouched frame before each of them."""
    presses, place = synthetic_presses(seed, count)
    rng = np.random.default_rng(seed + 50)
    frames = rest + 0.05 * rng.standard_normal((count, len(rest)))
    return replace(presses, signal=presses.signal * gain, age=np.ones(count), rest=frames,
                   rest_time=np.arange(0.0, 2 * count, 2), time=np.arange(1.0, 2 * count, 2)), place


def session(seed: int, change: float) -> tuple[Array, Array]:
    """Gains and the untouched frame of a session in which both have changed by so much."""
    known, new = np.random.default_rng(7), np.random.default_rng(seed)
    rest = SIZE * (1 + 0.5 * known.random(208))
    return 1 + change * new.standard_normal(208), rest * (1 + 0.3 * change * new.standard_normal(208))


@pytest.fixture(scope="module")
def reader() -> PressReader:
    presses, place = against_rest(1, 80, *session(0, 0.0))
    with short_networks():
        return press_reader.fit(presses, labels_at(place))


def held(reader: PressReader, presses: Presses, place: Array) -> tuple[float, float, float]:
    """Part of the frames without a flag, part of these whose coordinates the intervals hold, and part of all frames
    that are wrong in silence: without a flag, a coordinate farther off than twice its half width."""
    found = read(reader, presses)
    assert found.place
    sound = np.array([not flag for flag in found.flag])
    off = np.abs(found.place.value - place) / found.place.bounds.half_width
    return (float(sound.mean()), float((off <= 1)[sound].mean()) if sound.any() else 1.0,
            float(np.mean(sound & (off > 2).any(axis=1))))


def test_the_same_session_is_held_and_seldom_flagged(reader: PressReader) -> None:
    for seed in (2, 3):
        sound, inside, _ = held(reader, *against_rest(seed, 200, *session(0, 0.0)))
        assert sound >= 0.95
        assert 0.85 <= inside <= 0.97


@pytest.mark.parametrize("change", [0.2, 0.5, 1.0])
def test_another_session_of_the_map_is_flagged_or_held(reader: PressReader, change: float) -> None:
    found = np.array([held(reader, *against_rest(seed, 200, session(seed, change)[0], session(0, 0.0)[1]))
                      for seed in range(11, 27)])
    assert found[:, 1].mean() >= 0.85
    assert found[:, 2].mean() <= 0.05


def test_another_untouched_frame_is_said(reader: PressReader) -> None:
    presses, _ = against_rest(21, 30, *session(21, 1.0))
    assert all("untouched frame is unlike those of training" in flag for flag in read(reader, presses).flag)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["white", "proportional", "pattern"])
@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
def test_noise_that_training_had_not_is_flagged_or_held(reader: PressReader, kind: str, size: float) -> None:
    found = []
    for seed in range(4, 14):
        presses, place = against_rest(seed + 27, 200, *session(0, 0.0))
        rng = np.random.default_rng(seed)
        noise = {"white": rng.standard_normal((200, 208)),
                 "proportional": session(0, 0.0)[1] / SIZE * rng.standard_normal((200, 208)),
                 "pattern": np.repeat(rng.standard_normal((200, 16)), 13, axis=1)}[kind]
        noise = size * np.abs(presses.signal).mean() * noise
        found.append(held(reader, replace(presses, signal=presses.signal + noise), place))
    assert np.mean(found, axis=0)[1] >= 0.85
    assert np.mean(found, axis=0)[2] <= 0.05


def forces(seed: int, count: int, least: float, most: float) -> tuple[Presses, Labels]:
    """Forces at one place on 16 plain channels, whose signal is not quite linear in the force."""
    rng = np.random.default_rng(seed)
    force = least + (most - least) * rng.random(count)
    shape = np.random.default_rng(9).standard_normal((2, 16))
    signal = np.tanh(force / 4)[:, None] * shape[0] + (force / 8)[:, None] ** 2 * shape[1]
    presses = Presses(np.arange(count).astype(np.str_), np.arange(count),
                      signal + 0.01 * rng.standard_normal(signal.shape), np.full_like(signal, np.nan), np.zeros(count),
                      signal[:0], np.zeros(0), np.arange(float(count)))
    return presses, Labels(presses.name, ("F_N",), force[:, None])


def test_forces_above_the_trained_ones_are_flagged_or_held() -> None:
    with short_networks():
        reader = press_reader.fit(*forces(1, 150, 0.1, 3.0))
    presses, labels = forces(2, 400, 0.1, 6.0)
    found, force = read(reader, presses), labels.values[:, 0]
    sound = np.array([not flag for flag in found.flag])
    inside = np.abs(found.scalars[0].value - force) <= found.scalars[0].half_width
    assert np.mean(sound[force < 3]) >= 0.95
    assert not sound[force > 3.5].any()
    assert inside[sound].mean() >= 0.85


def test_single_frames_are_read_without_their_recording(reader: PressReader) -> None:
    presses, _ = against_rest(11, 60, session(11, 1.0)[0], session(0, 0.0)[1])
    whole, (one,) = read(reader, presses).place, (read(reader, taken(presses, np.array([5]))).place,)
    assert whole
    assert one
    np.testing.assert_allclose(one.value[0], whole.value[5])
    assert whole.bounds.half_width[5, 0] >= one.bounds.half_width[0, 0]


def test_readers_without_places_widen_for_another_session_as_those_of_places_do() -> None:
    """All presses of a noisier one by one factor, next to what each is widened by itself."""
    taught, (presses, _) = forces(3, 100, 0.1, 3.0), forces(4, 60, 0.2, 2.9)
    noise = 0.01 * np.random.default_rng(5).standard_normal(presses.signal.shape)
    presses = replace(presses, signal=presses.signal + noise)
    with short_networks():
        readers = press_reader.fit(*taught), plain_reader.fit("ridge", *taught)
    for one in readers:
        together = read(one, presses).scalars[0].half_width[:9]
        alone = [read(one, taken(presses, np.array([row]))).scalars[0].half_width[0] for row in range(9)]
        factor = together / np.array(alone)
        np.testing.assert_allclose(factor, factor[0])
        assert 1.05 < factor[0] <= ELSEWHERE + 1e-9
