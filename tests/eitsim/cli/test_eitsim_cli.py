"""Command line of eitsim: the contract's keys, plain errors with status 2, what was reached with status 3.

Those that call `process` start Python anew; the others call main() in this one.
"""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Console

from eitsim.cli.main import app
from eitsim.scene.frames import read_frames
from matcal.card import MaterialCard, write_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm", {"uniaxial": (-0.8, 0.0)})
SKIN = Conductivity(30.0, [-2, 2, -1], (0.0, 0.4))
KEYS = {"readings_V", "baseline_V", "force_N", "delta_max_mm", "sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2", "outcome",
        "wall_contact_mm2", "plan", "error_estimate", "stability", "cost", "scene", "card", "versions"}


Command = Callable[..., subprocess.CompletedProcess[str]]


def process(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "eitsim", *words], cwd=folder, capture_output=True, text=True,
                          timeout=300)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_card(MaterialCard("Table 1", FOAM, None, SKIN), tmp_path / "card.json")
    write_card(MaterialCard("dry", FOAM), tmp_path / "dry.json")
    write_card(MaterialCard("skin", None, None, SKIN), tmp_path / "skin.json")
    (tmp_path / "scene.toml").write_text('card = "card.json"\n[punch]\nx_mm = 20\nforce_N = 0.5\n')
    (tmp_path / "bare.toml").write_text("[punch]\nforce_N = 0.5\n")
    (tmp_path / "wrong.toml").write_text("[punch]\nradius = 3\n")
    (tmp_path / "design.toml").write_text("scenes = 3\n[punch]\nforce_N = [0.1, 1]\n")
    (tmp_path / "sensor.toml").write_text("[readings]\nkind = 'voltage'\n")
    (tmp_path / "taken").write_text("a file")
    (tmp_path / "rim.toml").write_text("[punch]\nx_mm = 98\n")
    (tmp_path / "stick.toml").write_text('[punch]\nfriction = "stick"\n')
    (tmp_path / "hopeless.toml").write_text("[punch]\nforce_N = 2000\n")
    return tmp_path


@pytest.mark.thorough
def test_a_run_prints_one_object_and_saves_it(folder: Path) -> None:
    done = process(folder, "run", "scene.toml", "--json", "--out", "result.json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result.keys() >= KEYS
    assert json.loads((folder / "result.json").read_text()) == result
    assert result["stability"]["fitted_law_strain"] == [-0.8, 0.0]
    assert [len(row) for row in result["readings_V"]] == [13] * 16


@pytest.mark.parametrize(("words", "named"), [
    (["run", "absent.toml"], "absent.toml"), (["run", "bare.toml"], "--card"),
    (["run", "bare.toml", "--card", "absent.json"], "absent.json"),
    (["run", "wrong.toml", "--card", "card.json"], "radius"), (["run", "rim.toml", "--card", "card.json"], "rim"),
    (["run", "bare.toml", "--card", "dry.json"], "no conductivity"),
    (["run", "bare.toml", "--card", "skin.json"], "no hyperelastic law"),
    (["run", "scene.toml", "--fields", "f.txt"], "f.txt: the file is a VTU file; give a name that ends in .vtu"),
    (["run", "scene.toml", "--fields", "f.vtu", "--fields-steps", "3"], "--fields-steps has no effect without a"),
    (["run", "scene.toml", "--fields", "f.pvd", "--fields-steps", "0"], "--fields-steps must be 1 or more, got 0"),
    (["run", "scene.toml", "--fields", "taken.pvd"], "--fields taken.pvd: the VTU files go to the folder taken, and a"),
    (["run", "scene.toml", "--fields", "r.pvd", "--out", "r"], "folder r, where --out r is written. Choose another"),
    (["draw", "press.pvd", "--out", "press.jpg"], "--out press.jpg: a picture is a .png, an animation a .gif"),
    (["run", "scene.toml", "--skin", "s.vtk"], "--skin s.vtk: the file is a VTU file"),
    (["run", "scene.toml", "--skin", "s.vtu", "--skin-patterns", "3,16"], "pattern 16 is none of 0 to 15"),
    (["run", "scene.toml", "--skin-patterns", "3"], "no effect without --skin"),
    (["run", "scene.toml", "--skin", "s.vtu", "--skin-patterns=inf"], "must hold whole numbers, got inf"),
    (["run", "scene.toml", "--out", "r.mat"], "--out r.mat: the result is JSON (jsondecode reads it in MATLAB)"),
    (["plan", "sensor.toml"], "[readings] makes it a sensor file, which `eitsim sensor` and `eitsim reconstruct` take"),
    (["run", "design.toml"], "scenes makes it a design, which `eitsim sweep` takes"),
    (["plan", "scene.toml", "--workers", "3"], "scene.toml is a scene, and --workers is of designs"),
    (["plan", "design.toml"], "design.toml: no card. Give --card card.json"),
    (["run", "/dev/zero"], "/dev/zero: this is a pipe or a device"),
    (["run", "scene.toml", "--out", "/dev/full"], "--out /dev/full is a pipe or a device"),
    (["run", "stick.toml", "--card", "card.json", "--reuse"], "--reuse"),
    (["run", "scene.toml", "--report", "touch.pdf"], "--out"), (["report", "nothing", "--out", "x.pdf"], "nothing"),
    (["sweep", "bare.toml", "--card", "card.json", "--out", "set"], "scenes"),
    (["sweep", "wrong.toml", "--card", "card.json", "--out", "set"], "radius")])
def test_mistakes_are_named_with_status_2(command: Command, folder: Path, words: list[str], named: str) -> None:
    before = sorted(p.name for p in folder.iterdir())
    done = command("eitsim", *words, cwd=folder)
    assert done.returncode == 2
    assert named in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in folder.iterdir()) == before


@pytest.mark.thorough
def test_readings_follow_the_drive_into_result_and_frames(command: Command, folder: Path) -> None:
    text = (folder / "scene.toml").read_text()
    (folder / "currents.csv").write_text("1,0,0,0,-1,0,0,0\n0,0,1,0,0,0,-1,0\n1,-1,1,-1,1,-1,1,-1\n")
    drive = '[electrodes]\ncount = 8\n[drive]\ncurrents = "currents.csv"\nmeasurements = [[0, 1, 0, -1, 0, 0, 0, 0]]\n'
    (folder / "scene.toml").write_text(text + drive)
    done = command("eitsim", "run", "scene.toml", "--json", "--frames", "frames.csv", "--skin", "skin.vtu",
                   "--skin-patterns", "2", cwd=folder)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert [len(row) for row in result["readings_V"]] == [1] * 3
    assert result["scene"]["drive"]["currents"][2] == [1, -1] * 4
    assert b'Name="potential_V_02"' in (folder / "skin.vtu").read_bytes()
    frames = read_frames(folder / "frames.csv", 3)
    assert frames.volts.tolist() == [[row[0] for row in result[key]] for key in ("baseline_V", "readings_V")]


@pytest.mark.thorough
def test_a_hopeless_touch_saves_what_was_reached_with_status_3(command: Command, folder: Path) -> None:
    done = command("eitsim", "run", "hopeless.toml", "--card", "card.json", "--out", "result.json", cwd=folder)
    assert done.returncode == 3
    assert "deep" in done.stderr
    result = json.loads((folder / "result.json").read_text())
    assert result["outcome"] == "bottomed_out"
    assert 0 < result["load_fraction"] < 1
    assert result["residuals"]


@pytest.mark.slow
def test_an_exact_run_writes_the_fields(command: Command, folder: Path) -> None:
    done = command("eitsim", "run", "scene.toml", "--exact", "--out", "result.json", "--fields", "fields.vtu",
                   cwd=folder)
    assert done.returncode == 0, done.stderr
    assert b'Name="displacement_m"' in (folder / "fields.vtu").read_bytes()
    assert "fields.vtu" in done.stdout
    result = json.loads((folder / "result.json").read_text())
    assert result["electrics_method"] == "mesh"
    assert result["plan"][0]["decision"].startswith("exact")


def test_run_refuses_to_write_over_its_scene_or_its_card(command: Command, folder: Path) -> None:
    before = {name: (folder / name).read_bytes() for name in ("scene.toml", "card.json")}
    for option, place in (("--frames", "card.json"), ("--out", "scene.toml")):
        done = command("eitsim", "run", "scene.toml", option, place, cwd=folder)
        assert done.returncode == 2
        assert "would be overwritten" in done.stderr
    assert {name: (folder / name).read_bytes() for name in before} == before


def test_a_run_says_what_each_quantity_is_and_the_plan_in_one_line(command: Command, folder: Path,
                                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    done = command("eitsim", "run", "scene.toml", cwd=folder)
    lines = done.stdout.splitlines()
    for words in ("Depth of the punch face, delta_max_mm", "Contact area on the punch face, A_c_mm2",
                  "force over contact area, sigma_ave_kPa", "Contact area on the side of the punch, wall_contact_mm2"):
        assert any(words in line for line in lines), words
    (plan,) = (line for line in lines if line.startswith("plan: "))
    assert re.search(r"may cost \d\.\d\d% of the signal", plan)
    assert ("unknown: laws used outside their fits; the skin's conductivity follows its largest strain in plane; "
            "one card" in plan)
    assert len(lines) < 40
    planned = command("eitsim", "plan", "scene.toml", cwd=folder).stdout
    (total,) = re.findall(r"(\S+)% +all known costs together", planned)
    assert f"may cost {total}% of" in plan
    assert re.search(r"unknown +laws used outside", planned)


def test_a_plan_says_that_the_signal_need_not_grow_with_the_force_where_that_is_so(command: Command,
                                                                                   folder: Path) -> None:
    plain = (folder / "scene.toml").read_text()
    for name, more, said in (("scene", "", False), ("normal", '[skin]\nstrain = "normal"\n', True)):
        (folder / f"{name}.toml").write_text(plain + more)
        done = command("eitsim", "plan", f"{name}.toml", cwd=folder)
        assert done.returncode == 0, done.stderr
        assert ("two forces may give one amplitude" in done.stdout) == said


@pytest.mark.parametrize(("words", "solver", "said"), [
    (("run", "scene.toml"), "eitsim.simulation.simulate.simulate", "solving the scene"),
    (("plan", "design.toml", "--card", "card.json"), "eitsim.sweeps.run.forecast.forecast",
     "solving some of the rows")])
def test_a_terminal_is_told_what_is_solved_meanwhile(words: tuple[str, ...], solver: str, said: str, folder: Path,
                                                      monkeypatch: pytest.MonkeyPatch,
                                                      capsys: pytest.CaptureFixture[str]) -> None:
    terminal = Console(stderr=True, force_terminal=True, _environ={"TERM": "xterm", "COLUMNS": "100"})
    monkeypatch.setattr("touchcal.terminal._terminal", lambda: terminal)
    monkeypatch.setattr(solver, lambda *_, **__: 1 / 0)
    monkeypatch.chdir(folder)
    with pytest.raises(ZeroDivisionError):
        app(words, standalone_mode=False)
    assert said in capsys.readouterr().err
