"""A model of a recording that follows a stream: synthetic presses, quick networks."""

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surrogate
from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Body, Electrodes
from eitsim.sensors.recording import Recording, read_recording, write_recording
from surrogate.data.skin_edges import Circle
from surrogate.data.skin_from_above import skin_of
from surrogate.live.messages import frame
from surrogate.live.pictured import pictured
from surrogate.live.serve import Show
from surrogate.live.shows import recorded_show, streamed_show
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.tracking.followed_presses import begun, followed, row_of
from surrogate.model.tracking.followed_reading import TOO_WEAK
from surrogate.model.tracking.tracked import TOUCH, UNTOUCHED
from surrogate.model.tracking.tracked_stream import track
from surrogate.model.tracking.tracker import Tracker
from surrogate.recordings import press_reader
from surrogate.recordings.press_reader import ScalarReading
from touchcal.arrays import Array

from .conftest import labels_at, short_networks, synthetic_places, synthetic_presses, synthetic_signal

REST = 30


@pytest.fixture(scope="module")
def model() -> PressModel:
    with short_networks():
        presses, place = synthetic_presses(1, 60, noise=0.05)
        reader = press_reader.fit(presses, labels_at(place))
    return PressModel(reader, "voltage", 60, 60, 0, (), 0.0)


@pytest.fixture(scope="module")
def with_forces() -> PressModel:
    """Presses labelled with their place and how strong they are."""
    with short_networks():
        presses, place = synthetic_presses(1, 60, noise=0.05)
        size = np.linalg.norm(presses.signal, axis=1)
        force = size / np.linalg.norm(synthetic_signal(place, np.ones(len(place))), axis=1)
        reader = press_reader.fit(presses, labels_at(place, F_N=force, depth_mm=2 * force))
    return PressModel(reader, "voltage", 60, 60, 0, (), 0.0)


def stream(place: Array, noise: float) -> Array:
    """Frames: REST untouched ones, three presses of 20 frames at places (3, 2), each followed by 10 untouched."""
    rng, signal = np.random.default_rng(3), synthetic_signal(place, np.ones(len(place)))
    rest = np.zeros((1, signal.shape[1]))
    clean = np.concatenate([np.tile(rest, (REST, 1)), *(np.concatenate([np.tile(one, (20, 1)), np.tile(rest, (10, 1))])
                                                        for one in signal[:, None])])
    return 1.0 + clean + noise * np.abs(signal).mean() * rng.standard_normal(clean.shape)


def messages_of(show: Show) -> list[dict[str, Any]]:
    """What the page is sent."""
    return [json.loads(frame(k, moment, show.read(moment), show.hello, "", 0.0))
            for k, moment in enumerate(show.moments)]


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["line", "surface"])
def test_the_page_draws_the_outline_of_the_sensor_where_the_model_knows_it(model: PressModel, tmp_path: Path,
                                                                           kind: str) -> None:
    body = Body(Outline("rectangle", width_m=0.12, height_m=0.08, holes_m=((0.04, 0.0, 0.005),)))
    patches = {"x_m": (-0.02, 0.0, -0.02, 0.0), "y_m": (-0.02, -0.02, 0.02, 0.02)} if kind == "surface" else {}
    electrodes = Electrodes(kind=kind, count=4, width_m=0.008, **patches)
    replace(model, skin=skin_of(body.outline, electrodes)).save(tmp_path)
    skin = pictured(surrogate.load(tmp_path)).document()
    assert (len(skin["loops_mm"]), len(skin["electrodes"]), skin["circle_mm"]) == (2, 4, None)
    assert skin["box_mm"] == [-60, -40, 60, 40]
    model.save(tmp_path)
    assert surrogate.load(tmp_path).skin is None


def test_the_page_shows_what_a_model_of_a_recording_reads(model: PressModel) -> None:
    place = synthetic_places(np.random.default_rng(8), 3)
    lines = "".join(",".join(map(repr, frame.tolist())) + "\n" for frame in stream(place, 0.1))
    show = streamed_show(model, io.BufferedReader(io.BytesIO(lines.encode())))  # type: ignore[arg-type]
    skin = pictured(model)
    assert show.hello["values"] == ["x_mm", "y_mm"]
    assert show.hello["skin"]["electrodes"] == []
    edge = skin.edges
    assert isinstance(edge, Circle)
    assert np.linalg.norm(place - edge.centre_mm, axis=1).max() < edge.radius_mm
    sent = messages_of(show)
    read = sent[REST + 15]["read"]
    assert np.hypot(read["x_mm"] - place[0, 0], read["y_mm"] - place[0, 1]) < 0.1 * edge.radius_mm
    assert sent[REST - 2]["read"] is None
    assert sent[REST + 15]["ellipse"]["long_mm"] > 0


def drifting(path: Path, place: Array) -> Path:
    """A recording of presses at places (n, 2), an untouched frame before each, that drifts by twice a touch's signal
    from one press to the next, so that presses are read only against the untouched frames next to them."""
    signal = synthetic_signal(place, np.ones(len(place)))
    way = np.random.default_rng(4).standard_normal(signal.shape[1]) * 2 * np.abs(signal).mean()
    rest = 1.0 + np.arange(2 * len(place))[:, None] / 2 * way
    frames = rest + np.where(np.arange(2 * len(place)) % 2, 1.0, 0.0)[:, None] * np.repeat(signal, 2, axis=0)
    touch = np.array([name for k in range(len(place)) for name in ("", str(k))])
    write_recording(Recording(frames, np.arange(len(frames)), None, touch, "voltage", path), path)
    return path


def test_presses_that_a_recording_marks_are_shown_as_its_table_has_them(with_forces: PressModel,
                                                                        tmp_path: Path) -> None:
    path = drifting(tmp_path / "frames.csv", synthetic_places(np.random.default_rng(8), 6))
    table = with_forces.predict(read_recording(path))
    show = recorded_show(with_forces, path, rate_hz=1000.0)
    sent = messages_of(show)
    assert [one["state"] for one in sent] == [UNTOUCHED, TOUCH] * 6
    assert [one["time_s"] for one in sent[:3]] == [0.0, 0.001, 0.002]
    read = [one["read"] for one in sent[1::2]]
    for name, column in (("x_mm", "x0_mm"), ("y_mm", "y0_mm"), ("F_N", "F_N"), ("depth_mm", "depth_mm")):
        np.testing.assert_allclose([one[name] for one in read], table[column], atol=2e-6)
    np.testing.assert_allclose([one["half_width"]["depth_mm"] for one in sent[1::2]],
                               table["depth_hi90_mm"] - table["depth_mm"], atol=2e-6)
    assert sent[1]["difference"][0] == pytest.approx(1e3 * synthetic_signal(
        synthetic_places(np.random.default_rng(8), 6)[:1], np.ones(1))[0, 0], rel=1e-3, abs=1e-3)


def test_a_rate_next_to_a_clock_is_refused(model: PressModel, tmp_path: Path) -> None:
    path = drifting(tmp_path / "frames.csv", synthetic_places(np.random.default_rng(8), 2))
    recording = read_recording(path)
    write_recording(replace(recording, time_s=np.arange(4.0)), path)
    with pytest.raises(ValueError, match="has a clock, time_s, so that `rate` would have no effect"):
        recorded_show(model, path, rate_hz=2.0)


def test_readings_of_a_board_have_no_unit(model: PressModel) -> None:
    assert pictured(model).unit == "mV"
    assert pictured(replace(model, kind="magnitude")).unit == ""


@pytest.mark.thorough
def test_presses_are_found_and_read(model: PressModel) -> None:
    place = synthetic_places(np.random.default_rng(8), 3)
    said = [tracker.update(frame) for tracker in [Tracker(model)] for frame in stream(place, 0.1)]
    for number, true in enumerate(place):
        first = REST + 30 * number
        assert [now.state for now in said[first + 1:first + 20]] == [TOUCH] * 19
        assert [now.state for now in said[first + 22:first + 30]] == [UNTOUCHED] * 8
        last = said[first + 19]
        assert np.all(np.abs(1e3 * last.value[:2] - true) < 2 * 1e3 * last.below[:2])
        assert np.isnan(last.value[2:]).all()


def test_a_stream_says_once_what_a_dead_channel_costs_and_flags_nothing(model: PressModel) -> None:
    frames = stream(synthetic_places(np.random.default_rng(8), 1), 0.02)[:REST + 15]
    frames[:, 9] = np.nan
    said: list[str] = []
    tracker = Tracker(model, noise_V=1e-3, say=said.append)
    now = [tracker.update(frame) for frame in frames]
    assert len(said) == 1
    assert said[0].startswith("v_009 is dead and left out")
    assert {one.flag for one in now[:REST]} == {""}
    touch, frames = np.concatenate([np.full(REST, ""), np.full(5, "t")]), frames[:REST + 5]
    table = model.predict(Recording(frames, np.arange(len(frames)), None, touch, "voltage", Path("x.csv")), said.append)
    assert now[REST + 1].state == TOUCH
    assert now[REST + 1].flag == table["flag"][1] == ""
    assert 1e3 * now[REST + 1].below[0] == pytest.approx(table["x0_hi90_mm"][1] - table["x0_mm"][1], rel=0.1)


@pytest.mark.thorough
def test_its_stream_has_places_alone(model: PressModel) -> None:
    place, sink = synthetic_places(np.random.default_rng(9), 3), io.StringIO()
    lines = "\n".join(",".join(map(repr, frame)) for frame in stream(place, 0.1).tolist())
    track(Tracker(model), io.BytesIO(lines.encode()), sink)
    head, *rows = [row.split(",") for row in sink.getvalue().splitlines()]
    assert head == ["line", "x0_mm", "x0_lo90_mm", "x0_hi90_mm", "y0_mm", "y0_lo90_mm", "y0_hi90_mm",
                                      "state", "flag"]
    low, value, high = (float(rows[REST + 10][k]) for k in (2, 1, 3))
    assert low < value < high


@pytest.mark.thorough
def test_forces_and_depths_are_in_its_stream_and_in_python(with_forces: PressModel) -> None:
    place, sink = synthetic_places(np.random.default_rng(9), 3), io.StringIO()
    frames = stream(place, 0.02)
    lines = "\n".join(",".join(map(repr, frame)) for frame in frames.tolist())
    track(Tracker(with_forces), io.BytesIO(lines.encode()), sink)
    head, *rows = [row.split(",") for row in sink.getvalue().splitlines()]
    assert head[7:13] == ["F_N", "F_lo90_N", "F_hi90_N", "depth_mm", "depth_lo90_mm", "depth_hi90_mm"]
    row = [float(cell) for cell in rows[REST + 10][7:13]]
    assert row[1] < row[0] < row[2]
    assert row[0] == pytest.approx(1.0, abs=0.3)
    assert row[3] == pytest.approx(2.0, abs=0.6)
    now = [tracker.update(frame) for tracker in [Tracker(with_forces)] for frame in frames][REST + 10]
    assert now.value[3] == pytest.approx(row[0], rel=1e-4)
    assert now.value[3] - now.below[3] == pytest.approx(row[1], rel=1e-4)
    assert np.isnan(now.value[2])


def test_a_touch_weaker_than_any_trained_one_has_no_values(model: PressModel) -> None:
    frames = stream(synthetic_places(np.random.default_rng(8), 1), 0.01)
    frames = np.concatenate([frames[:REST], 0.9 * frames[:REST].mean(axis=0) + 0.1 * frames[REST:]])
    said = [tracker.update(frame) for tracker in [Tracker(model)] for frame in frames]
    weak = [now for now in said[REST:REST + 20] if now.state == TOUCH]
    assert weak
    for now in weak:
        assert np.isnan(now.value).all()
        assert now.row is None
        assert now.flag == TOO_WEAK


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


def test_lower_ends_of_sizes_and_forces_end_at_0_and_those_of_places_go_on() -> None:
    force, height = (ScalarReading(name, np.array([0.1]), np.array([0.4])) for name in ("F_N", "z_mm"))
    row = row_of(np.array([1.0, -2.0]), np.array([3.0, 3.0]), (force, height)).reshape(4, 3)
    np.testing.assert_allclose(row, [[1, -2, 4], [-2, -5, 1], [0.1, 0, 0.5], [0.1, -0.3, 0.5]])
