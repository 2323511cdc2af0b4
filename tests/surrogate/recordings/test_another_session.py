"""A second session of a skin, synthetic: gains of readings, the untouched frame and the place of the skin on the table
have changed in ways that the model does not know; five labelled presses bring it up to date."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import eitsim
import surrogate
from eitsim.sensors.labels import Labels, labels_of
from surrogate.cli.main import app
from surrogate.model.recorded.continued import continued, label_shift
from surrogate.model.recorded.press_model import PressModel
from surrogate.recordings import press_reader
from surrogate.recordings.press_reader import PressReader, ScalarReading, read
from surrogate.recordings.presses import Presses, taken
from surrogate.recordings.session.motion import Motion, find_motion
from surrogate.recordings.worth import distance
from touchcal.arrays import Array

from .conftest import labels_at, short_networks
from .test_unlike_presses import against_rest, session

DRAWS = range(40, 50)


@pytest.fixture(scope="module")
def reader() -> PressReader:
    presses, place = against_rest(1, 80, *session(0, 0.0))
    with short_networks():
        return press_reader.fit(presses, labels_at(place))


def second(seed: int, *, gains: bool, moved: bool) -> tuple[Presses, Array]:
    """205 presses of a second session drawn by a seed, and their places on the table."""
    rng, (_, rest) = np.random.default_rng(seed), session(0, 0.0)
    gain = np.exp(gains * (0.3 * rng.standard_normal(208) + 0.4 * rng.standard_normal()))
    presses, place = against_rest(seed + 1000, 205, gain, rest * gain * (1 + 0.02 * rng.standard_normal(208)))
    motion = Motion(np.zeros(2), moved * rng.uniform(-np.pi, np.pi), moved * rng.uniform(-60, 60, 2))
    return presses, motion.of(place)


def brought_up(reader: PressReader, presses: Presses, place: Array) -> tuple[float, float, float]:
    """Distance of the presses after the first five, which teach; part of these without a flag; and part of the
    coordinates of these that intervals hold."""
    made = continued(reader, taken(presses, np.arange(5)), labels_at(place[:5])).reader
    found = read(made, taken(presses, np.arange(5, len(place))))
    assert found.place
    sound = found.kinds == 0
    inside = np.abs(found.place.value - place[5:]) <= found.place.bounds.half_width
    return distance(found.place.value, place[5:]), float(sound.mean()), float(inside[sound].mean())


@pytest.mark.thorough
@pytest.mark.parametrize(("gains", "moved", "most"), [(False, False, 1.3), (True, False, 1.3), (True, True, 1.5)])
def test_five_presses_bring_a_reader_up_to_date(reader: PressReader, gains: bool, moved: bool, most: float) -> None:
    presses, place = against_rest(2, 200, *session(0, 0.0))
    there = read(reader, presses).place
    assert there
    found = np.array([brought_up(reader, *second(seed, gains=gains, moved=moved)) for seed in DRAWS])
    assert found[:, 0].mean() <= most * distance(there.value, place)
    assert found[:, 1].mean() >= 0.9
    assert 0.85 <= found[:, 2].mean() <= 0.97


def test_a_motion_is_found_where_there_is_one_and_seldom_elsewhere() -> None:
    rng, false = np.random.default_rng(3), 0
    for _ in range(50):
        place, error = rng.uniform(-40, 40, (5, 2)), 2 * rng.standard_normal((5, 2))
        true = Motion(np.zeros(2), rng.uniform(-np.pi, np.pi), rng.uniform(-100, 100, 2))
        found, _ = find_motion(place + error, true.of(place), 40.0, 2.0)
        assert found
        at = rng.uniform(-40, 40, (200, 2))
        assert distance(found.of(at), true.of(at)) < 6
        false += find_motion(place + error, place, 40.0, 2.0)[0] is not None
    assert false <= 3


def test_a_motion_is_undone_and_turns_intervals(reader: PressReader) -> None:
    presses, _ = against_rest(5, 20, *session(0, 0.0))
    found, motion = read(reader, presses).place, Motion(np.array([3.0, 4.0]), np.pi / 2, np.array([10.0, 0.0]))
    assert found
    turned = motion.bounds(found.value, found.bounds)
    np.testing.assert_allclose(motion.back(motion.of(found.value)), found.value)
    np.testing.assert_allclose(turned.half_width, found.bounds.half_width[:, ::-1])
    np.testing.assert_allclose(turned.correlation, -found.bounds.correlation)


def test_too_few_presses_are_refused(reader: PressReader) -> None:
    presses, place = second(1, gains=False, moved=False)
    with pytest.raises(ValueError, match="4 labelled presses of the second session are too few; give 5 or more"):
        continued(reader, taken(presses, np.arange(4)), labels_at(place[:4]))
    with pytest.raises(ValueError, match="give x_mm and y_mm"):
        continued(reader, taken(presses, np.arange(5)), Labels(presses.name[:5], ("F_N",), place[:5, :1]))


def test_a_label_that_all_presses_read_too_low_is_raised_and_chance_is_not() -> None:
    rng, shifts = np.random.default_rng(8), []
    for step in (0.0, 1.25):
        for _ in range(20):
            depth, read_there = rng.uniform(13, 18, 5), 0.1 * rng.standard_normal(5)
            found = [ScalarReading("z_mm", np.array([value]), np.array([0.17])) for value in depth - step + read_there]
            shift, wider = label_shift("z_mm", Labels(np.arange(5).astype(np.str_), ("z_mm",), depth[:, None]), found)
            shifts.append(shift)
            assert 1 <= wider < 2
    assert np.abs(shifts[:20]).max() < 0.15
    np.testing.assert_allclose(shifts[20:], 1.25, atol=0.15)
    assert label_shift("F_N", Labels(np.array(["a"]), ("z_mm",), np.ones((1, 1))), found) == (0.0, 1.0)


def written(folder: Path, presses: Presses, labels: Labels) -> None:
    """A recording of presses, an untouched frame before each, and the labels of some."""
    frames = np.empty((2 * len(presses.name), presses.signal.shape[1]))
    frames[::2], frames[1::2] = presses.rest, presses.rest + presses.signal
    names = [name for touch in presses.name for name in ("", touch)]
    head = ",".join(f"v_{k:03d}" for k in range(frames.shape[1]))
    (folder / "frames.csv").write_text(f"touch,{head}\n" + "".join(
        f"{name},{','.join(f'{v:.9g}' for v in row)}\n" for name, row in zip(names, frames, strict=True)))
    (folder / "touches.csv").write_text("touch,x_mm,y_mm\n" + "".join(
        f"{name},{x},{y}\n" for name, (x, y) in zip(labels.touch, labels.values, strict=True)))


@pytest.mark.thorough
def test_the_command_writes_a_model_that_is_loaded(reader: PressReader, tmp_path: Path) -> None:
    presses, place = second(7, gains=True, moved=True)
    presses = Presses(*(getattr(presses, one)[:30] for one in ("name", "index", "signal", "following", "age", "rest",
                                                              "rest_time", "time")))
    written(tmp_path, presses, labels_of(labels_at(place), np.arange(5)))
    PressModel(reader, "voltage", 80, 80, 0, (), 1.0).save(tmp_path / "first")
    words = ["learn", str(tmp_path / "frames.csv"), "--labels", str(tmp_path / "touches.csv"), "--out",
             str(tmp_path / "made"), "--continue", str(tmp_path / "first")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "another session, by 5 labelled presses of it: the skin is turned by" in done.output
    assert len(done.output.splitlines()) < 10
    recording = eitsim.read_recording(tmp_path / "frames.csv", kind="voltage")
    made, first = (surrogate.load(tmp_path / name) for name in ("made", "first"))
    assert isinstance(made, PressModel)
    assert isinstance(first, PressModel)
    table = made.predict(recording)
    assert distance(table[["x0_mm", "y0_mm"]].to_numpy()[5:], place[5:30]) < 5
    assert "as in another session" in first.predict(recording)["flag"].iloc[0]
    refused = CliRunner().invoke(app, [*words, "--method", "ridge"])
    assert "leave out --sensor" in str(refused.exception)
