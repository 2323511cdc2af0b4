"""LabVIEW text and binary files, old workbooks, and files that are no table: read with names and units, or refused."""

import sys
from pathlib import Path

import numpy as np
import pytest

from matcal.readers.column_options import parse_selection
from matcal.readers.detect import read
from touchcal.errors import InputFileError

N = 12
TIME, TRAVEL = 0.5 * np.arange(N), np.linspace(0, 5.5, N)
FORCE = 3 * TRAVEL - 0.1 * TRAVEL**2


def _lvm(x_columns: str, separator: str = "Tab", decimal: str = ".", comment: bool = True, segments: int = 1) -> str:
    mark = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}[separator]
    head = [f"LabVIEW Measurement{mark}", f"Writer_Version{mark}2", f"Reader_Version{mark}2",
            f"Separator{mark}{separator}", f"Decimal_Separator{mark}{decimal}",
            f"Multi_Headings{mark}Yes", f"X_Columns{mark}{x_columns}", f"Time_Pref{mark}Relative",
            f"Date{mark}2024/01/31", f"Time{mark}10:00:00", f"***End_of_Header***{mark}", ""]
    lines = list(head)
    gap = mark * (2 if x_columns == "Multi" else 1)
    for part in np.array_split(np.arange(N), segments):
        first, step = TIME[part[0]], 0.5
        lines += [f"Channels{mark}2",
                  gap.join(["Samples" + mark * (x_columns != "No"), str(part.size), str(part.size)]),
                  mark.join(["Y_Unit_Label", *gap.join(["Millimeter (mm)", "Newton (N)"]).split(mark)]),
                  mark.join(["X_Dimension", *gap.join(["Time", "Time"]).split(mark)]),
                  mark.join(["X0", *gap.join([f"{first:g}", f"{first:g}"]).split(mark)]).replace(".", decimal),
                  mark.join(["Delta_X", *gap.join([f"{step}", f"{step}"]).split(mark)]).replace(".", decimal),
                  f"***End_of_Header***{mark}"]
        names = {"One": ["X_Value", "Displacement", "Force"], "No": ["X_Value", "Displacement", "Force"],
                 "Multi": ["X_Value", "Displacement", "X_Value", "Force"]}[x_columns]
        lines.append(mark.join(names + ["Comment"] * comment))
        for k in part:
            t, u, f = f"{TIME[k]:.6f}", f"{TRAVEL[k]:.6f}", f"{FORCE[k]:.6f}"
            cells = {"One": [t, u, f], "No": ["", u, f], "Multi": [t, u, t, f]}[x_columns]
            note = ["first row, by hand"] if comment and k == 0 and separator != "Comma" else []
            lines.append(mark.join([*(cell.replace(".", decimal) for cell in cells), *note]))
        lines.append("")
    return "\n".join(lines)


@pytest.mark.parametrize("x_columns", ["One", "No", "Multi"])
@pytest.mark.parametrize(("separator", "decimal"), [("Tab", "."), ("Tab", ","), ("Semicolon", ","), ("Comma", ".")])
@pytest.mark.parametrize("segments", [1, 2])
def test_one_record_in_every_layout(x_columns: str, separator: str, decimal: str, segments: int,
                                         tmp_path: Path) -> None:
    path = tmp_path / "compression.lvm"
    path.write_text(_lvm(x_columns, separator, decimal, segments=segments), encoding="utf-8")
    got = read(path)
    assert got.vendor == "labview"
    np.testing.assert_allclose(got.columns["time"], TIME, atol=1e-9)
    np.testing.assert_allclose(got.columns["displacement"], 1e-3 * TRAVEL, atol=1e-9)
    np.testing.assert_allclose(got.columns["force"], FORCE, atol=1e-6)


def test_a_measurement_file_without_numbers_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "empty.lvm"
    path.write_text(_lvm("One").split("X_Value")[0], encoding="utf-8")
    with pytest.raises(InputFileError, match="without numbers"):
        read(path)


def test_a_binary_measurement_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "compression.tdms"
    clock = {"wf_increment": 0.5, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("rig", "Position", TRAVEL, {"unit_string": "mm", **clock}),
                              nptdms.ChannelObject("rig", "Load cell", FORCE, {"unit_string": "N", **clock})])
    got = read(path)
    np.testing.assert_allclose(got.columns["time"], TIME)
    np.testing.assert_allclose(got.columns["displacement"], 1e-3 * TRAVEL)
    np.testing.assert_allclose(got.columns["force"], FORCE)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(InputFileError, match=r"damaged|no table"):
        read(path)
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(InputFileError, match=r"npTDMS is needed: pip install '\.\[labview\]'"):
        read(path)


def test_an_old_workbook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    xlwt = pytest.importorskip("xlwt")
    pytest.importorskip("xlrd")
    book, path = xlwt.Workbook(), tmp_path / "compression.xls"
    for name in ("Data", "Again"):
        sheet = book.add_sheet(name)
        for n, row in enumerate([["Time", "Displacement", "Force"], ["s", "mm", "N"],
                                 *np.column_stack([TIME, TRAVEL, FORCE]).tolist()]):
            for m, cell in enumerate(row):
                sheet.write(n, m, cell)
    book.save(str(path))
    with pytest.raises(InputFileError, match="2 sheets hold tables"):
        read(path)
    got = read(path, parse_selection("sheet=Data"))
    np.testing.assert_allclose(got.columns["force"], FORCE)
    monkeypatch.setitem(sys.modules, "xlrd", None)
    with pytest.raises(InputFileError, match=r"xlrd is needed: pip install '\.\[excel\]'"):
        read(path)


def test_a_binary_file_is_called_one(tmp_path: Path) -> None:
    path = tmp_path / "test.dat"
    rng = np.random.default_rng(3)
    for data in (rng.bytes(5000), bytes(range(1, 256)) * 20, b"HEAD" + bytes(500) + rng.bytes(900)):
        path.write_bytes(data)
        with pytest.raises(InputFileError, match="binary file of a kind that is not known"):
            read(path)
