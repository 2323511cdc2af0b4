"""Measured data sets: the clean rows and what is asked for, part by part; resumed alike, never mixed."""

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from eitsim.cli import main
from eitsim.electrics.forward.untouched import by_contact, conductance_of, untouched_readings
from eitsim.scene.drive import voltage_columns
from eitsim.scene.scene import Scene, scene_from
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.measurement.instrument import Measurement, measured
from eitsim.sweeps.measurement.instrument_table import measurement_from, read_measurement
from eitsim.sweeps.measurement.noise_summary import NoiseSummary, in_words
from eitsim.sweeps.run.measure import measure
from touchcal.errors import InputFileError

SENSOR, SHEET_S, ROWS = Scene(), 6e-4, 20
NOISY = {"seed": 5, "snr_db": 70, "relative_to": "largest", "bits": 20, "full_scale_V": 5.0}


@pytest.fixture
def clean(tmp_path: Path) -> Path:
    """Rows of one sensor, the last one refused, in parts of 8; baselines as of one sheet conductance."""
    folder = tmp_path / "clean"
    folder.mkdir()
    parquet.write_manifest(folder, {"design": asdict(design_from({"scenes": ROWS})), "card": {"name": "a"}})
    draw = np.random.default_rng(2)
    baseline = untouched_readings(SENSOR, SHEET_S)
    rows = []
    for scene in range(ROWS):
        dv = draw.normal(0, 0.01, 208) if scene < ROWS - 1 else np.full(208, np.nan)
        rows.append(dict.fromkeys(parquet.FIXED, 0.5) | {
            "scene": scene, "outcome": "ok" if scene < ROWS - 1 else "refused"}
            | dict(zip(voltage_columns(208), baseline + dv, strict=True))
            | dict(zip(voltage_columns(208, "dv"), dv, strict=True)))
    for first in range(0, ROWS, 8):
        parquet.write_part(folder, rows[first:first + 8])
    return folder


def done(clean: Path, folder: Path, **terms) -> NoiseSummary:
    return NoiseSummary(**measure(clean, folder, measurement_from(terms)).manifest["measured"])


class _Ended(Exception):
    """Ends a measurement from its progress."""


def volts(folder: Path, prefix: str) -> np.ndarray:
    return parquet.read_dataset(folder).ok[voltage_columns(208, prefix)].to_numpy()


def test_a_measured_set_is_the_clean_one_with_the_terms_asked_for(clean: Path, tmp_path: Path) -> None:
    told = done(clean, tmp_path / "noisy", **NOISY)
    touched, signal = volts(clean, "v"), volts(clean, "dv")
    expected = measured(measurement_from(NOISY), touched, touched - signal, np.arange(ROWS - 1))
    assert np.array_equal(volts(tmp_path / "noisy", "dv"), expected.signal_V)
    assert np.array_equal(volts(tmp_path / "noisy", "v"), expected.touched_V)
    table = parquet.read_dataset(tmp_path / "noisy").table
    assert table["outcome"].tolist() == ["ok"] * (ROWS - 1) + ["refused"]
    same = [name for name in table.columns if not name.startswith(("v_", "dv_")) and name != "clipped"]
    pd.testing.assert_frame_equal(table[same], parquet.read_dataset(clean).table[same])
    assert told.rows == ROWS - 1
    assert told.clipped == 0
    assert told.signal_error_V == pytest.approx(np.sqrt(np.mean((expected.signal_V - signal)**2)), rel=1e-12)


def test_without_a_term_no_bit_changes(clean: Path, tmp_path: Path) -> None:
    assert done(clean, tmp_path / "same", seed=9).signal_error_V == 0
    table = parquet.read_dataset(tmp_path / "same").table.drop(columns="clipped")
    pd.testing.assert_frame_equal(table, parquet.read_dataset(clean).table, check_exact=True)


def test_the_noise_is_told_of_every_voltage(clean: Path, tmp_path: Path) -> None:
    told = done(clean, tmp_path / "noisy", **NOISY)
    largest = float(np.abs(untouched_readings(SENSOR, SHEET_S)).max())
    assert told.reference_V == pytest.approx(largest, rel=1e-12)
    assert told.noise_V == pytest.approx(largest * 10**-3.5, rel=1e-12)
    assert told.signal_noise_V == pytest.approx(np.sqrt(2) * told.noise_V, rel=1e-12)
    assert told.signal_error_V == pytest.approx(told.signal_noise_V, rel=4 / np.sqrt(2 * 208 * (ROWS - 1)))
    words = in_words(told)
    assert "70.0 dB below the largest untouched reading" in words
    below_signal = 20 * np.log10(told.signal_rms_V / told.signal_noise_V)
    assert f"{below_signal:.1f} dB below the signals' rms" in words
    manifest = parquet.read_manifest(tmp_path / "noisy")
    assert manifest["measurement"] == NOISY
    assert manifest["measured"]["noise_V"] == told.noise_V


def test_a_stopped_measurement_goes_on_and_keeps_its_parts(clean: Path, tmp_path: Path) -> None:
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    told = done(clean, whole, **NOISY)

    def end(rows: int) -> None:
        assert rows == 8
        raise _Ended

    with pytest.raises(_Ended):
        measure(clean, stopped, measurement_from(NOISY), progress=end)
    (first,) = parquet.parts(stopped)
    stood = first.stat().st_mtime_ns
    assert done(clean, stopped, **NOISY) == told
    assert first.stat().st_mtime_ns == stood
    for one, other in zip(parquet.parts(whole), parquet.parts(stopped), strict=True):
        assert one.name == other.name
        assert one.read_bytes() == other.read_bytes()


def test_contact_impedances_are_of_the_sheet_that_the_frames_tell(clean: Path, tmp_path: Path) -> None:
    assert conductance_of(SENSOR, untouched_readings(SENSOR, SHEET_S)) == pytest.approx(SHEET_S, rel=1e-6)
    terms = {"seed": 5, "contact_impedance": 0.05}
    done(clean, tmp_path / "varied", **terms)
    touched, signal = volts(clean, "v"), volts(clean, "dv")
    slopes = by_contact(SENSOR.body, SENSOR.electrodes, SENSOR.drive, SHEET_S)
    wanted = measured(measurement_from(terms), touched, touched - signal, np.arange(ROWS - 1), by_contact_V=slopes)
    changed, expected = volts(tmp_path / "varied", "dv") - signal, wanted.signal_V - signal
    assert np.linalg.norm(changed - expected) < 0.01 * np.linalg.norm(expected)
    assert np.abs(expected).max() > 1e-5


@pytest.mark.parametrize(("electrodes", "drive"), [
    ({}, {"pattern": "opposite"}), ({"count": 8}, {"pattern": "opposite", "reading": "differential"}),
    ({"count": 8}, {"pattern": "skip-2"}), ({"count": 8, "missing": [3]}, {"pattern": "adjacent"})])
def test_the_sheet_is_told_by_frames_of_every_pattern(electrodes: dict, drive: dict) -> None:
    """Opposite currents leave readings that symmetry makes 0, but for rounding."""
    sensor = scene_from({"electrodes": electrodes, "drive": drive})
    assert conductance_of(sensor, untouched_readings(sensor, SHEET_S)) == pytest.approx(SHEET_S, rel=1e-6)


def test_other_frames_than_the_sensors_are_refused(clean: Path, tmp_path: Path) -> None:
    manifest = json.loads((clean / parquet.MANIFEST).read_text())
    manifest["design"]["tables"] = {"electrodes": {"width_mm": 20.0}}
    (clean / parquet.MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(InputFileError, match="not made with them"):
        done(clean, tmp_path / "a", contact_impedance=0.05)
    manifest["design"]["tables"] = {"electrodes": {"contact_impedance_Ohm_m": {"choice": [1.0, 2.0]}}}
    (clean / parquet.MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(InputFileError, match=r"contact_impedance_Ohm_m in \[electrodes\] varies"):
        done(clean, tmp_path / "a", contact_impedance=0.05)
    assert done(clean, tmp_path / "b", noise_V=1e-3).rows == ROWS - 1
    assert not (tmp_path / "a").exists()


def test_a_measurement_is_of_the_parts_that_it_began_with_and_of_one_code(clean: Path, tmp_path: Path) -> None:
    def add(rows: int) -> None:
        if rows == 8:
            last = parquet.read_part(parquet.parts(clean)[-1])
            parquet.write_table(parquet.part_path(clean, 24), last.assign(scene=last["scene"] + 8))

    measure(clean, tmp_path / "noisy", measurement_from(NOISY), progress=add)
    assert len(parquet.parts(tmp_path / "noisy")) == len(parquet.parts(clean)) - 1
    parquet.parts(clean)[-1].unlink()
    manifest = parquet.read_manifest(tmp_path / "noisy")
    parquet.write_manifest(tmp_path / "noisy", manifest | {"measured_by": "older"})
    with pytest.raises(ValueError, match="measured by other code or libraries"):
        done(clean, tmp_path / "noisy", **NOISY)


def test_folders_are_not_mixed(clean: Path, tmp_path: Path) -> None:
    folder = tmp_path / "noisy"
    done(clean, folder, **NOISY)
    with pytest.raises(ValueError, match=r"was measured with .*'snr_db': 70"):
        done(clean, folder, noise_V=1e-3)
    with pytest.raises(InputFileError, match="measured already"):
        done(folder, tmp_path / "twice", **NOISY)
    with pytest.raises(ValueError, match="the clean data set itself"):
        done(clean, clean, **NOISY)
    with pytest.raises(ValueError, match="lies inside the clean data set"):
        done(clean, clean / "sub" / "measured", **NOISY)
    assert not (clean / "sub").exists()
    other = tmp_path / "other"
    other.mkdir()
    parquet.write_manifest(other, parquet.read_manifest(clean))
    with pytest.raises(ValueError, match="a sweep's own rows"):
        done(clean, other, **NOISY)
    before = hashlib.sha256(b"".join(path.read_bytes() for path in parquet.parts(folder))).hexdigest()
    parquet.parts(clean)[-1].unlink()
    with pytest.raises(ValueError, match="from other rows"):
        done(clean, folder, **NOISY)
    assert hashlib.sha256(b"".join(path.read_bytes() for path in parquet.parts(folder))).hexdigest() == before


def test_of_a_damaged_set_nothing_is_begun(clean: Path, tmp_path: Path) -> None:
    part = parquet.parts(clean)[-1]
    whole = part.read_bytes()
    part.write_bytes(whole[:100] + bytes([whole[100] ^ 1]) + whole[101:])
    with pytest.raises(InputFileError, match="the part is damaged"):
        done(clean, tmp_path / "noisy", **NOISY)
    assert not (tmp_path / "noisy").exists()


USUAL = NoiseSummary(rows=9, baseline_rms_V=1.0, baseline_largest_V=2.0, signal_rms_V=0.01, noise_V=1e-4,
                     reference_V=None, signal_noise_V=1.4e-4, signal_error_V=1.4e-4, step_V=1e-3, clipped=3,
                     clipped_share=0.002)


@pytest.mark.parametrize(("terms", "caution"), [
    ({"noise_V": 0.0, "signal_noise_V": 0.0, "signal_error_V": 0.0}, "these rows are the clean ones"),
    ({"noise_V": 1e9}, "larger than every untouched reading"),
    ({"clipped_share": 0.5}, "give a full_scale_V above 2 V")])
def test_what_is_seldom_meant_is_cautioned(terms: dict[str, float], caution: str) -> None:
    found = in_words(replace(USUAL, **terms))
    assert found.count("caution: ") == 1
    assert caution in found
    assert "caution" not in in_words(USUAL)


def test_the_share_of_clipped_samples_is_of_all_that_were_read(clean: Path, tmp_path: Path) -> None:
    told = done(clean, tmp_path / "set", bits=2, full_scale_V=1e-6, noise_V=1e-9, frames=3, baseline_frames=2)
    assert told.clipped_share == pytest.approx(told.clipped / ((ROWS - 1) * 208 * 5))
    assert 0.9 < told.clipped_share <= 1.0


def test_a_design_without_a_measurement_asks_for_one(clean: Path, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"has no \[measurement\]. Give one with --model"):
        next(measure(clean, tmp_path / "a"))
    assert not (tmp_path / "a").exists()


def test_the_designs_own_measurement_is_the_default(clean: Path, tmp_path: Path) -> None:
    design = design_from({"scenes": ROWS, "measurement": NOISY})
    parquet.write_manifest(clean, parquet.read_manifest(clean) | {"design": asdict(design)})
    told = NoiseSummary(**measure(clean, tmp_path / "own").manifest["measured"])
    assert told == done(clean, tmp_path / "asked", **NOISY)
    with pytest.raises(ValueError, match=r"snr_db in \[measurement\] says nothing"):
        design_from({"scenes": ROWS, "measurement": {"snr_db": 60}})


def test_a_file_of_its_own_names_itself(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text("[measurement]\nnoise = 3\n")
    with pytest.raises(InputFileError, match=r"m.toml.*unknown key 'noise'"):
        read_measurement(path)
    path.write_text("noise_V = 3\n")
    with pytest.raises(InputFileError, match=r"one table \[measurement\] and nothing else, got noise_V"):
        read_measurement(path)
    path.write_text("[measurement]\nnoise_V = 3e-3\n")
    assert read_measurement(path).noise_V == 3e-3


def test_the_command_tells_what_it_did_and_what_is_missing(clean: Path, tmp_path: Path,
                                                           monkeypatch: pytest.MonkeyPatch,
                                                           capsys: pytest.CaptureFixture[str]) -> None:
    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["eitsim", "measure", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main.main()
        return int(end.value.code or 0), *capsys.readouterr()

    model = tmp_path / "m.toml"
    model.write_text("[measurement]\nbits = 12\nfull_scale_V = 1.0\n")
    status, out, _ = call(clean, "--model", model, "--out", tmp_path / "a")
    assert status == 0
    assert "steps of 0.000488 V" in out
    status, out, _ = call(clean, "--model", model, "--out", tmp_path / "a", "--json")
    assert status == 0
    assert json.loads(out)["clipped"] > 0
    status, _, err = call(clean, "--out", tmp_path / "b")
    assert status == 2
    assert "Give one with --model measurement.toml" in err
    damaged = parquet.parts(tmp_path / "a")[0]
    damaged.write_bytes(damaged.read_bytes()[:-9])
    status, _, err = call(clean, "--model", model, "--out", tmp_path / "a")
    assert status == 2
    assert "the part is damaged" in err


@pytest.mark.parametrize("terms", [{"noise_V": -1e-3}, {"bits": 12}, {"snr_db": 60.0}, {"frames": 0}])
def test_a_measurement_made_in_python_is_checked_before_anything_is_written(clean: Path, tmp_path: Path,
                                                                            terms: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"in \[measurement\]"):
        measure(clean, tmp_path / "wrong", Measurement(**terms))
    assert not (tmp_path / "wrong").exists()
