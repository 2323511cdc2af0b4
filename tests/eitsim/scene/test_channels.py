"""Channels of a calibrated sensor: exact for touched bodies, without effect where they are ideal, named where wrong."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import eitsim
import matcal
from eitsim.electrics.cem.boundary_integral import rim_admittance, solve_rim
from eitsim.scene.channels import Channels, channel_changes, channel_readings
from eitsim.scene.drive import Drive, protocol, readings, voltage_columns
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body, Scene, Skin, read_scene, scene_from, scene_tables
from eitsim.sensors.calibration.calibrate import Calibration
from eitsim.sensors.calibration.calibration_file import calibration_document, read_calibration
from eitsim.sensors.calibration.instrument_model import Instrument, sources, voltages
from eitsim.sensors.calibration.stages import Fit
from eitsim.sensors.sensor_file import Sensor, read_sensor
from eitsim.simulation.simulate import plan
from eitsim.sweeps.design.card_draws import Cards
from eitsim.sweeps.design.design import read_design, scene_at
from eitsim.sweeps.run.rows import solve_rows
from touchcal.errors import InputFileError
from touchcal.json_file import write_json

COUNT = 8
CARD = matcal.MaterialCard("foam", matcal.Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm"),
                           conductivity=matcal.Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0, 0.4)))
SENSOR = Sensor(Body(), Skin(), Electrodes(count=COUNT, width_m=0.012, first_angle_rad=0.1),
                Drive(1e-3, "skip-1", "differential"))
TOUCH = '[punch]\nx_mm = 30\nforce_N = 0.2\n[accuracy]\nsignal = 0.05\n'


def instrument(sheet_S: float = 6e-4) -> Instrument:
    return Instrument(SENSOR.body, SENSOR.electrodes, sources(SENSOR.protocol), sheet_S)


def state_of(*groups: str) -> np.ndarray:
    """Prior mean, some groups drawn from their prior."""
    held, rng = instrument(), np.random.default_rng(0)
    state = held.prior_mean
    for group in groups:
        own = held.places[group]
        state[own] += 0.5 * held.prior_sd[own] * rng.standard_normal(own.stop - own.start)
    return state


def written(state: np.ndarray, path: Path) -> Path:
    held = instrument()
    found = Fit(state, 1e-6, 0.0, np.diag(1e-4 * held.prior_sd**2))
    write_json(calibration_document(Calibration(SENSOR, 1, None, instrument=held, fit=found)), path)
    return path


def scene_of(folder: Path, text: str = TOUCH) -> Scene:
    (folder / "scene.toml").write_text('[electrodes]\ncalibrated = "sensor.json"\n' + text, encoding="utf-8")
    return read_scene(folder / "scene.toml")


def test_channels_are_those_of_the_instrument_model() -> None:
    """That model grounds the sink in the admittance, this one in the impedance."""
    held, state = instrument(), state_of("gains", "currents", "leaks", "contacts")
    z = solve_rim(held.body, held.built(state), 6e-4).impedance_Ohm
    factors = np.ones(COUNT)
    factors[list(held.sources)] = state[held.places["currents"]]
    found = channel_readings(SENSOR.protocol, Channels(tuple(state[held.places["gains"]]), tuple(factors),
                                                       tuple(state[held.places["leaks"]])), z)
    expected = voltages(held, SENSOR.protocol, state)
    assert np.abs(found - expected).max() < 2e-6 * np.abs(expected).max()


def test_changes_are_differences_of_readings_and_keep_digits() -> None:
    z, other = (solve_rim(Body(), SENSOR.electrodes, sheet).impedance_Ohm for sheet in (6e-4, 5e-4))
    channels = Channels(tuple(np.linspace(0.95, 1.05, COUNT)), (), (3e-5,) * COUNT)
    asked = SENSOR.protocol
    found = channel_changes(asked, channels, z, other, other - z)
    expected = channel_readings(asked, channels, other) - channel_readings(asked, channels, z)
    assert np.abs(found - expected).max() < 1e-12 * np.abs(channel_readings(asked, channels, z)).max()
    tiny = channel_changes(asked, channels, z, z + 1e-12 * z, 1e-12 * z)
    slope = channel_changes(asked, channels, z, z, z)
    assert np.abs(tiny / 1e-12 - slope).max() < 1e-9 * np.abs(slope).max()


def test_leaks_act_on_touched_readings_as_on_a_network_with_a_ground() -> None:
    """The change of the body's admittance, each solved with leaks of its own."""
    leaks = np.linspace(1e-5, 5e-5, COUNT)
    y, touched = (rim_admittance(Body(), SENSOR.electrodes, sheet).admittance_S for sheet in (6e-4, 5.7e-4))
    asked = protocol(SENSOR.drive, COUNT)
    expected = np.zeros((2, *asked.currents_A.shape))
    for k, body in enumerate((y, touched)):
        for p, current in enumerate(asked.currents_A):
            rest = np.delete(np.arange(COUNT), current.argmin())
            expected[k, p, rest] = np.linalg.solve((body + np.diag(leaks))[np.ix_(rest, rest)], current[rest])
    reading = np.einsum("pre,kpe->kpr", asked.weights, expected)
    z, other = (np.asarray(np.linalg.pinv(body), dtype=float) for body in (y, touched))
    found = channel_changes(asked, Channels(leaks_S=tuple(leaks)), z, other, other - z)
    np.testing.assert_allclose(found, reading[1] - reading[0], atol=1e-9 * float(np.abs(reading).max()))
    assert np.abs(found - readings(asked, other - z)).max() > 1e-3 * np.abs(found).max()


def test_a_calibrated_sensor_is_for_scenes_not_for_sensor_files(tmp_path: Path) -> None:
    written(state_of("gains"), tmp_path / "sensor.json")
    (tmp_path / "sensor.toml").write_text('[electrodes]\ncalibrated = "sensor.json"\n', encoding="utf-8")
    with pytest.raises(InputFileError, match=r"calibrated in .electrodes. serves scenes and designs"):
        read_sensor(tmp_path / "sensor.toml")


def test_the_calibrated_body_stays_where_a_scene_names_a_part_of_it(tmp_path: Path) -> None:
    path = written(state_of(), tmp_path / "sensor.json")
    document = json.loads(path.read_text(encoding="utf-8"))
    document["sensor"]["body"]["thickness_mm"] = 5.0
    path.write_text(json.dumps(document), encoding="utf-8")
    radius = document["sensor"]["body"]["radius_mm"]
    assert scene_of(tmp_path, TOUCH + f"[body]\nradius_mm = {radius}\n").body.thickness_m == pytest.approx(5e-3)


def test_soft_electrodes_stay_soft_where_they_are_calibrated(tmp_path: Path) -> None:
    path = written(state_of(), tmp_path / "sensor.json")
    assert not scene_of(tmp_path).electrodes.soft
    document = json.loads(path.read_text(encoding="utf-8"))
    document["sensor"]["electrodes"]["soft"] = True
    path.write_text(json.dumps(document), encoding="utf-8")
    assert scene_of(tmp_path).electrodes.soft


def test_an_ideal_sensor_changes_nothing(tmp_path: Path) -> None:
    written(state_of(), tmp_path / "sensor.json")
    calibrated = scene_of(tmp_path)
    plain = scene_from(scene_tables(replace(SENSOR.scene, punches=calibrated.punches, accuracy=calibrated.accuracy)))
    one, other = (eitsim.simulate(scene, CARD).readings for scene in (plain, calibrated))
    assert one is not None
    assert other is not None
    for name in ("baseline_V", "signal_V", "touched_V"):
        expected, found = getattr(one, name), getattr(other, name)
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max(), name


def test_a_scene_s_untouched_frame_is_the_calibrated_sensor_s(tmp_path: Path) -> None:
    """The sheet too: 0.5 mS, where the card's is 0.6 mS."""
    state = state_of("contacts", "width", "positions", "gains", "currents", "leaks")
    state[0] = np.log(5e-4)
    written(state, tmp_path / "sensor.json")
    scene = scene_of(tmp_path)
    found = eitsim.simulate(scene, CARD).readings
    expected = read_calibration(tmp_path / "sensor.json").readings()
    assert found is not None
    assert np.abs(found.baseline_V - expected).max() < 1e-5 * np.abs(expected).max()
    assert scene_tables(scene_from(scene_tables(scene))) == scene_tables(scene)
    decided = [one.decision for one in plan(scene, CARD).decisions]
    assert "readings through the channels of a calibrated sensor" in decided
    assert any("calibrated sheet conductance of 0.0005 S" in one for one in decided)


def test_images_are_of_the_calibrated_sensor(tmp_path: Path) -> None:
    """Unequal gains against ground, which a uniform skin with ideal channels does not explain."""
    state = state_of("contacts", "gains", "leaks")
    written(state, tmp_path / "sensor.json")
    scene = scene_of(tmp_path)
    touched = eitsim.simulate(scene, CARD).readings
    assert touched is not None
    images = eitsim.reconstruct(touched.touched_V, touched.baseline_V, scene=scene)
    plain = eitsim.reconstruct(touched.touched_V, touched.baseline_V, scene=replace(scene, channels=Channels()))
    assert images.misfit < 3e-3 < 1e-2 < plain.misfit
    peak = images.seen[0].blob
    assert peak is not None


def test_designs_take_calibrated_electrodes(tmp_path: Path) -> None:
    written(state_of("gains", "positions"), tmp_path / "sensor.json")
    (tmp_path / "design.toml").write_text('scenes = 2\n[electrodes]\ncalibrated = "sensor.json"\n[punch]\n'
                                          'force_N = [0.1, 0.3]\n[accuracy]\nsignal = 0.05\n', encoding="utf-8")
    design = read_design(tmp_path / "design.toml")
    scene = scene_at(design, 1)
    assert scene.channels == scene_of(tmp_path).channels
    assert len(set(scene.channels.gains)) == COUNT
    assert scene.electrodes.angles_rad
    assert "calibrated" not in design.tables["electrodes"]
    (row,) = solve_rows(design, Cards(CARD), [1])
    alone = eitsim.simulate(scene, CARD).readings
    assert alone is not None
    found = np.array([row[name] for name in voltage_columns(alone.signal_V.size, "dv")])
    np.testing.assert_allclose(found, alone.signal_V.ravel(), rtol=1e-12)


@pytest.mark.parametrize(("text", "words"), [
    ('[electrodes]\ncalibrated = "sensor.json"\ncount = 8', r"count in \[electrodes\] has no effect with calibrated"),
    ('[electrodes]\ncalibrated = 3', "must be the name of a file"),
    ('[electrodes]\ncalibrated = "no.json"', r"no\.json"),
    ('[electrodes]\ncalibrated = "sensor.json"\n[channels]\ngains = [1]', r"\[channels\] has no effect"),
    ('[electrodes]\ncalibrated = "sensor.json"\n[body]\nradius_mm = 50', "radius_mm .* of the calibrated sensor, 100"),
    ('[electrodes]\ncalibrated = "refused.json"', "refused: why"),
    ('[electrodes]\ncalibrated = "poor.json"', "'gain_03' in parameters is missing"),
    ('[channels]\ngains = [1, 1]', r"gains in \[channels\] must hold 16 numbers"),
    ('[channels]\nleaks_uS = [1, 1, 1, 1]\n[electrodes]\ncount = 4\nmissing = [1]', "missing"),
], ids=str)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, words: str) -> None:
    document = json.loads(written(state_of(), tmp_path / "sensor.json").read_text(encoding="utf-8"))
    write_json(document | {"absolute_model": "refused", "reason": "why"}, tmp_path / "refused.json")
    del document["parameters"]["gain_03"]
    write_json(document, tmp_path / "poor.json")
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputFileError, match=words):
        read_scene(tmp_path / "scene.toml")


def test_several_sinks_are_refused_with_channels() -> None:
    drive = {"currents": [[1, 1, -1, -1]], "measurements": [[1, -1, 0, 0]]}
    with pytest.raises(ValueError, match="draws its current from 2 electrodes"):
        scene_from({"electrodes": {"count": 4}, "drive": drive, "channels": {"gains": [1.0, 1.0, 1.0, 1.1]}})
