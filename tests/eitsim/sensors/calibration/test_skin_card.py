"""A fitted skin as a card: its laws and draws, its place in scenes, what is refused by name, and the whole command."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest

import eitsim
import matcal
from eitsim.cli.fitted_card import check_card_of_design
from eitsim.scene.channels import Channels
from eitsim.scene.drive import Drive
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.fitted_layer import ACROSS, PIEZO, THICKNESS, fitted_table
from eitsim.scene.scene import Body, Scene, Skin, read_scene
from eitsim.sensors.calibration.calibrate import Calibration, FittedSkin
from eitsim.sensors.calibration.calibration_file import calibration_document, read_calibration
from eitsim.sensors.calibration.instrument_model import Instrument, sources, voltages
from eitsim.sensors.calibration.placement import Placement
from eitsim.sensors.calibration.skin_card import card_path, skin_draws, write_skin_card
from eitsim.sensors.calibration.skin_fit import SkinFit
from eitsim.sensors.calibration.skin_law import AMPLITUDE, MODULUS, OFFSETS, PRIORS, SHAPES, changed, skin_presses
from eitsim.sensors.calibration.stages import Fit
from eitsim.sensors.labels import Labels
from eitsim.sensors.sensor_file import Sensor
from eitsim.simulation.simulate import plan
from eitsim.sweeps.design.card_draws import card_at, cards_for, material_from
from matcal.laws.conductivity import conductivity
from touchcal.json_file import write_json

FOAM = matcal.Hyperfoam(np.array([9530.0]), np.array([8.0]), np.array([0.0]), "longterm")
CARD = matcal.MaterialCard("foam", FOAM, conductivity=matcal.Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0, 0.4)))
SENSOR = Sensor(Body(), Skin(), Electrodes(count=8), Drive(1e-3, "skip-1", "differential"))
HELD = Instrument(SENSOR.body, SENSOR.electrodes, sources(SENSOR.protocol), 6e-4)
NAMES = tuple(name for sds in PRIORS.values() for name in sds)


def fitted(values: dict[str, float], size_error: float = 0.02) -> FittedSkin:
    prior = np.array([sd for sds in PRIORS.values() for sd in sds.values()])
    fit = SkinFit(NAMES, np.array([values.get(name, 0.0) for name in NAMES]), np.diag((0.1 * prior) ** 2), prior,
                  ("amplitude", "modulus"), {"amplitude": 0.05}, 0.3, 0.05, size_error, 0.03, 1e-5,
                  np.array([], dtype=np.intp))
    return FittedSkin(CARD, 20, ("p3",), (), (), Placement(), fit)


def written(folder: Path) -> Path:
    """A calibrated sensor with a skin and its card in a folder; the sensor's file."""
    folder.mkdir(exist_ok=True)
    skin = fitted({AMPLITUDE: 0.1})
    fit = Fit(HELD.prior_mean, 1e-6, 0.0, np.diag(1e-4 * HELD.prior_sd**2))
    found = Calibration(SENSOR, 1, None, instrument=HELD, fit=fit, skin=skin)
    card = write_skin_card(skin, folder / "sensor.json")
    write_json(calibration_document(found, card.name), folder / "sensor.json")
    return folder / "sensor.json"


def laws(card: matcal.MaterialCard) -> tuple[matcal.Hyperfoam, matcal.Conductivity]:
    assert card.hyperfoam is not None
    assert card.conductivity is not None
    return card.hyperfoam, card.conductivity


def test_the_amplitude_scales_what_strain_changes_and_the_modulus_every_force() -> None:
    strain = np.linspace(0, 0.4, 9)
    foam, law = laws(changed(CARD, {AMPLITUDE: np.log(1.2), MODULUS: np.log(0.9)}))
    before = conductivity(laws(CARD)[1], strain)
    np.testing.assert_allclose(conductivity(law, strain) / 30 - 1, 1.2 * (before / 30 - 1), atol=1e-12)
    np.testing.assert_allclose(foam.mu_Pa, 0.9 * FOAM.mu_Pa)
    assert laws(changed(CARD, {}))[1].a.tolist() == [-2.0, 2.0, -1.0]


def test_a_shape_changes_the_law_at_the_largest_strain_by_its_part_of_the_law_s_size() -> None:
    strain = np.linspace(0, 0.4, 101)
    before = conductivity(laws(CARD)[1], strain) / 30 - 1
    size = np.sqrt(np.mean(before**2))
    for order, name in enumerate(SHAPES, start=2):
        after = conductivity(laws(changed(CARD, {name: 0.1}))[1], strain) / 30 - 1
        np.testing.assert_allclose(after - before, 0.1 * size * (strain / 0.4) ** order, atol=1e-12)


@pytest.mark.parametrize(("names", "values", "words"), [
    (("x_mm", "y_mm", "F_N"), [0, 0, 1], "needs x_mm and y_mm, d_mm of the punch, and F_N or depth_mm"),
    (("x_mm", "y_mm", "d_mm"), [0, 0, 14], "d_mm of the punch, and F_N or depth_mm"),
    (("x_mm", "y_mm", "d_mm", "F_N"), [0, 0, 14, 0], "touch 'p0': F_N is 0, expected the force from 0.001"),
    (("x_mm", "y_mm", "d_mm", "F_N"), [0, 0, 0.014, 1], r"d_mm is 0\.014, .* from 0\.5 to 100 mm"),
    (("x_mm", "y_mm", "d_mm", "F_N", "depth_mm"), [0, 0, 14, 1, 2], "hold both F_N and depth_mm"),
    (("x_mm", "y_mm", "d_mm", "depth_mm"), [0, 0, -14, 1], "d_mm is -14, expected the punch's diameter")])
def test_labels_that_fit_no_skin_are_refused_by_name(names: tuple[str, ...], values: list[float], words: str) -> None:
    labels = Labels(np.array(["p0"]), names, np.array([values], dtype=float))
    with pytest.raises(ValueError, match=words):
        skin_presses(Scene(), CARD, labels, np.zeros((1, 2)))


def test_a_card_without_conductivity_is_refused_by_name() -> None:
    labels = Labels(np.array(["p0"]), ("x_mm", "y_mm", "d_mm", "F_N"), np.array([[0.0, 0.0, 14.0, 1.0]]))
    with pytest.raises(ValueError, match="card 'foam' has no conductivity"):
        skin_presses(Scene(), replace(CARD, conductivity=None), labels, np.zeros((1, 2)))


def test_the_card_of_a_skin_serves_as_any_and_its_draws_spread_as_the_fit_says(tmp_path: Path) -> None:
    skin = fitted({AMPLITUDE: 0.1, MODULUS: -0.05})
    path = write_skin_card(skin, tmp_path / "sensor.json")
    assert path == card_path(tmp_path / "sensor.json") == tmp_path / "sensor.card.json"
    read = matcal.read_card(path)
    np.testing.assert_allclose(laws(read)[0].mu_Pa, 9530 * np.exp(-0.05))
    np.testing.assert_allclose(laws(read)[1].a, np.exp(0.1) * np.array([-2.0, 2.0, -1.0]))
    assert "20 labelled presses" in read.provenance["decisions"][-1]
    cards = cards_for(material_from({"draws": 40}), 0, read)
    stiffness = np.log([laws(card_at(cards, k))[0].mu_Pa[0] / 9530 for k in range(40)])
    assert np.mean(stiffness) == pytest.approx(-0.05, abs=0.02)
    assert np.std(stiffness) == pytest.approx(0.02, rel=0.4)


def test_draws_of_a_card_that_cannot_say_its_long_term_moduli_hold_the_conductivity_alone() -> None:
    skin = replace(fitted({}), card=replace(CARD, law=replace(FOAM, moduli="instantaneous")))
    draws = skin_draws(skin)
    assert not draws.law
    assert draws.conductivity_S_per_m is not None


def test_scenes_of_a_sensor_take_the_skin_s_card_and_count_what_presses_scattered(tmp_path: Path) -> None:
    """Three standard deviations are in the plan's bound, which models of a sweep take back."""
    file = written(tmp_path / "skins")
    (tmp_path / "scene.toml").write_text('[electrodes]\ncalibrated = "skins/sensor.json"\n', encoding="utf-8")
    scene = read_scene(tmp_path / "scene.toml")
    assert scene.card == "skins/sensor.card.json"
    assert scene.channels.size_error == (0.02,)
    assert read_calibration(file).state == pytest.approx(HELD.prior_mean)
    stated = [one.error_bound for one in plan(scene, CARD).decisions if "scatter about its model" in one.decision]
    assert stated == [pytest.approx(0.06)]
    without = replace(scene, channels=replace(scene.channels, size_error=()))
    assert plan(scene, CARD).error_bound - plan(without, CARD).error_bound == pytest.approx(0.06)
    (tmp_path / "scene.toml").write_text('card = "other.json"\n[electrodes]\ncalibrated = "skins/sensor.json"\n',
                                         encoding="utf-8")
    assert read_scene(tmp_path / "scene.toml").card == "other.json"
    assert read_scene(tmp_path / "scene.toml").channels.size_error == (0.3,)  # what the card before the fit left
    (tmp_path / "other.json").write_bytes(card_path(file).read_bytes())
    assert read_scene(tmp_path / "scene.toml").channels.size_error == (0.02,)


def test_a_sweep_warns_of_a_card_that_is_not_the_skin_s(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, design = written(tmp_path), tmp_path / "design.toml"
    design.write_text('scenes = 3\n[electrodes]\ncalibrated = "sensor.json"\n', encoding="utf-8")
    matcal.write_card(CARD, tmp_path / "card.json")
    check_card_of_design(card_path(file), design)
    assert capsys.readouterr().err == ""
    check_card_of_design(tmp_path / "card.json", design)
    assert "the size error of 0.02 in the rows is not of the card given" in capsys.readouterr().err


def test_a_card_given_in_the_place_of_the_skin_s_is_warned_of(command: Callable[..., CompletedProcess[str]],
                                                              tmp_path: Path) -> None:
    file = written(tmp_path)
    (tmp_path / "scene.toml").write_text('[electrodes]\ncalibrated = "sensor.json"\n', encoding="utf-8")
    matcal.write_card(CARD, tmp_path / "card.json")
    (tmp_path / "copy.json").write_bytes(card_path(file).read_bytes())
    warned = command("eitsim", "plan", "scene.toml", "--card", "card.json", cwd=tmp_path).stderr
    assert "--card card.json is not sensor.card.json" in " ".join(warned.split())
    assert command("eitsim", "plan", "scene.toml", "--card", "copy.json", cwd=tmp_path).stderr == ""
    card_path(file).unlink()
    lost = command("eitsim", "plan", "scene.toml", cwd=tmp_path)
    assert lost.returncode == 2
    assert "sensor.card.json: no such file, which the calibrated sensor" in " ".join(lost.stderr.split())


@pytest.mark.slow
def test_sweeps_draw_skins_and_state_what_presses_scattered(tmp_path: Path) -> None:
    file = written(tmp_path)
    (tmp_path / "design.toml").write_text(
        'scenes = 3\n[electrodes]\ncalibrated = "sensor.json"\n[punch]\nx_mm = [-20, 20]\ny_mm = 0\n'
        'force_N = [0.3, 1]\n[accuracy]\nsignal = 0.05\n[material]\ndraws = 3\n', encoding="utf-8")
    rows = eitsim.sweep(tmp_path / "design.toml", card_path(file), tmp_path / "sweep").ok
    assert len(rows) == 3
    assert all(0.06 < one < 0.1 for one in rows["signal_error"].tolist())
    assert [len(set(rows[name].tolist())) for name in ("a_1", "mu_1_Pa")] == [3, 3]


def fit_in(folder: Path, command: Callable[..., CompletedProcess[str]], *more: str) -> CompletedProcess[str]:
    """A fit of differences, whose absolute model is refused."""
    (folder / "sensor.toml").write_text('[electrodes]\ncount = 8\n[drive]\npattern = "skip-1"\n'
                                        'reading = "differential"\n[readings]\nkind = "difference"\n',
                                        encoding="utf-8")
    count = SENSOR.protocol.weights.reshape(-1, 8).shape[0]
    (folder / "frames.csv").write_text("\n".join([
        ",".join(["touch", *(f"v_{k:03d}" for k in range(count))]), "p0," + ",".join(["0.1"] * count)]) + "\n",
        encoding="utf-8")
    return command("eitsim", "sensor", "fit", "frames.csv", "--sensor", "sensor.toml", "--out", "sensor.json", *more,
                   cwd=folder)


def test_a_fit_without_a_skin_removes_the_card_of_an_earlier_one(command: Callable[..., CompletedProcess[str]],
                                                                 tmp_path: Path) -> None:
    written(tmp_path)
    done = fit_in(tmp_path, command)
    assert done.returncode == 0, done.stderr
    assert "removed: sensor.card.json" in done.stdout
    assert not card_path(tmp_path / "sensor.json").exists()
    assert not (tmp_path / "sensor.card.d").exists()


def test_labels_and_cards_that_fit_no_skin_are_refused_before_the_fit_by_file(
        command: Callable[..., CompletedProcess[str]], tmp_path: Path) -> None:
    (tmp_path / "touches.csv").write_text("touch,x_mm,y_mm,d_mm,F_N\np0,0,0,0.014,1\n", encoding="utf-8")
    matcal.write_card(CARD, tmp_path / "card.json")
    done = fit_in(tmp_path, command, "--labels", "touches.csv", "--card", "card.json")
    assert done.returncode == 2
    assert "touches.csv: touch 'p0': d_mm is 0.014" in " ".join(done.stderr.split())
    (tmp_path / "touches.csv").write_text("touch,x_mm,y_mm,d_mm,F_N\np0,0,0,14,1\n", encoding="utf-8")
    matcal.write_card(replace(CARD, conductivity=None), tmp_path / "card.json")
    done = fit_in(tmp_path, command, "--labels", "touches.csv", "--card", "card.json")
    assert "card.json: card 'foam' has no conductivity" in " ".join(done.stderr.split())


def test_a_card_without_labels_is_refused(command: Callable[..., CompletedProcess[str]], tmp_path: Path) -> None:
    done = command("eitsim", "sensor", "fit", "frames.csv", "--card", "card.json", "--sensor", "sensor.toml", "--out",
                   "sensor.json", cwd=tmp_path)
    assert done.returncode == 2
    assert "--card is fitted to labelled presses; give --labels too" in " ".join(done.stderr.split())


@pytest.mark.slow
def test_a_skin_is_fitted_from_files_and_serves_a_scene(command: Callable[..., CompletedProcess[str]],
                                                        tmp_path: Path) -> None:
    """Twelve presses of a skin whose law is 15 % stronger and whose foam is 10 % softer, some near the rim."""
    rng, unit = np.random.default_rng(0), np.eye(8)
    drive = Drive(1e-3, currents=tuple(unit[k] - unit[(k + step) % 8] for step in (2, 4) for k in range(8)),
                  measurements=tuple(unit[:-1] - unit[1:]))
    held = Instrument(SENSOR.body, SENSOR.electrodes, sources(replace(SENSOR, drive=drive).protocol), 6e-4)
    radius, angle = 60 * np.sqrt(rng.uniform(size=13)), rng.uniform(0, 2 * np.pi, 13)
    radius[-1] = 91.0
    force = rng.uniform(0.3, 2, 13)
    touches = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(13, 14.0), force])
    labels = Labels(np.array([f"p{k}" for k in range(13)]), ("x_mm", "y_mm", "d_mm", "F_N"), touches)
    scene = replace(SENSOR.scene, drive=drive, channels=Channels((), (), (), (6e-4,)))
    presses = skin_presses(scene, CARD, labels, 1e-3 * touches[:, :2])
    assert presses.rows.tolist() == list(range(12))
    assert presses.too_deep.tolist() == []
    hard = replace(labels, values=np.where(touches == force[:1, None], 900.0, touches))
    assert skin_presses(scene, CARD, hard, 1e-3 * touches[:, :2]).too_deep.tolist() == [0]
    rest = voltages(held, replace(SENSOR, drive=drive).protocol, held.prior_mean).ravel()
    signal = presses.signals({AMPLITUDE: np.log(1.15), MODULUS: np.log(0.9), OFFSETS[0]: 0.3})
    frames = [rest, rest, rest, *(rest + np.vstack([signal, signal[:1]]))]
    noise = 1e-5 * np.sqrt(np.mean(rest**2))
    names = ["", "", "", *labels.touch.tolist()]
    rows = [",".join([name, *map(repr, (frame + noise * rng.standard_normal(rest.size)).tolist())])
            for name, frame in zip(names, frames, strict=True)]
    (tmp_path / "frames.csv").write_text("\n".join([
        ",".join(["touch", *(f"v_{k:03d}" for k in range(rest.size))]), *rows]) + "\n", encoding="utf-8")
    (tmp_path / "touches.csv").write_text("touch,x_mm,y_mm,d_mm,F_N\n" + "".join(
        f"p{k},{','.join(map(repr, row))}\n" for k, row in enumerate(touches.tolist())), encoding="utf-8")
    for name, matrix in (("currents", drive.currents), ("measurements", drive.measurements)):
        (tmp_path / f"{name}.csv").write_text("\n".join(",".join(map(str, row)) for row in np.array(matrix)) + "\n",
                                              encoding="utf-8")
    (tmp_path / "sensor.toml").write_text(
        '[electrodes]\ncount = 8\n[drive]\ncurrent_mA = 1\ncurrents = "currents.csv"\n'
        'measurements = "measurements.csv"\n', encoding="utf-8")
    matcal.write_card(CARD, tmp_path / "card.json")
    done = command("eitsim", "sensor", "fit", "frames.csv", "--labels", "touches.csv", "--card", "card.json",
                   "--sensor", "sensor.toml", "--out", "sensor.json", "--report", "sensor.pdf", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["skin"]["left_out"] == ["p12"]
    assert set(said["skin"]["kept"]) >= {"amplitude", "modulus"}
    for name, true in ((AMPLITUDE, np.log(1.15)), (MODULUS, np.log(0.9)), (OFFSETS[0], 0.3)):
        one = said["parameters"][name]
        assert abs(one["value"] - true) < 3 * one["sd"]
        assert one["sd"] < 0.5 * one["prior_sd"]
    assert said["skin"]["unexplained"]["kept"] < 0.5 * said["skin"]["unexplained"]["card"]
    (tmp_path / "scene.toml").write_text('[electrodes]\ncalibrated = "sensor.json"\n[accuracy]\nsignal = 0.05\n',
                                         encoding="utf-8")
    done = command("eitsim", "plan", "scene.toml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "scatter about its model" in " ".join(done.stdout.split())


def test_a_standard_deviation_of_the_thickness_that_three_thicknesses_do_not_serve_is_refused() -> None:
    labels = Labels(np.array(["a"]), ("x_mm", "y_mm", "d_mm", "F_N"), np.array([[0.0, 0.0, 8.0, 1.0]]))
    frames = eitsim.Recording(np.ones((2, 40)), np.arange(2), None, np.array(["", "a"]), "voltage", Path("f.csv"))
    with pytest.raises(ValueError, match=r"thickness is 0\.3 of it, expected 0\.005 to 0\.1"):
        eitsim.calibrate(SENSOR, frames, labels, CARD, thickness_sd=0.3)


def test_a_fitted_layer_stands_in_the_tables_of_its_sensor() -> None:
    """Of coatings nothing changes; coefficients that a table does not have stay out of it."""
    values = {THICKNESS: np.log(1.1), PIEZO: np.log(1.2), ACROSS: 0.1}
    layer = {"kind": "layer", "thickness_mm": 3.0, "strain": "piezoresistive", "along": 3.0, "across": 4.0}
    found = fitted_table(layer, values)
    assert {**found} == pytest.approx({**layer, "thickness_mm": 3.3, "along": 3.6, "across": 1.2 * (4.0 + 0.1 * 5.0)})
    assert set(fitted_table({"kind": "layer", "thickness_mm": 3.0}, values)) == {"kind", "thickness_mm"}
    assert fitted_table({"kind": "coating", "thickness_um": 20.0}, values) == {"kind": "coating", "thickness_um": 20.0}
