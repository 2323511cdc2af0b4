"""Workbooks: the sheet with the table, NOVA and plain columns as in text, damaged files refused by name."""

from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest

from matcal.readers.column_options import parse_selection, selections_of
from matcal.readers.detect import read
from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError

SHARED = Path(__file__).parents[4] / "shared" / "rawsamples"
TABLE = [["strain", "stress", "note"], ["-", "kPa", None], [0, 0, "start"], [-0.1, -1.6125, None], [-0.25, -2.9, "x"]]


def _book(folder: Path, **sheets: list[list[Any]]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    path = folder / "uniaxial.xlsx"
    book.save(path)
    return path


def test_the_only_sheet_with_a_table_is_read(tmp_path: Path) -> None:
    got = read(_book(tmp_path, Notes=[["made", "on a Monday"]], Data=[[], *TABLE]))
    np.testing.assert_allclose(got.columns["stress"], [0, -1612.5, -2900])
    assert got.notes[0] == "sheet 'Data' read, the only one with a table."
    assert got.first_line == 4


def test_of_several_sheets_the_user_chooses(tmp_path: Path) -> None:
    path = _book(tmp_path, A=TABLE, B=[["strain", "stress (Pa)"], [0, 0], [0.1, 5]])
    with pytest.raises(InputFileError, match=r"2 sheets hold tables: 'A', 'B'.*uniaxial\.xlsx=sheet=A"):
        read(path)
    assert read(path, parse_selection("sheet=B")).columns["stress"][1] == 5
    with pytest.raises(InputFileError, match="no sheet 'C'; its sheets: 'A', 'B'"):
        read(path, parse_selection("sheet=C"))


def test_numbers_and_faults_in_cells(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="'#DIV/0!' is not a finite number") as caught:
        read(_book(tmp_path, A=[*TABLE, [0.3, "#DIV/0!"]]))
    assert caught.value.line == 6
    with pytest.raises(InputFileError, match="no table of numbers"):
        read(_book(tmp_path, A=[["strain", "stress"]]))


def test_nova_sheet_with_two_clocks_and_overloads(tmp_path: Path) -> None:
    head = ["Time (s)", "WE(1).Potential (V)", "WE(1).Current (A)", "Corrected time (s)", "Current range", "Overload"]
    rows = [[131.3 + k / 100, 0.8, 1e-4 * k, k / 100, "10 µA", "Current overload" if k < 2 else ""] for k in range(9)]
    got = read(_book(tmp_path, Sheet1=[head, *rows]))
    assert (got.vendor, got.rows) == ("nova", 7)
    assert got.columns["time"][0] == pytest.approx(131.32)
    assert any("'Corrected time' left out (the same, shifted by -131.3 s)" in note for note in got.notes)
    assert any("2 rows flagged as current overload dropped" in note for note in got.notes)
    with pytest.raises(InputFileError, match="impedance spectrum"):
        read(_book(tmp_path, A=[["Frequency (Hz)", "Z' (Ω)", "-Z'' (Ω)"], [1000, 1, 2], [100, 2, 3]]))


@pytest.mark.parametrize("data", [b"PK\x03\x04 and so on", b"PK\x03\x04" + bytes(200)])
def test_damaged_workbooks_are_refused(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "book.xlsx").write_bytes(data)
    with pytest.raises(InputFileError, match="workbook is damaged"):
        read(tmp_path / "book.xlsx")


@pytest.mark.skipif(not SHARED.exists(), reason="real files are not next to the checkout")
def test_real_workbooks() -> None:
    got = read(SHARED / "autolab_nova" / "3_GC_PFOS_5ppm_5s_CA.xlsx")
    assert (got.vendor, got.rows) == ("nova", 498)
    foam = SHARED / "foam_leap" / "foam_leap_Foam.xlsx"
    with pytest.raises(InputFileError, match=r"10 'turbo-shr-strain'.*stretch=1,stress=2,deviation=3:kPa"):
        read(foam)
    chosen = [parse_selection("uniaxial=stretch=1,stress=2,deviation=3:kPa"),
              parse_selection("shear=strain=4,stress=leap-shr-stress,deviation=6:kPa")]
    inputs = [("uniaxial", (foam,)), ("shear", (foam,))]
    uniaxial, shear = reduce_tests(inputs, columns=selections_of(inputs, chosen))
    csv = read(SHARED / "foam_leap" / "foam_leap_UC.csv").columns
    np.testing.assert_allclose(uniaxial.value[:101], csv["stress"], rtol=1e-6, atol=1)
    assert uniaxial.deviation is not None
    assert uniaxial.deviation[0] == pytest.approx(13732.55, rel=1e-6)
    assert shear.strain[0] == -0.15
