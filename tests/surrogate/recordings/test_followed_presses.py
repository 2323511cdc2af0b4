"""A model of a recording that follows a stream: synthetic presses, quick networks."""

from __future__ import annotations

import io

import numpy as np
import pytest

from surrogate.model.tracking.followed_presses import begun, followed
from surrogate.model.tracking.tracked import TOUCH, UNTOUCHED
from surrogate.model.tracking.tracked_stream import columns, track
from surrogate.model.tracking.tracker import Tracker
from surrogate.recordings import networks
from surrogate.recordings.trained import press_reader
from surrogate.recordings.trained.train_reader import TrainedReader
from touchcal.arrays import Array

from .conftest import labels_at, synthetic_places, synthetic_presses, synthetic_signal

REST = 30


@pytest.fixture(scope="module")
def model() -> TrainedReader:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(networks, "MOST_STEPS", 40)
        patch.setattr(networks, "HIDDEN", (32,))
        presses, place = synthetic_presses(1, 60, noise=0.05)
        reader = press_reader.fit(presses, labels_at(place))
    return TrainedReader(reader, "voltage", 60, 0, (), 0.0)


def stream(place: Array, noise: float) -> Array:
    """Frames: REST untouched ones, three presses of 20 frames at places (3, 2), each followed by 10 untouched."""
    rng, signal = np.random.default_rng(3), synthetic_signal(place, np.ones(len(place)))
    rest = np.zeros((1, signal.shape[1]))
    clean = np.concatenate([np.tile(rest, (REST, 1)), *(np.concatenate([np.tile(one, (20, 1)), np.tile(rest, (10, 1))])
                                                        for one in signal[:, None])])
    return 1.0 + clean + noise * np.abs(signal).mean() * rng.standard_normal(clean.shape)


def test_presses_are_found_and_read(model: TrainedReader) -> None:
    place = synthetic_places(np.random.default_rng(8), 3)
    said = [tracker.update(frame) for tracker in [Tracker(model)] for frame in stream(place, 0.1)]
    for number, true in enumerate(place):
        first = REST + 30 * number
        assert [now.state for now in said[first + 1:first + 20]] == [TOUCH] * 19
        assert [now.state for now in said[first + 22:first + 30]] == [UNTOUCHED] * 8
        last = said[first + 19]
        assert np.all(np.abs(1e3 * last.value[:2] - true) < 2 * 1e3 * last.below[:2])
        assert np.isnan(last.value[2:]).all()


def test_its_stream_has_places_alone(model: TrainedReader) -> None:
    place, sink = synthetic_places(np.random.default_rng(9), 3), io.StringIO()
    lines = "\n".join(",".join(map(repr, frame)) for frame in stream(place, 0.1).tolist())
    track(Tracker(model), model, io.BytesIO(lines.encode()), sink)
    head, *rows = [row.split(",") for row in sink.getvalue().splitlines()]
    assert head == columns(model) == ["line", "x0_mm", "x0_lo90_mm", "x0_hi90_mm", "y0_mm", "y0_lo90_mm", "y0_hi90_mm",
                                      "state", "flag"]
    low, value, high = (float(rows[REST + 10][k]) for k in (2, 1, 3))
    assert low < value < high


def test_the_scatter_of_readings_is_filtered_and_a_movement_is_followed() -> None:
    rng = np.random.default_rng(0)
    still = 3.0 * rng.standard_normal((400, 2))
    place, seen = begun(still[0]), []
    for reading in still[1:]:
        place = followed(place, reading, 0.02)
        seen.append(place.mean)
    assert np.sqrt(place.noise) == pytest.approx(3.0, rel=0.2)
    assert np.std(seen[100:]) < 0.6 * 3.0
    moving = begun(np.zeros(2))
    for k in range(1, 50):
        moving = followed(moving, np.full(2, 0.5 * k), 0.02)
    assert np.allclose(moving.mean, 24.5, atol=0.05)
