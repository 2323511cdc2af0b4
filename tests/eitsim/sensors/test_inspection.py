"""`sensor inspect`: real sensors with what their makers say of them, simulated ones with what they were given."""

import json
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

from eitsim.electrics.forward.small_touch import signal_by_touch
from eitsim.electrics.forward.untouched import untouched_readings
from eitsim.scene.channels import Channels
from eitsim.scene.drive import protocol
from eitsim.scene.scene import Scene
from eitsim.sensors.conventions import Convention
from eitsim.sensors.formats.open_file import open_recording
from eitsim.sensors.inspection import Inspection, inspect
from eitsim.sensors.inspection_words import cautions, document, pairs_as_read, questions, rows
from eitsim.sensors.recognition import canonical
from eitsim.sensors.recording import Recording, in_phase
from eitsim.sensors.sensor_file import Sensor, drive_of_pairs, pairs_of, read_sensor, sensor_from

REAL = Path(__file__).parents[4] / "shared" / "real"
real = pytest.mark.skipif(not REAL.exists(), reason="recordings of real sensors are not here")
Command = Callable[..., CompletedProcess[str]]


@lru_cache(maxsize=1)
def frame() -> np.ndarray:
    return untouched_readings(Scene(), 1e-3)


def recorded(*frames: np.ndarray, kind: str = "voltage") -> Recording:
    count = len(frames)
    return Recording(np.array(frames), np.arange(count), None, np.array([""] * count), kind, Path("frames.csv"))


@lru_cache(maxsize=16)
def inspected(name: str, *, with_sensor: bool) -> tuple[Inspection, Sensor]:
    sensor = read_sensor(REAL / name / "sensor.toml")
    recording = open_recording(REAL / name / "frames.csv", kind=sensor.kind if with_sensor else "voltage")
    return inspect(recording, sensor if with_sensor else None), sensor


@pytest.mark.thorough
@real
@pytest.mark.parametrize(("name", "sign"), [("hydrogel", "magnitude"), ("skin_radial", "unknown"),
                                            ("skin_carbon", "unknown")])
def test_real_skins_are_named_without_their_sensor_file(name: str, sign: str) -> None:
    found, sensor = inspected(name, with_sensor=False)
    order = found.identified.order
    assert order is not None
    assert canonical(order.pairs, order.count, False) == canonical(pairs_of(sensor), 16, False)
    assert found.identified.words()["pattern"] == "opposite"
    assert found.identified.sign == sign
    assert found.kind == ("magnitude" if name == "hydrogel" else "difference")


@real
def test_the_plain_skin_without_its_sensor_file_is_asked_with_the_true_order_first() -> None:
    found, sensor = inspected("skin_plain", with_sensor=False)
    assert found.identified.order is None
    assert found.identified.words()["pattern"] is None
    first = found.identified.plausible[0]
    assert canonical(first.pairs, first.count, False) == canonical(pairs_of(sensor), 16, False)
    assert any("opposite" in one for one in questions(found))


@pytest.mark.thorough
@real
@pytest.mark.parametrize("name", ["hydrogel", "skin_plain", "skin_radial", "skin_carbon", "tank"])
def test_real_sensors_agree_with_their_sensor_file(name: str) -> None:
    found, _ = inspected(name, with_sensor=True)
    assert found.agrees is True
    assert found.placed is None
    assert any(one.startswith("Where on the body is electrode 0") for one in questions(found))


@pytest.mark.thorough
@real
@pytest.mark.parametrize("pattern", ["skip-3", "skip-4", "skip-6"])
def test_a_wrong_sensor_file_is_not_confirmed_by_a_real_skin(pattern: str) -> None:
    """The plain skin's touches say least of its order."""
    drive = Convention(16, 16, int(pattern[-1]) + 1, "pair", 1, "undriven", False, 0, 1).pairs()
    sensor = sensor_from({"drive": drive_of_pairs(drive, 16), "readings": {"kind": "difference"}}, Path())
    assert inspect(open_recording(REAL / "skin_plain" / "frames.csv", kind="difference"), sensor).agrees is not True


@pytest.mark.thorough
@real
def test_the_tank_s_instrument_is_as_reciprocal_as_was_measured() -> None:
    found, _ = inspected("tank", with_sensor=True)
    assert found.identified.sign == "positive"
    assert found.repeat is not None
    assert found.repeat.least == pytest.approx(3e-5, abs=1e-5)
    assert found.source_against_sink is not None
    assert found.source_against_sink.least == pytest.approx(0.044, abs=0.001)
    assert found.source_against_sink.most == pytest.approx(0.098, abs=0.003)


@pytest.mark.thorough
@real
def test_the_hydrogel_s_readings_are_said_to_be_no_voltages_of_a_disc() -> None:
    found, _ = inspected("hydrogel", with_sensor=True)
    assert found.source_against_sink is not None
    assert found.source_against_sink.together == pytest.approx(1.18, abs=0.005)
    said = " ".join(cautions(found))
    assert "118 %" in said
    assert "No homogeneous disc explains" in said
    assert found.drift == pytest.approx(0.17, abs=0.02)


@real
def test_the_plain_skin_s_first_readings_belong_to_the_row_before() -> None:
    found, _ = inspected("skin_plain", with_sensor=True)
    assert found.late.tolist() == list(range(14))


def test_a_contradicted_sensor_file_is_said() -> None:
    sensor = sensor_from({"drive": {"pattern": "adjacent"}}, Path())
    allowed = inspect(recorded(frame()), sensor)
    assert allowed.agrees is None  # on an even ring drives may as well move the other way
    assert any("Is [drive] of the sensor file right? 1 other order" in one for one in questions(allowed))
    other = np.roll(frame().reshape(16, 13), 4, axis=1).ravel()  # begins four electrodes later
    found = inspect(recorded(other), sensor)
    assert found.agrees is False
    assert any("contradict [drive]" in one for one in cautions(found))


def test_unequal_electrodes_tell_where_they_lie_on_the_body() -> None:
    angles = [0, 20, 45, 70, 90, 110, 135, 160, 180, 205, 225, 250, 270, 295, 317, 338]
    sensor = sensor_from({"electrodes": {"angles_deg": angles}}, Path())
    there = untouched_readings(sensor.scene, 1e-3)
    assert inspect(recorded(there), sensor).placed == (1, 0)
    third_first = np.roll(angles, -3) + np.where(np.arange(16) < 13, 0, 360)
    moved = sensor_from({"electrodes": {"angles_deg": third_first.tolist()}}, Path())
    found = inspect(recorded(untouched_readings(moved.scene, 1e-3)), sensor)
    assert found.placed == (1, 3)
    assert any("electrode 3 of the sensor file" in one for one in questions(found))


def test_complex_readings_are_turned_to_their_phase() -> None:
    turned = frame() * np.exp(0.7j)
    np.testing.assert_allclose(np.abs(in_phase(turned[None])), np.abs(frame())[None], rtol=1e-12)
    assert inspect(recorded(turned)).identified.words()["pattern"] == "adjacent"


def test_readings_that_are_all_about_the_same_name_no_order() -> None:
    """28 magnitudes within 20 %: orders of 7 electrodes have more imperfections than there are readings."""
    few = recorded(1 + 0.2 * np.random.default_rng(4).random(28), kind="magnitude")
    found = inspect(few)
    assert found.identified.unexplained < 0.2
    assert found.identified.plausible == ()
    assert any(one.startswith("Which order do the readings have?") for one in questions(found))


def test_what_no_order_makes_is_asked_for() -> None:
    found = inspect(recorded(np.arange(1.0, 108.0)))
    assert (found.electrodes, found.identified.decided_by) == (None, "nothing")
    assert any("Give a sensor file with [drive] pairs" in one for one in questions(found))


@pytest.mark.parametrize(("readings", "kind", "words"), [
    (np.zeros(208), "voltage", "every reading is empty, 0 or never changes"),
    (-np.ones(208), "magnitude", "a reading is negative, and magnitudes are not"),
    (np.ones(40), "voltage", "40 readings a frame, and the sensor's drive makes 208")])
def test_frames_of_which_nothing_can_be_said_are_refused(readings: np.ndarray, kind: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        inspect(recorded(readings), sensor_from({"readings": {"kind": kind}}, Path()))


def test_the_command_prints_findings_and_one_json_object(command: Command, tmp_path: Path) -> None:
    (tmp_path / "frames.csv").write_text("touch," + ",".join(f"v_{k:03d}" for k in range(208)) + "\n,"
                                         + ",".join(map(str, frame())) + "\n", encoding="utf-8")
    (tmp_path / "sensor.toml").write_text('[drive]\npattern = "adjacent"\n', encoding="utf-8")
    words = command("eitsim", "sensor", "inspect", "frames.csv", "--sensor", "sensor.toml", cwd=tmp_path)
    assert words.returncode == 0, words.stderr
    assert "adjacent" in words.stdout
    assert "Where on the body is electrode 0" in words.stdout
    done = command("eitsim", "sensor", "inspect", "frames.csv", "--sensor", "sensor.toml", "--json", cwd=tmp_path)
    found = json.loads(done.stdout)
    assert (found["pattern"], found["sign"], found["electrodes"]) == ("adjacent", "positive", 16)
    assert found.keys() == document(inspect(recorded(frame()))).keys()
    assert len(found["questions"]) == 2


def test_the_command_refuses_a_file_of_another_sensor(command: Command, tmp_path: Path) -> None:
    (tmp_path / "frames.csv").write_text("1,2,3\n", encoding="utf-8")
    (tmp_path / "sensor.toml").write_text("", encoding="utf-8")
    done = command("eitsim", "sensor", "inspect", "frames.csv", "--sensor", "sensor.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "frames.csv, line 1: 3 readings a frame, and the model or the sensor's drive has 208" in done.stderr


def test_pairs_that_are_written_read_the_frame_as_it_is_either_sign(command: Command, tmp_path: Path) -> None:
    """Readings of EIDORS's default order, which begins at the same pair in each pattern, and their negatives."""
    pairs = Convention(16, 16, 1, "pair", 1, "undriven", False, 0, 1).pairs()
    sensor = sensor_from({"drive": drive_of_pairs(pairs, 16)}, Path())
    order = np.concatenate([np.flatnonzero(pairs[:, 0] == k)[np.argsort(pairs[pairs[:, 0] == k][:, 3])]
                            for k in range(16)])
    volts = untouched_readings(sensor.scene, 1e-3).ravel()[order]
    for sign in (1, -1):
        found = inspect(recorded(sign * volts))
        named = pairs_as_read(found)
        assert named is not None
        model = untouched_readings(sensor_from({"drive": drive_of_pairs(named, 16)}, Path()).scene, 1e-3).ravel()
        np.testing.assert_allclose(model, sign * volts, rtol=0, atol=1e-9 * np.abs(volts).max())
        assert dict(rows(found))["in a sensor file"] == '[drive] pairs = "pairs.csv", which --pairs pairs.csv writes'
    np.save(tmp_path / "frame.npy", -volts)
    done = command("eitsim", "sensor", "inspect", "frame.npy", "--pairs", "pairs.csv", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (tmp_path / "sensor.toml").write_text('[drive]\npairs = "pairs.csv"\n[readings]\nkind = "voltage"\n')
    np.testing.assert_array_equal(pairs_of(read_sensor(tmp_path / "sensor.toml")), named)
    np.save(tmp_path / "frames.npy", -np.array([volts, volts]))
    done = command("eitsim", "reconstruct", "frames.npy", "--scene", "sensor.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "this frame equals the untouched one" in done.stdout


def test_empty_frames_and_what_a_common_phase_leaves_out_are_said() -> None:
    empty = np.full(208, np.nan)
    assert any("1 frame without any reading, the first in row 1 from 0" in one
               for one in cautions(inspect(recorded(frame(), empty, frame()))))
    turned = frame() * np.exp(0.3j + 0.1j * np.where(np.arange(208) % 2, 1, -1))
    (said,) = (one for one in cautions(inspect(recorded(turned))) if "complex" in one)
    assert "9.9" in said or "10" in said


def test_rows_and_columns_that_look_exchanged_are_said() -> None:
    turned = np.stack([frame(), 1.01 * frame()], axis=1)
    assert any("are rows and columns exchanged?" in one for one in cautions(inspect(recorded(*turned))))
    assert not any("exchanged?" in one for one in cautions(inspect(recorded(frame()))))


@pytest.mark.parametrize("size", [0.005, 0.03])
def test_a_touch_among_untouched_frames_decides_no_direction(size: float) -> None:
    """An even ring does not tell the way of its drives, and a touch that is not marked is no imperfection of the sensor
    that would."""
    scene = Scene()
    rest = untouched_readings(scene, 1e-3)
    signal = signal_by_touch(scene.body, scene.electrodes, 1e-3, Channels(conductance_S=(1e-3,)),
                             protocol(scene.drive, 16), np.array([[0.03, 0.0]])).ravel()
    both = np.array([rest.ravel(), rest.ravel() + size * np.linalg.norm(rest) / np.linalg.norm(signal) * signal])
    found = inspect(Recording(both, np.arange(2), None, np.array(["", ""]), "voltage", Path("a.csv")))
    assert found.identified.words()["pattern"] == "adjacent"
    assert found.identified.words()["direction"] is None
