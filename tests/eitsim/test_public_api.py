"""The public names of eitsim: a listed set, light to import, the same numbers as the commands."""

import doctest
import inspect
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pandas as pd
import pytest

import eitsim
from eitsim.sweeps.dataset.parquet import COST
from eitsim.sweeps.run.sweep import Progress
from matcal.card import MaterialCard, read_card, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

CARD = MaterialCard("Table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm"),
                    None, Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
SCENE = '[accuracy]\nsignal = 0.05\n[[punch]]\nx_mm = 12\nforce_N = 0.3\n'
DESIGN = "scenes = 3\nseed = 2\n[punch]\nforce_N = [0.2, 0.4]\n[accuracy]\nsignal = 0.05\n"


def test_the_exports_are_these() -> None:
    assert eitsim.__all__ == dir(eitsim) == [
        "Accuracy", "Body", "CalibratedSensor", "Calibration", "CurvedSkin", "Dataset", "Design", "Disc", "Drive",
        "Electrodes", "Frames", "Hold", "Identified", "Inspection", "Outline", "Press", "PressSetup", "Punch",
        "Recording", "Result", "Scene", "Sensor", "SensorDesign", "Skin", "calibrate", "calibration_document",
        "design_sensor", "frames", "identify", "inspect", "measure", "next_presses", "open_dataset", "open_recording",
        "plan", "press_of", "punch_of", "read_calibration", "read_curved_skin", "read_design", "read_presses",
        "read_recording", "read_scene", "read_sensor", "reconstruct", "result_document", "simulate",
        "solve_curved_skin", "solve_sheet_model", "sweep", "write_press", "write_skin_card"]
    assert all(getattr(eitsim, name).__name__ == name for name in eitsim.__all__)


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = ("import sys, time; begun = time.process_time(); import eitsim; spent = time.process_time() - begun; "
            "print(spent, *({'numpy', 'scipy', 'numba', 'pandas', 'h5py', 'pyarrow'} & sys.modules.keys()))")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    spent, *heavy = done.stdout.split()
    assert heavy == []
    assert float(spent) < 0.05


@pytest.mark.thorough
def test_every_function_has_an_example_that_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = {eitsim.frames, eitsim.next_presses, eitsim.write_skin_card}  # what they take is long in the making
    monkeypatch.chdir(Path(__file__).parents[2])
    finder, runner = doctest.DocTestFinder(), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for thing in {getattr(eitsim, name) for name in eitsim.__all__} - elsewhere:
        tried = sum(runner.run(test).attempted for test in finder.find(thing, globs={}))
        assert tried or not inspect.isfunction(thing), thing
    assert runner.summarize(verbose=False).failed == 0


def test_objects_solve_as_the_command_does(command: Callable[..., CompletedProcess[str]], tmp_path: Path) -> None:
    write_card(CARD, tmp_path / "card.json")
    (tmp_path / "scene.toml").write_text(SCENE)
    done = command("eitsim", "run", "scene.toml", "--card", "card.json", "--out", "result.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    written = json.loads((tmp_path / "result.json").read_text())
    scene = eitsim.Scene(punches=[eitsim.Punch(x_m=0.012, force_N=0.3)],  # pyright: ignore[reportArgumentType]
                         accuracy=eitsim.Accuracy(0.05))
    assert scene == eitsim.read_scene(tmp_path / "scene.toml")
    touch = eitsim.simulate(scene, CARD)
    assert len(repr(touch)) < 1000
    assert touch.readings is not None
    assert touch.readings.touched_V.tolist() == written["readings_V"]
    made = json.loads(json.dumps(eitsim.result_document(touch, scene, read_card(tmp_path / "card.json"))))
    for document in (made, written):
        document.pop("cost")
    assert made == written
    assert eitsim.plan(tmp_path / "scene.toml", tmp_path / "card.json") == touch.plan
    by_depth = eitsim.Punch(depth_m=0.001)
    assert by_depth.force_N is None
    assert eitsim.Punch().force_N == 1.0
    with pytest.raises(ValueError, match="both force_N and depth_mm"):
        eitsim.simulate(eitsim.Scene(punches=(eitsim.Punch(force_N=1.0, depth_m=0.001),)), CARD)
    with pytest.raises(ValueError, match="leave out reuse"):
        eitsim.simulate(scene, CARD, exact=True, reuse=True)


@pytest.mark.slow
def test_a_sweep_is_one_call_that_returns_its_rows(tmp_path: Path) -> None:
    write_card(CARD, tmp_path / "card.json")
    (tmp_path / "design.toml").write_text(DESIGN)
    seen: list[Progress] = []
    data = eitsim.sweep(tmp_path / "design.toml", CARD, tmp_path / "a", progress=seen.append)
    assert isinstance(data, eitsim.Dataset)
    assert data.account is not None
    assert (data.account.solved, data.account.kept, dict(data.account.outcomes)) == (3, 0, {"ok": 3})
    assert [step.done for step in seen] == [0, 3]
    assert data.manifest["card"]["file"] is None
    other = eitsim.sweep(eitsim.read_design(tmp_path / "design.toml"), tmp_path / "card.json", tmp_path / "b", scenes=3)
    assert other.manifest["card"] == data.manifest["card"] | {"file": "card.json"}
    one, two = (found.table.drop(columns=[*COST]) for found in (data, other))
    pd.testing.assert_frame_equal(one, two, check_exact=True)
    opened = eitsim.open_dataset(tmp_path / "a", ["dv_000"])
    assert opened.account is None
    assert opened.table["dv_000"].tolist() == data.table["dv_000"].tolist()
    assert "dv_001" not in opened.table
    grown = eitsim.sweep(eitsim.read_design(tmp_path / "design.toml"), CARD, tmp_path / "a", scenes=4).account
    assert grown is not None
    assert (grown.solved, grown.kept) == (1, 3)
    (tmp_path / "design.toml").write_text(DESIGN + "[material]\ndraws = 2\n")
    with pytest.raises(ValueError, match="has no file"):
        eitsim.sweep(tmp_path / "design.toml", CARD, tmp_path / "c")
    assert not (tmp_path / "c").exists()


@pytest.mark.thorough
def test_arrays_are_imaged_as_files_are_and_wrong_ones_named() -> None:
    baseline = eitsim.simulate(eitsim.Scene(accuracy=eitsim.Accuracy(0.05)), CARD).readings
    assert baseline is not None
    found = eitsim.reconstruct(baseline.touched_V, baseline.baseline_V)
    flat = eitsim.reconstruct([baseline.touched_V.ravel()] * 2, baseline.baseline_V.ravel())
    assert found.change.shape == (1, len(found.pixels.triangles))
    np.testing.assert_allclose(flat.change, np.repeat(found.change, 2, axis=0), rtol=0, atol=1e-9)
    assert found.seen[0].clear
    with pytest.raises(ValueError, match=r"shape \(16, 12\).*208 readings"):
        eitsim.reconstruct(baseline.touched_V[:, :12], baseline.baseline_V)
    holed = baseline.touched_V.copy()
    holed[0, 3] = np.nan
    assert "1 of 208 readings are empty" in eitsim.reconstruct(holed, baseline.baseline_V).cautions[0]
    holed[0, 3] = np.inf
    with pytest.raises(ValueError, match="infinite at reading 3 of frame 0"):
        eitsim.reconstruct(holed, baseline.baseline_V)
