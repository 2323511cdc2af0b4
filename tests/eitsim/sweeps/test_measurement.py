"""Measurements: each term has its size, is switched by itself, and depends on the scene's number alone."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.forward.untouched import by_contact, untouched_impedance
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.drive import read_out
from eitsim.scene.scene import Punch, Scene, scene_from
from eitsim.sheet.sheet_conductance import untouched_conductance
from eitsim.sweeps.measurement.instrument import Measured, Measurement, below, channels_of, level_db, measured
from eitsim.sweeps.measurement.instrument_table import as_table, measurement_from
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

ROWS, READINGS = 400, 60
SCENES = np.arange(ROWS)
SENSOR = Scene()
SHEET_S = 6e-4


@pytest.fixture(scope="module")
def clean() -> tuple[np.ndarray, np.ndarray]:
    draw = np.random.default_rng(0)
    baseline = np.tile(draw.uniform(0.2, 3.5, READINGS), (ROWS, 1))
    return baseline + draw.normal(0, 0.005, (ROWS, READINGS)), baseline


def check_moments(errors: np.ndarray, size: float) -> None:
    """Mean 0 and standard deviation `size` of independent normal errors, within 4 standard errors of either."""
    n = errors.size
    assert abs(errors.mean()) < 4 * size / np.sqrt(n)
    assert abs(errors.std() / size - 1) < 4 / np.sqrt(2 * n)


def seen(clean: tuple[np.ndarray, np.ndarray], **terms) -> Measured:
    return measured(measurement_from({"seed": 3, **terms}), *clean, SCENES)


def test_nothing_switched_on_changes_no_bit(clean) -> None:
    out = seen(clean)
    assert np.array_equal(out.touched_V, clean[0])
    assert np.array_equal(out.baseline_V, clean[1])
    assert not out.clipped.any()


def test_noise_is_white_on_both_frames(clean) -> None:
    out = seen(clean, noise_V=2e-3)
    errors = np.stack([out.touched_V - clean[0], out.baseline_V - clean[1]])
    check_moments(errors, 2e-3)
    between_rows = np.corrcoef(errors.reshape(2, -1))[0, 1]
    between_readings = np.mean(errors[..., 1:] * errors[..., :-1]) / 2e-3**2
    assert abs(between_rows) < 4 / np.sqrt(ROWS * READINGS)
    assert abs(between_readings) < 4 / np.sqrt(2 * ROWS * (READINGS - 1))
    assert out.signal_V == pytest.approx(out.touched_V - out.baseline_V, rel=0, abs=0)


def test_averaged_frames_have_less_noise_and_a_clean_baseline_none(clean) -> None:
    check_moments(seen(clean, noise_V=2e-3, frames=16).touched_V - clean[0], 5e-4)
    long = seen(clean, noise_V=2e-3, baseline_frames=100)
    check_moments(long.touched_V - clean[0], 2e-3)
    check_moments(long.baseline_V - clean[1], 2e-4)
    without = seen(clean, noise_V=2e-3, lsb_V=0.01, clean_baseline=True)
    assert np.array_equal(without.baseline_V, clean[1])


@pytest.mark.parametrize(("relative_to", "reference"), [("largest", lambda b: np.abs(b[0]).max()), (0.5, lambda b: 0.5),
                                                        ("rms", lambda b: np.sqrt(np.mean(b[0]**2)))])
def test_an_snr_is_exactly_of_the_voltage_that_it_refers_to(clean, relative_to, reference) -> None:
    by_snr = seen(clean, snr_db=60, relative_to=relative_to)
    by_volts = seen(clean, noise_V=reference(clean[1]) * 1e-3)
    assert by_snr.touched_V == pytest.approx(by_volts.touched_V, rel=1e-14)
    assert level_db(below(47.0, 2.0), 2.0) == pytest.approx(47.0, rel=1e-14)


def test_gain_and_offset_belong_to_the_channel_and_never_change(clean) -> None:
    gain = seen(clean, gain=0.01)
    errors = gain.baseline_V / clean[1] - 1
    assert np.ptp(errors, axis=0).max() < 1e-14
    check_moments(errors[0], 0.01)
    assert gain.touched_V == pytest.approx(clean[0] * (1 + errors), rel=1e-14)
    offset = seen(clean, offset_V=0.02)
    assert offset.signal_V == pytest.approx(clean[0] - clean[1], abs=1e-14)
    check_moments((offset.baseline_V - clean[1])[0], 0.02)


def test_readings_of_one_channel_share_its_gain(clean) -> None:
    own = np.arange(READINGS) % 5
    out = measured(Measurement(gain=0.01), *clean, SCENES, channels=own)
    errors = (out.baseline_V / clean[1] - 1)[0]
    assert all(np.ptp(errors[own == k]) < 1e-14 for k in range(5))
    assert len(np.unique(errors.round(12))) == 5


@pytest.mark.parametrize(("key", "size", "common", "relative"), [
    ("drift", 0.01, True, True), ("drift_channel", 0.01, False, True),
    ("drift_V", 1e-3, True, False), ("drift_channel_V", 1e-3, False, False)])
def test_drift_lies_between_the_frames(clean, key, size, common, relative) -> None:
    out = seen(clean, **{key: size})
    assert np.array_equal(out.baseline_V, clean[1])
    errors = out.touched_V / clean[0] - 1 if relative else out.touched_V - clean[0]
    if common:
        assert np.ptp(errors, axis=1).max() < 1e-14
        errors = errors[:, 0]
    check_moments(errors, size)


def test_steps_leave_a_uniform_error(clean) -> None:
    step = 1e-3
    out = seen(clean, lsb_V=step)
    errors = out.touched_V - clean[0]
    assert np.abs(errors).max() <= step / 2 * (1 + 1e-9)
    assert abs(errors.std() / (step / np.sqrt(12)) - 1) < 4 * np.sqrt(0.2 / errors.size)
    assert np.abs(out.touched_V / step - np.round(out.touched_V / step)).max() < 1e-9
    assert not out.clipped.any()


def test_bits_are_steps_over_the_full_scale_and_what_lies_beyond_is_clipped(clean) -> None:
    model = measurement_from({"bits": 12, "full_scale_V": 4.0})
    assert model.step_V == 4.0 / 2048
    assert np.array_equal(seen(clean, bits=12, full_scale_V=4.0).touched_V, seen(clean, lsb_V=4.0 / 2048).touched_V)
    low = seen(clean, bits=12, full_scale_V=2.0)
    beyond = clean[0] > 2.0
    assert low.touched_V.max() == 2.0 - 2.0 / 2048
    assert np.all(low.touched_V[beyond] == low.touched_V.max())
    assert np.all(low.clipped >= beyond.sum(axis=1))
    assert low.clipped.sum() > 0


def test_noise_dithers_averaged_steps(clean) -> None:
    """The mean of n frames with noise of half a step has far less error than one step leaves without noise."""
    out = seen(clean, noise_V=5e-4, lsb_V=1e-3, frames=64)
    check_moments(out.touched_V - clean[0], np.sqrt((5e-4**2 + 1e-6 / 12) / 64))


def test_a_row_does_not_depend_on_the_others(clean) -> None:
    terms = {"noise_V": 1e-3, "gain": 0.01, "drift": 0.01, "drift_channel_V": 1e-3, "contact_impedance": 0.1}
    slopes = np.random.default_rng(1).normal(size=(READINGS, 16))
    model = measurement_from({"seed": 3, **terms})
    whole = measured(model, *clean, SCENES, by_contact_V=slopes)
    rows = np.array([17, 3, 250])
    part = measured(model, clean[0][rows], clean[1][rows], rows, by_contact_V=np.stack([slopes] * 3))
    assert part.touched_V == pytest.approx(whole.touched_V[rows], rel=1e-14)
    assert np.array_equal(part.baseline_V, whole.baseline_V[rows])
    other = measured(replace(model, seed=4), *clean, SCENES, by_contact_V=slopes)
    assert np.abs(other.touched_V - whole.touched_V).min() > 0


def test_terms_do_not_move_each_others_draws(clean) -> None:
    noise = seen(clean, noise_V=1e-3).touched_V - clean[0]
    with_gain = seen(clean, noise_V=1e-3, gain=0.01).touched_V - seen(clean, gain=0.01).touched_V
    assert with_gain == pytest.approx(noise, abs=1e-14)


def test_missing_readings_stay_missing(clean) -> None:
    touched, baseline = (values.copy() for values in clean)
    touched[:, 4] = baseline[:, 4] = np.nan
    terms = {"snr_db": 60, "relative_to": "rms", "bits": 16, "full_scale_V": 5.0, "gain": 0.01}
    out = measured(measurement_from(terms), touched, baseline, SCENES)
    assert np.isnan(out.touched_V[:, 4]).all()
    assert np.isfinite(np.delete(out.signal_V, 4, axis=1)).all()


def test_contact_impedances_change_readings_as_solved_directly() -> None:
    """10 % on one electrode: what first order misses is second order, and the 16 columns are turns of one."""
    slopes = by_contact(SENSOR.body, SENSOR.electrodes, SENSOR.drive, SHEET_S)
    untouched = read_out(SENSOR.drive, untouched_impedance(SENSOR.body, SENSOR.electrodes, SHEET_S)).ravel()
    missed = []
    for change in (0.05, 0.1):
        z = [1.0] * 16
        z[5] += change
        varied = replace(SENSOR.electrodes, contact_impedance_Ohm_m=tuple(z))
        solved = read_out(SENSOR.drive, untouched_impedance(SENSOR.body, varied, SHEET_S)).ravel() - untouched
        missed.append(np.linalg.norm(solved - change * slopes[:, 5]) / np.linalg.norm(solved))
    assert missed[1] < 0.03
    assert missed[1] / missed[0] == pytest.approx(2.0, rel=0.05)


def test_first_order_serves_touched_frames_too() -> None:
    """All 16 change by 5 % rms: the touch solved again differs by 4 % of that effect at most."""
    foam = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
    law, punch = Conductivity(30.0, [-2, 2, -1], (0.0, 0.4)), Punch(0.03, -0.02, force_N=0.5)
    touch = solve_touch(foam, SENSOR.body, punch, element_m=0.25e-3)
    change = 0.05 * np.random.default_rng(4).standard_normal(16)
    varied = replace(SENSOR.electrodes, contact_impedance_Ohm_m=tuple((1 + change).tolist()))
    before, after = (solve(SENSOR.body, SENSOR.skin, electrodes, SENSOR.drive, ((punch, touch),), law).touched_V.ravel()
                     for electrodes in (SENSOR.electrodes, varied))
    by_z = by_contact(SENSOR.body, SENSOR.electrodes, SENSOR.drive, untouched_conductance(law, SENSOR.skin))
    missed = np.linalg.norm(after - before - by_z @ change) / np.linalg.norm(after - before)
    assert missed < 0.04


def test_contact_slopes_of_electrodes_that_are_not_alike() -> None:
    electrodes = scene_from({"electrodes": {"count": 8, "missing": [2]}}).electrodes
    slopes = by_contact(SENSOR.body, electrodes, SENSOR.drive, SHEET_S)
    alike = by_contact(SENSOR.body, replace(electrodes, missing=()), SENSOR.drive, SHEET_S)
    read = np.isfinite(slopes[:, 0])
    assert 0 < read.sum() < len(slopes)
    assert np.all(slopes[read, 2] == 0)
    assert np.abs(slopes[read][:, 0] / alike[read][:, 0] - 1).max() < 0.5


@pytest.mark.parametrize(("raw", "says"), [
    ({"noise": 1e-3}, "unknown key 'noise' in .measurement.; known: seed, noise_V"),
    ({"noise_V": -1}, "noise_V in .measurement. must be a finite number from 0 to 1000, got -1"),
    ({"noise_V": True}, "noise_V in .* a finite number from 0"),
    ({"snr_db": 60}, "relative_to names the voltage"),
    ({"snr_db": 60, "relative_to": "mean"}, "'mean' is unknown; known: largest, rms"),
    ({"snr_db": 60, "relative_to": "rms", "noise_V": 1e-3}, "give one of them"),
    ({"relative_to": "rms"}, "no effect without snr_db"),
    ({"contact_impedance": 0.3}, "got 0.3, give that or less"),
    ({"bits": 16}, "full_scale_V in .measurement. is missing"),
    ({"bits": 16, "full_scale_V": 5.0, "lsb_V": 1e-3}, "give either it or these two"),
    ({"bits": 1, "full_scale_V": 5.0}, "a whole number from 2 to 32"),
    ({"full_scale_V": 0}, "a finite number from 1e-15 to 1000"),
    ({"lsb_V": 1e-320}, "lsb_V in .* must be 0, for none, or from 1e-15 V"),
    ({"gain": 1e9}, "gain in .* from 0 to 10, got"),
    ({"snr_db": 60, "relative_to": 1e300}, "a finite number from 1e-15 to 1000 or a text"),
    ({"clean_baseline": True, "baseline_frames": 3}, "leave one of them out"),
    ({"clean_baseline": 1}, "must be true or false"),
    ({"channels": "wire"}, "known: reading, electrode"),
    (3, "must be a table")])
def test_wrong_keys_are_told_with_the_mend(raw, says) -> None:
    with pytest.raises(ValueError, match=says):
        measurement_from(raw)


def test_keys_come_back_as_given() -> None:
    raw = {"snr_db": 60, "relative_to": 1.5, "bits": 16, "full_scale_V": 5.0, "channels": "electrode"}
    assert as_table(measurement_from(raw)) == raw


def test_frames_of_other_shapes_and_missing_slopes_are_refused(clean) -> None:
    with pytest.raises(ValueError, match="one number a row"):
        measured(Measurement(), *clean, [1, 2])
    with pytest.raises(ValueError, match="needs the derivatives"):
        measured(Measurement(contact_impedance=0.1), *clean, SCENES)
    with pytest.raises(ValueError, match="channel of each reading"):
        measured(Measurement(channels="electrode"), *clean, SCENES)


def test_channels_are_readings_or_the_electrode_that_is_read() -> None:
    assert channels_of(Measurement(), SENSOR.drive, 16).tolist() == list(range(208))
    by_electrode = channels_of(Measurement(channels="electrode"), SENSOR.drive, 16).reshape(16, 13)
    assert by_electrode[0].tolist() == list(range(2, 15))
    assert by_electrode[15].tolist() == list(range(1, 14))
