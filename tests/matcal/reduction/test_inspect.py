"""A description says what a file holds and what kind of test it is taken for, as plain JSON."""

import json
import sys
from pathlib import Path

import pytest

from matcal.cli.main import main
from matcal.reduction.inspect import inspect, print_description
from touchcal.errors import InputFileError

DATA = Path(__file__).parents[3] / "data_raw"


def test_machine_file() -> None:
    got = inspect(DATA / "mts_cyclic.txt")
    assert json.loads(json.dumps(got, allow_nan=False)) == got
    assert (got["layout"], got["kind"], got["loadings"]) == ("mts_testsuite", "conductivity", 10)
    assert got["loading_speed_mm_per_min"] == pytest.approx(5.0, rel=1e-3)
    assert got["interval_s"] == pytest.approx(0.1, rel=1e-3)
    assert got["columns"]["force"]["unit"] == "N"
    assert "SYNTHETIC" in got["head"]["Test"]


def test_file_of_no_clear_kind_is_described_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "foam.csv").write_text("strain,stress (kPa)\n0,0\n0.1,1\n")
    got = inspect(tmp_path / "foam.csv")
    assert got["kind"] is None
    assert "Write KIND=foam.csv" in got["kind_reason"]
    with pytest.raises(InputFileError, match="no such file"):
        inspect(tmp_path / "absent.csv")


HEAD_793 = "Datenerfassung\t\tZeit:\t9\ts\t28.01.2015\nLaufzeit\tCh 1 Weg\tCh 1 Kraft\ns\tmm\tkN\n"
TWO_BLOCKS = ("MTS793|MPT|DEU|1|2|,|.|:|49|1|1|A\n\nBediener Information\t\tZeit:\t3,8\ts\t28.01.2015\n"
              f"Durchmesser (mm)\t50,5\n\n{HEAD_793}0,5\t0\t0,001\n1,5\t0,5\t0,1\n\n{HEAD_793}2,5\t1,5\t0,2\n")


def test_blocks_sizes_and_the_folder_of_a_controller_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "Druckversuch Probe 7" / "specimen.dat"
    path.parent.mkdir()
    path.write_bytes(TWO_BLOCKS.encode("cp1252"))
    got = inspect(path)
    assert got["blocks"] == {"1": 2, "2": 1}
    assert got["specimen"] == {"diameter_m": pytest.approx(0.0505)}
    assert (got["kind"], got["columns"]["force"]["max"]) == ("uniaxial", 200.0)
    assert "Druckversuch Probe 7" in got["kind_reason"]
    print_description("specimen.dat", got)
    printed = capsys.readouterr().out
    for said in ("MTS 793 specimen.dat, 3 rows", "Ch 1 Kraft", "0.2  kN", "diameter 50.5 mm", "1 (2 rows), 2 (1 rows)"):
        assert said in printed


@pytest.mark.parametrize(("name", "kind"), [
    ("foam_pure_shear.csv", "planar"), ("Scherversuch_3.csv", "shear"), ("Druckversuch.csv", "uniaxial"),
    ("压缩试验.csv", "uniaxial"), ("剪切.csv", "shear"), ("essai_relaxation.csv", "relaxation"),
    ("hydrostatic.csv", "volumetric"), ("traction-2.csv", "uniaxial"), ("biaxial tension.csv", "biaxial")])
def test_kinds_by_name(name: str, kind: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("strain,stress (kPa)\n0,0\n0.1,1\n")
    assert inspect(tmp_path / name)["kind"] == kind


def test_kind_by_columns(tmp_path: Path) -> None:
    (tmp_path / "foam.csv").write_text("volume ratio,pressure (kPa)\n1,0\n0.9,10\n")
    assert inspect(tmp_path / "foam.csv")["kind"] == "volumetric"


def _run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["matcal", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_columns_on_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "tension.txt"
    path.write_text("0.02 1.02\n0.13 1.12\n0.22 1.24\n")
    assert _run(monkeypatch, "inspect", path) == 2
    assert "--columns" in capsys.readouterr().err
    assert _run(monkeypatch, "inspect", path, "--columns", "tension.txt=stress=1:MPa,stretch=2", "--json") == 0
    assert json.loads(capsys.readouterr().out)[str(path)]["columns"]["stress"]["max"] == pytest.approx(2.2e5)
    assert _run(monkeypatch, "inspect", path, "--columns", "other.txt=stress=1:MPa") == 2
    assert "fits no file" in capsys.readouterr().err


def test_a_folder_of_something_else_explains_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                    capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "uniaxial.csv").write_text("strain,stress (kPa)\n0,0\n0.1,1\n")
    assert _run(monkeypatch, "fit", tmp_path, "--out", tmp_path / "card.json") == 2
    assert "it holds uniaxial.csv). A folder stands for one test" in capsys.readouterr().err


def test_temperatures_are_shown_in_the_unit_that_stands_next_to_them(tmp_path: Path,
                                                                     capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "dma.csv").write_text("f (Hz),E' (MPa),E\" (MPa),Temperature (C)\n1,2,0.1,20\n2,2,0.1,21\n3,2,0.1,22\n")
    print_description("dma.csv", inspect(tmp_path / "dma.csv"))
    row = next(line for line in capsys.readouterr().out.splitlines() if "Temperature" in line)
    assert row.split()[-3:] == ["293.15", "295.15", "K"]


def test_a_hold_without_its_ramp_is_said_to_be_one(tmp_path: Path) -> None:
    """`matcal fit` reads it; that nothing moves is no fault of it."""
    rows = "".join(f"{t},8,{60 + 40 * 0.9**t:.4f}\n" for t in range(30))
    (tmp_path / "relaxation.csv").write_text(f"Time (s),Displacement (mm),Force (N)\n{rows}")
    found = inspect(tmp_path / "relaxation.csv")
    assert found["motion"].startswith("none: the displacement stays at 8 mm, as in a hold")
