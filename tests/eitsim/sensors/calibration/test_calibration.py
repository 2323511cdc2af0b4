"""Calibration of the absolute model: its physics, what it recovers, what it refuses, and what it writes."""

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
from typer.testing import CliRunner

from eitsim.cli.display import show_calibration
from eitsim.cli.main import app
from eitsim.electrics.cem.boundary_integral import rim_admittance, solve_rim
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.electrics.volume.extruded_mesh import extruded
from eitsim.electrics.volume.volume_cem import volume_impedance
from eitsim.scene.drive import Drive, matrices, readings
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Skin
from eitsim.sensors.calibration.calibrate import calibrate, untouched
from eitsim.sensors.calibration.calibration_file import (
    calibration_document,
    parameters_of,
    read_calibration,
    read_described_sensor,
)
from eitsim.sensors.calibration.instrument_model import GROUPS, Instrument, derivatives, sources, voltages
from eitsim.sensors.calibration.ohm_tests import ohm_tests
from eitsim.sensors.calibration.stages import fit, halves, harms, jointly, unexplained
from eitsim.sensors.recording import Recording, read_recording
from eitsim.sensors.sensor_file import Sensor, read_sensor
from touchcal.errors import InputFileError
from touchcal.json_file import write_json

REAL = Path(__file__).parents[5] / "shared" / "real"
COUNT = 8


def sensor(kind: str = "voltage") -> Sensor:
    """Drives to the next but one and to the opposite electrode, both ways; readings between neighbours."""
    unit = np.eye(COUNT)
    ends = [(k, (k + step) % COUNT) for step in (2, COUNT // 2, COUNT - 2) for k in range(COUNT)]
    return Sensor(Body(), Skin(), Electrodes(count=COUNT), Drive(
        1e-3, currents=tuple(unit[a] - unit[b] for a, b in ends), measurements=tuple(unit[:-1] - unit[1:])), kind)


def instrument_of(one: Sensor) -> Instrument:
    return Instrument(one.body, one.electrodes, sources(one.protocol), 1e-3)


def recording(volts: np.ndarray, kind: str = "voltage") -> Recording:
    return Recording(volts.reshape(1, -1), np.array([0]), None, np.array([""]), kind, Path("synthetic"))


def hidden(seed: int, groups: tuple[str, ...] = ("contacts", "width", "positions", "gains", "leaks"),
           noise: float = 1e-4) -> tuple[np.ndarray, np.ndarray]:
    """The state of a hidden sensor and its readings with noise of so much of their r.m.s."""
    rng, held = np.random.default_rng(seed), instrument_of(sensor())
    sizes = {"sheet": 0.05, "widths": 0.05, "contacts": np.log(3),
             "width": 0.05, "positions": 0.5e-3, "gains": 0.03, "currents": 0.03, "leaks": 30e-6}
    change = np.zeros(held.size)
    for group in groups:
        own = held.places[group]
        change[own] = sizes[group] * rng.standard_normal(own.stop - own.start)
    change[held.places["leaks"]] = np.abs(change[held.places["leaks"]])
    state = held.prior_mean + held.gauged(change)
    clean = voltages(held, sensor().protocol, state)
    return state, clean + noise * np.sqrt(np.mean(clean**2)) * rng.standard_normal(clean.shape)


def test_an_ideal_instrument_reads_what_the_scene_s_drive_reads() -> None:
    one = sensor()
    expected = readings(one.protocol, solve_rim(one.body, one.electrodes, 1e-3).impedance_Ohm)
    found = voltages(instrument_of(one), one.protocol, instrument_of(one).prior_mean)
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_leaks_are_resistors_to_a_ground_that_the_sink_is_tied_to() -> None:
    """Kirchhoff's law on a network with a ground of its own, which solves no electrode's row out."""
    one, held = sensor(), instrument_of(sensor())
    state = held.prior_mean
    state[held.places["leaks"]] = np.linspace(1e-5, 4e-5, COUNT)
    network = np.zeros((COUNT + 1, COUNT + 1))
    network[:COUNT, :COUNT] = rim_admittance(one.body, one.electrodes, 1e-3).admittance_S
    for k, leak in enumerate(state[held.places["leaks"]]):
        network[np.ix_([k, COUNT], [k, COUNT])] += leak * np.array([[1, -1], [-1, 1]])
    for pattern, found in zip(one.protocol.currents_A, voltages(held, one.protocol, state), strict=True):
        tied = network.copy()
        tied[np.ix_([pattern.argmin(), COUNT], [pattern.argmin(), COUNT])] += 1e6 * np.array([[1, -1], [-1, 1]])
        potential = np.linalg.lstsq(tied, np.append(np.maximum(pattern, 0), pattern.min()))[0][:COUNT]
        np.testing.assert_allclose(found, potential[:-1] - potential[1:], rtol=0, atol=1e-6 * float(np.ptp(potential)))


def test_derivatives_are_those_of_differences() -> None:
    """On an uneven sheet too."""
    one, held = sensor(), instrument_of(sensor())
    state, _ = hidden(1, tuple(GROUPS)[1:])
    for k in range(held.size):
        assert _off(held, one, state, k) < 3e-4, held.names[k]


def _off(held: Instrument, one: Sensor, state: np.ndarray, k: int) -> float:
    """How far the derivative by a parameter is from a difference, over the largest."""
    _, found = derivatives(held, one.protocol, state)
    step = np.zeros(held.size)
    step[k] = 1e-4 * min(held.prior_sd[k], 1.0)
    expected = (voltages(held, one.protocol, state + step) - voltages(held, one.protocol, state - step)) / (2 * step[k])
    return float(np.abs(found[..., k] - expected).max() / np.abs(expected).max())


def test_no_reading_determines_what_the_gauges_hold() -> None:
    """A common gain is a conductance, and the ring may turn; so their means stay, whatever is fitted."""
    one, held = sensor(), instrument_of(sensor())
    state, _ = hidden(2, ("contacts", "gains", "currents"))
    turned = state.copy()
    turned[held.places["positions"]] += 2e-3
    louder = state.copy()
    louder[held.places["gains"]] *= 1.1
    louder[held.places["currents"]] /= 1.1
    expected = voltages(held, one.protocol, state)
    np.testing.assert_allclose(voltages(held, one.protocol, turned), expected, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(voltages(held, one.protocol, louder), expected, rtol=1e-12)
    found = held.gauged(turned - state)
    assert np.abs(found).max() < 1e-15


@pytest.mark.slow
def test_hidden_parameters_lie_in_their_intervals() -> None:
    """A small version of benchmarks/sensor_fit.py; readings are those of the fitted model, so only noise is off."""
    inside = []
    for seed in (0, 1):
        state, volts = hidden(seed)
        found = calibrate(sensor(), recording(volts))
        assert found.reason == ""
        assert found.instrument is not None
        fitted = parameters_of(found)
        assert list(fitted) == list(found.instrument.names)
        truth = dict(zip(found.instrument.names, state * found.instrument.units, strict=True))
        inside += [abs(one["value"] - truth[name]) <= 1.96 * one["sd"] for name, one in fitted.items()]
        assert all(0 < one["sd"] <= 1.0001 * one["prior_sd"] for one in fitted.values())
        held_out = [stage.held_out for stage in found.stages.values() if stage.kept]
        assert min(held_out) < 0.05 * found.stages["conductance"].held_out
    print(f"{np.mean(inside):.3f} of {len(inside)} parameters inside 95 %")
    assert np.mean(inside) >= 0.9


def test_what_no_reading_sees_keeps_its_prior_and_what_readings_see_does_not() -> None:
    """No current enters electrode 7 and no reading is taken there; through the sheet its contact is hardly felt."""
    unit = np.eye(COUNT)
    ends = [(a, b) for a in range(COUNT - 1) for b in range(COUNT - 1) if a != b]
    one = replace(sensor(), drive=Drive(1e-3, currents=tuple(unit[a] - unit[b] for a, b in ends),
                                        measurements=tuple(unit[:-2] - unit[1:-1])))
    held = instrument_of(one)
    clean = voltages(held, one.protocol, held.prior_mean)
    frame = untouched(one, recording(clean * (1 + 1e-3 * np.random.default_rng(0).standard_normal(clean.shape))))
    sd = np.sqrt(np.diag(fit(held, frame, tuple(GROUPS), held.prior_mean).covariance)) / held.prior_sd
    contact, gain = sd[held.places["contacts"]], sd[held.places["gains"]]
    assert contact[:7].max() < 0.5 * contact[7]
    assert gain[:7].max() < 0.7 < 0.9 < gain[7]


@pytest.mark.thorough
def test_a_last_fit_of_all_groups_takes_back_what_an_early_stage_gave_to_others() -> None:
    """Electrodes that are freed before gains and widths move by 0.8 mm, and stay there when gains are freed."""
    state, volts = hidden(26, ("contacts", "width", "widths", "gains"), noise=1e-6)
    held, frame = instrument_of(sensor()), untouched(sensor(), recording(volts))
    frame, start = frame.of(np.arange(len(frame.volts)) < 2 * COUNT), held.prior_mean
    for count in (4, 6):
        early = fit(held, frame, tuple(GROUPS)[:count], start)
        start = early.state
    off, before = ((one.state - state) / np.sqrt(np.diag(one.covariance)) for one in (
        jointly(held, frame, early.state, 0), early))
    assert np.abs(before[held.places["positions"]]).max() > 4
    assert np.abs(off).max() < 3
    assert np.mean(np.abs(off) < 1.96) > 0.9


def test_held_groups_keep_prior_mean_and_prior_sd() -> None:
    _, volts = hidden(3, ("contacts",), noise=1e-3)
    held = instrument_of(sensor())
    found = fit(held, untouched(sensor(), recording(volts)), ("conductance", "contacts"), held.prior_mean)
    for group in ("width", "gains", "leaks"):
        own = held.places[group]
        np.testing.assert_array_equal(found.state[own], held.prior_mean[own])
    np.testing.assert_allclose(np.diag(found.covariance)[held.places["leaks"]], (30e-6) ** 2)
    assert np.sqrt(found.covariance[0, 0]) < 0.01


def test_a_stage_does_harm_where_most_drives_get_worse_and_not_where_some_do() -> None:
    """Drives there and back are one, so 20 of them; what changes is drawn about a mean, or about none."""
    asked, rng = sensor().protocol, np.random.default_rng(0)
    before, scatter = np.ones(len(asked.currents_A)), 0.1 * rng.standard_normal(len(asked.currents_A))
    assert harms(asked, before, before + 0.1 + scatter)
    assert not harms(asked, before, before - 0.1 + scatter)
    assert not harms(asked, before, before + 0.02 + 0.01 * scatter)  # clearly worse, but by too little to matter
    assert not harms(asked, before, before + scatter - scatter.mean())


@pytest.mark.parametrize("size", [10.0, 1e6])
def test_one_ruined_drive_is_harm_however_large_its_scatter(size: float) -> None:
    asked, before = sensor().protocol, np.ones(len(sensor().protocol.weights))
    assert harms(asked, before, before + np.where(np.arange(len(before)) == 3, size * len(before), 0.0))
    assert not harms(asked, before, before + np.where(np.arange(len(before)) == 3, 1.0, 0.0))


def test_halves_keep_drives_between_the_same_electrodes_together() -> None:
    asked = sensor().protocol
    half = halves(asked, 0)
    assert half.sum() == pytest.approx(len(half) / 2, abs=2)
    ends = [frozenset(np.flatnonzero(row)) for row in asked.currents_A]
    assert not {one for one, seen in zip(ends, half, strict=True) if seen} & {
        one for one, seen in zip(ends, half, strict=True) if not seen}
    assert (halves(asked, 1) != half).any()


def test_an_ohmmeter_passes_and_gains_against_ground_do_not() -> None:
    one, held = sensor(), instrument_of(sensor())
    ideal = ohm_tests(one, voltages(held, one.protocol, hidden(4, ("contacts", "positions"))[0]))
    unequal = ohm_tests(one, voltages(held, one.protocol, hidden(4, ("contacts", "gains"))[0]))
    assert ideal.repeats is None
    assert ideal.source_against_sink is not None
    assert unequal.source_against_sink is not None
    assert ideal.superposition is not None
    assert unequal.superposition is not None
    assert max(ideal.source_against_sink, ideal.superposition) < 1e-9
    assert min(unequal.source_against_sink, unequal.superposition) > 1e-3


def test_superposition_of_unrelated_readings_is_all_off() -> None:
    one = sensor()
    found = ohm_tests(one, np.random.default_rng(0).standard_normal(one.protocol.shape))
    assert found.superposition == pytest.approx(1.0, abs=0.2)


def test_magnitudes_and_dead_readings_are_fitted() -> None:
    held, (_, volts) = instrument_of(sensor()), hidden(5, ("contacts",))
    volts[:, 2] = np.nan
    signed, sizes = untouched(sensor(), recording(volts)), untouched(
        sensor("magnitude"), recording(np.abs(volts), "magnitude"))
    one, other = (fit(held, frame, ("conductance", "contacts"), held.prior_mean) for frame in (signed, sizes))
    np.testing.assert_allclose(other.state, one.state, atol=1e-3)
    assert not signed.off_driven[:, 2].any()
    assert unexplained(held, signed, one.state) < 1e-3


def test_differences_and_what_is_no_ohmmeter_are_refused_with_the_reason() -> None:
    differences = calibrate(sensor("difference"), recording(hidden(0)[1], "difference"))
    assert "differences" in differences.reason
    noise = np.abs(np.random.default_rng(0).standard_normal(sensor().protocol.shape)) ** 3
    found = calibrate(sensor("magnitude"), recording(noise, "magnitude"))
    assert "no ohmmeter: readings with source and sink exchanged differ by" in found.reason
    assert calibration_document(found)["absolute_model"] == "refused"
    assert parameters_of(found) == {}


@pytest.mark.slow
def test_a_model_that_explains_little_is_refused() -> None:
    """Linear, reciprocal readings of a network that is no sheet: impedances by chance."""
    one, rng = sensor(), np.random.default_rng(0)
    root = rng.standard_normal((COUNT, COUNT))
    found = calibrate(one, recording(readings(one.protocol, root @ root.T)))
    assert "stay unexplained on drives that were not fitted" in found.reason
    assert "check [drive] by `eitsim sensor inspect`, and the sizes in [body]" in found.reason


@pytest.mark.parametrize(("change", "words"), [
    ({"electrodes": Electrodes(count=COUNT, missing=(1,))}, "takes no missing .* leave the cells of readings"),
    ({"electrodes": Electrodes(kind="surface", count=COUNT)}, "not built for electrodes on the surface"),
    ({"drive": Drive(1e-3, "adjacent", currents=((1, 1, -1, -1, 0, 0, 0, 0), (1, -1, 0, 0, 0, 0, 0, 0)),
                     measurements=((1, -1, 0, 0, 0, 0, 0, 0),))}, "pattern 0 .* from 2 electrodes"),
    ({"drive": Drive(1e-3, currents=((1, -1, 0, 0, 0, 0, 0, 0),), measurements=((0, 0, 1, -1, 0, 0, 0, 0),))},
     "one drive alone"),
    ({"drive": Drive(1e-3, currents=((1, -1, 0, 0, 0, 0, 0, 0), (1, 0, -1, 0, 0, 0, 0, 0)),
                     measurements=((1, -1, 0, 0, 0, 0, 0, 0),))}, "no reading uses electrodes without current"),
    ({"kind": "magnitude"}, "of kind 'voltage', and kind in .readings. of the sensor is 'magnitude'"),
], ids=str)
def test_what_cannot_be_calibrated_is_refused(change: dict, words: str) -> None:
    one = replace(sensor(), **change)
    with pytest.raises(ValueError, match=words):
        calibrate(one, recording(np.ones(np.prod(one.protocol.shape))))


def test_a_recording_without_untouched_frame_is_refused() -> None:
    frames = recording(hidden(0)[1])
    with pytest.raises(ValueError, match="synthetic: no frame is untouched"):
        calibrate(sensor(), replace(frames, touch=np.array(["a"])))


SENSOR = ('[electrodes]\ncount = 8\n[drive]\ncurrent_mA = 1\ncurrents = "currents.csv"\n'
          'measurements = "measurements.csv"\n')


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder in which the command calibrates a sensor whose contacts are hidden, and what it prints."""
    folder, one = tmp_path_factory.mktemp("fitted"), sensor()
    np.savetxt(folder / "currents.csv", one.protocol.currents_A * 1e3, delimiter=",")
    np.savetxt(folder / "measurements.csv", one.protocol.weights[0], delimiter=",")
    np.savetxt(folder / "frames.csv", hidden(6, ("contacts",), noise=1e-6)[1].reshape(1, -1), delimiter=",")
    (folder / "sensor.toml").write_text(SENSOR, encoding="utf-8")
    frames, described, out = (str(folder / name) for name in ("frames.csv", "sensor.toml", "sensor.json"))
    done = CliRunner().invoke(app, ["sensor", "fit", frames, "--sensor", described, "--out", out, "--json"])
    assert done.exit_code == 0, done.output
    return folder, done.stdout


@pytest.fixture(scope="module")
def document(fitted: tuple[Path, str]) -> dict:
    return json.loads((fitted[0] / "sensor.json").read_text())


@pytest.mark.thorough
def test_a_calibrated_sensor_is_read_back_and_predicts_other_drives(document: dict, tmp_path: Path) -> None:
    state, volts = hidden(6, ("contacts",), noise=1e-6)
    write_json(document, tmp_path / "sensor.json")
    found = read_calibration(tmp_path / "sensor.json")
    assert np.abs(found.readings() - volts).max() < 1e-4 * np.abs(volts).max()
    unit = np.eye(COUNT)
    other = matrices([unit[0] + unit[1] - 2 * unit[5]], (unit[2:4] - unit[6:8])[None])
    expected = voltages(instrument_of(sensor()), other, state)
    np.testing.assert_allclose(found.readings(other), expected, rtol=1e-3)


@pytest.mark.thorough
@pytest.mark.parametrize(("change", "words"), [
    (lambda d: d.update(schema=9), "schema 9 is not 2"),
    (lambda d: d.update(absolute_model="refused", reason="why"), "its absolute model was refused: why"),
    (lambda d: d["parameters"].pop("gain_03"), "'gain_03' in parameters is missing"),
    (lambda d: d["parameters"].update(gain_09={"value": 1, "sd": 1, "prior_sd": 1}), "'gain_09' .* no parameter of"),
    (lambda d: d["parameters"]["gain_03"].update(value="x"), r"parameters.gain_03.value"),
    (lambda d: d["parameters"]["offset_mm_03"].update(value=100.0), "must lie within one turn"),
    (lambda d: d["sensor"].update(punch={}), "unknown key 'punch'"),
    (lambda d: d.pop("sensor"), "the key 'sensor' is missing"),
], ids=lambda one: one if isinstance(one, str) else "")
def test_what_is_no_calibrated_sensor_is_refused(document: dict, tmp_path: Path, change: Callable[[dict], None],
                                                 words: str) -> None:
    changed = copy.deepcopy(document)
    change(changed)
    write_json(changed, tmp_path / "sensor.json")
    with pytest.raises(InputFileError, match=words):
        read_calibration(tmp_path / "sensor.json")


@pytest.mark.thorough
def test_one_function_reads_both_files_of_a_sensor_and_says_which(document: dict, tmp_path: Path) -> None:
    write_json(document | {"absolute_model": "refused", "reason": "why"}, tmp_path / "fitted")
    found, words = read_described_sensor(tmp_path / "fitted")
    assert words == "calibrated sensor"
    assert found == sensor()
    (tmp_path / "described").write_text("[body]\nradius_mm = 45\n")
    found, words = read_described_sensor(tmp_path / "described")
    assert (words, found.body.radius_m) == ("sensor file", 0.045)
    write_json(document | {"schema": 9}, tmp_path / "fitted")
    with pytest.raises(InputFileError, match="schema 9 is not 2"):
        read_described_sensor(tmp_path / "fitted")
    (tmp_path / "neither").write_text("v_000,v_001\n1,2\n")
    with pytest.raises(InputFileError, match="not TOML"):
        read_described_sensor(tmp_path / "neither")


@pytest.mark.thorough
def test_the_conductance_is_shown_in_siemens(document: dict, capsys: pytest.CaptureFixture[str]) -> None:
    show_calibration(document, Path("sensor.json"))
    value_mS = 1e3 * np.exp(document["parameters"]["ln_conductance_S"]["value"])
    assert f"sheet conductance: {value_mS:.4g} mS" in capsys.readouterr().out


@pytest.mark.thorough
def test_the_commands_fit_and_predict(command: Callable[..., CompletedProcess[str]], fitted: tuple[Path, str]) -> None:
    (folder, printed), volts = fitted, hidden(6, ("contacts",), noise=1e-6)[1]
    said = json.loads(printed)
    assert said["absolute_model"] == "usable"
    assert said["stage"] in said["unexplained"]
    assert set(said["parameters"]["gain_00"]) == {"value", "sd", "prior_sd"}
    done = command("eitsim", "sensor", "predict", "sensor.json", "--out", "own.csv", cwd=folder)
    assert done.returncode == 0, done.stderr
    own = read_recording(folder / "own.csv").readings[0]
    assert np.linalg.norm(own - volts.ravel()) < 1e-3 * np.linalg.norm(volts)
    done = command("eitsim", "sensor", "predict", "sensor.json", "--currents", "currents.csv", "--measurements",
                   "measurements.csv", "--out", "same.csv", cwd=folder)
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(read_recording(folder / "same.csv").readings[0], own, rtol=1e-12)
    done = command("eitsim", "sensor", "predict", "sensor.json", "--currents", "currents.csv", "--out", "no.csv",
                   cwd=folder)
    assert done.returncode == 2
    assert "--currents and --measurements belong together" in done.stderr
    assert not (folder / "no.csv").exists()


@pytest.mark.thorough
@pytest.mark.skipif(not REAL.exists(), reason="recordings of real sensors are not here")
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3, 4))])
def test_a_water_tank_is_predicted_on_drives_that_were_not_fitted(seed: int) -> None:
    """Contacts and width, which is what is usually fitted, leave more than 10 % of a random half."""
    known = read_sensor(REAL / "tank" / "sensor.toml")
    frame = untouched(known, read_recording(REAL / "tank" / "frames.csv", kind=known.kind))
    held, half = instrument_of(known), halves(frame.asked, seed)
    usual = fit(held, frame.of(half), tuple(GROUPS)[:3], held.prior_mean)
    every = fit(held, frame.of(half), tuple(GROUPS), usual.state)
    left = [unexplained(held, frame.of(~half), one.state) for one in (usual, every)]
    print(f"half {seed}: {left[0]:.2%} and {left[1]:.2%}")
    assert left[1] < 0.017 < 0.1 < left[0]


@pytest.mark.skipif(not REAL.exists(), reason="recordings of real sensors are not here")
def test_a_hydrogel_is_refused_since_source_and_sink_make_a_difference() -> None:
    known = read_sensor(REAL / "hydrogel" / "sensor.toml")
    found = calibrate(known, read_recording(REAL / "hydrogel" / "frames.csv", kind=known.kind))
    assert "readings with source and sink exchanged differ by 118%" in found.reason
    assert found.fit is None


def layered(**electrodes: float) -> Sensor:
    plain = sensor()
    body = Body(Disc(0.04), 0.003)
    return replace(plain, body=body, skin=Skin(body.thickness_m, "principal", "layer"), electrodes=Electrodes(
        count=COUNT, width_m=0.008, contact_impedance_Ohm_m=0.1, **electrodes))


@pytest.mark.thorough
def test_a_layer_s_conductivity_and_contacts_are_found_from_a_solution_of_its_volume() -> None:
    rng, one = np.random.default_rng(11), layered()
    sigma, z = rng.uniform(0.5, 20), 3e-4 * np.exp(0.5 * rng.standard_normal(COUNT))
    angles, electrode = rim_angles(one.body, one.electrodes, 3)
    radii = one.body.edge.size_m * np.append(1 - np.geomspace(1, 4e-3, 16), 1)
    flat = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, COUNT)
    mesh = extruded(flat, np.array([-one.body.thickness_m, 0.0]))
    volts = readings(one.protocol, volume_impedance(mesh, np.full(len(mesh.cells), sigma), z))
    noise = 1e-3 * np.sqrt(np.mean(volts**2)) * rng.standard_normal(volts.shape)  # above the error of the mesh
    document = calibration_document(calibrate(one, recording(volts + noise)))
    layer = document["layer"]
    assert layer["thickness_mm"] == pytest.approx(3)
    assert layer["conductivity_S_per_m"] == pytest.approx(sigma, rel=0.01)
    off, sd = np.log(layer["contact_impedance_Ohm_m2"] / z), np.array(layer["contact_impedance_sd"])
    assert np.all(np.abs(off) < 3 * sd)
    assert sd.max() < 0.6
    show_calibration(document, Path("sensor.json"))


def test_electrodes_on_part_of_a_layer_s_rim_are_not_taken_for_those_of_a_sheet() -> None:
    one = layered(high_m=0.0015)
    with pytest.raises(ValueError, match="low_mm, high_mm in \\[electrodes\\]"):
        calibrate(one, recording(np.ones(one.protocol.shape)))
