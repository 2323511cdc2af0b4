"""Plain tables: every way to write the same numbers reads alike, and every doubt is named with its line."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from matcal.readers.detect import read
from matcal.readers.units import si_factor, split_name
from matcal.readers.vocabulary import quantity_of
from touchcal.errors import InputFileError

SHARED = Path(__file__).parents[4] / "shared" / "rawsamples"
STRAIN, STRESS = [0.0, -0.1, -0.25], [0.0, -1612.5, -2900.0]

SAME = {
    "units row": "strain,stress\n-,kPa\n0,0\n-0.1,-1.6125\n-0.25,-2.9\n",
    "brackets": "Strain (%),Stress [Pa]\n0,0\n-10,-1612.5\n-25,-2900\n",
    "suffix": "strain,P_MPa\n0,0\n-0.1,-0.0016125\n-0.25,-0.0029\n",
    "semicolons and decimal commas": "strain;stress (kPa)\n0,0;0,0\n-0,1;-1,6125\n-0,25;-2,9\n",
    "tabs": "strain\tstress\n-\tkPa\n0\t0\n-0.1\t-1.6125\n-0.25\t-2.9\n",
    "tabs and decimal commas": "strain\tstress\n-\tkPa\n0,0\t0,0\n-0,1\t-1,6125\n-0,25\t-2,9\n",
    "blanks": "strain stress\n- kPa\n 0 0\n-0.1   -1.6125\n-0.25  -2.9\n",
    "CRLF, quotes, comment, blank lines": '# foam 7\r\n\r\n"strain","stress"\r\n"-","kPa"\r\n"0","0"\r\n'
                                         '-0.1,-1.6125\r\n-0.25,-2.9\r\n\r\n',
    "further column": "n,strain,stress\n,-,kPa\n1,0,0\n2,-0.1,-1.6125\n3,-0.25,-2.9\n",
    "other order": "stress (kPa),strain\n0,0\n-1.6125,-0.1\n-2.9,-0.25\n",
    "stretch": "lambda,P_kPa\n1,0\n0.9,-1.6125\n0.75,-2.9\n",
    "units in words": "Stauchung in %;Druckspannung in kPa\n0;0\n-10;-1,6125\n-25;-2,9\n",
    "symbols over units": "e/%,sigma/kPa\n0,0\n-10,-1.6125\n-25,-2.9\n",
    "properties and results above": "Rate,100,mm/min\n,Largest stress (kPa),at strain\n1,2.9,-0.25\nRaw data\n"
                                    "strain,stress (kPa)\n0,0\n" + 4 * "-0.1,-1.6125\n" + 7 * "-0.25,-2.9\n",
}


def _write(folder: Path, text: str, encoding: str = "utf-8", name: str = "uniaxial.csv") -> Path:
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return path


@pytest.mark.parametrize("text", SAME.values(), ids=SAME.keys())
def test_one_curve_written_in_many_ways(text: str, tmp_path: Path) -> None:
    got = read(_write(tmp_path, text)).columns
    strain = got["strain"] if "strain" in got else got["stretch"] - 1
    once = np.r_[True, np.diff(strain) != 0]
    np.testing.assert_allclose(strain[once], STRAIN, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(got["stress"][once], STRESS, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_encodings(encoding: str, tmp_path: Path) -> None:
    text = "# Prüfkörper für Versuch Nr. 3, Prüfgeschwindigkeit gemäß Norm\nstrain;stress (kPa)\n0;0\n0,1;1\n0,2;2\n"
    assert read(_write(tmp_path, text, encoding)).columns["stress"][-1] == 2000.0


@given(st.lists(st.tuples(st.floats(-0.9, 2.0), st.floats(-1e6, 1e6)), min_size=3, max_size=30),
       st.sampled_from([(",", "."), (";", ","), ("\t", "."), ("\t", ","), (";", ".")]))
def test_numbers_survive_any_layout(tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[float, float]],
                                    layout: tuple[str, str]) -> None:
    delimiter, decimal = layout
    assume(np.all(np.abs(rows).max(axis=0) > 1e-9))  # columns of less are refused
    body = "".join(f"{e!r}{delimiter}{p!r}\n".replace(".", decimal) for e, p in rows)
    path = _write(tmp_path_factory.mktemp("any"), f"strain{delimiter}stress\n-{delimiter}Pa\n{body}")
    got = read(path).columns
    np.testing.assert_array_equal(np.column_stack([got["strain"], got["stress"]]), np.array(rows))


BAD = {
    "empty": ("", "the file is empty", None),
    "only a byte-order mark": ("\ufeff \n", "the file is empty", None),
    "nan": ("strain,stress\n-,kPa\n0,0\n0.1,nan\n0.2,2\n", "'nan' is not a finite number", 4),
    "empty cell": ("strain,stress\n-,kPa\n0,0\n0.1,\n0.2,2\n", "the cell is missing", 4),
    "word in a column": ("strain,stress\n-,kPa\n0,0\n0.1,1\n0.2,break\n", "'break' is not a finite number", 5),
    "short row after a blank line": ("strain,stress\n-,kPa\n0,0\n\n0.1\n0.2,2\n", "the cell is missing", 5),
    "no units": ("strain,stress\n0,0\n0.1,1\n0.2,2\n", "has no unit", 1),
    "a unit of something else": ("strain,stress\n-,mm\n0,0\n0.1,1\n", "no unit of stress", 2),
    "nonsense as a unit": ("strain,stress (floop)\n0,0\n0.1,1\n", "not known. Units of stress", 1),
    "no header": ("0.0255 1.02\n0.1344 1.125\n0.2256 1.24\n", "no line of column names", 1),
    "unknown names": ("a,b\n1,2\n2,3\n", "fewer than two columns are known", 1),
    "two of one kind": ("strain,stress,sigma\n-,kPa,kPa\n0,0,0\n0.1,1,2\n", "are both stress and differ", 2),
    "short line of units": ("strain,stress,time\n-,kPa\n0,0,0\n0.1,1,1\n", "line of units has 2 cells", 2),
    "percent without saying so": ("strain,stress (kPa)\n0,0\n-40,-3\n-80,-20\n", "reaches 80 and has no unit", 1),
    "a channel without a sensor": ("strain,stress\n" + "".join(f"0.{k},-3000\n" for k in range(5)),
                                   "'stress' is -3000 in every row and has no unit.*without a sensor", 1),
    "a second force without a sensor": ("displacement_mm,force_N,force_2\n" + "".join(
        f"{k},{2 * k},-9999\n" for k in range(5)), "'force_2' is -9999 in every row", 1),
    "a strain without a sensor": ("strain,stress (kPa)\n" + "".join(f"-3000,{k}\n" for k in range(5)),
                                  "'strain' is -3000 in every row, which no strain is", 1),
    "commas for all": ("strain,stress\n-,kPa\n0,0,0,0\n0,1,1,5\n0,2,2,75\n", "both decimal mark and separator", 3),
    "two records": ("strain,stress (kPa)\n0,0\n0.1,1\n0.2,2\nsecond\nstrain,stress (kPa)\n0,0\n0.1,1\n",
                    "2 tables stand one below the other", 7),
    "prose": ("This is not a table.\nNor is this.\n", "no table of numbers", None),
}


def test_a_name_with_a_percent_sign_behind_a_line_has_that_unit(tmp_path: Path) -> None:
    got = read(_write(tmp_path, "strain_%,stress_kPa\n0,0\n-20,-1\n-40,-3\n")).columns
    np.testing.assert_allclose(got["strain"], [0, -0.2, -0.4])


@pytest.mark.parametrize(("text", "says", "line"), BAD.values(), ids=BAD.keys())
def test_doubt_is_refused_by_name_and_line(text: str, says: str, line: int | None, tmp_path: Path) -> None:
    path = _write(tmp_path, text)
    with pytest.raises(InputFileError, match=says) as caught:
        read(path)
    assert caught.value.line == line
    assert str(path) in str(caught.value)


def test_missing_file_folder_workbook_and_foreign_machine(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="no such file"):
        read(tmp_path / "absent.csv")
    with pytest.raises(InputFileError, match="no such file"):
        read(tmp_path / "nowhere" / "absent (Timed).txt")
    with pytest.raises(InputFileError, match="no TestSuite text file"):
        read(tmp_path)
    (tmp_path / "book.xlsx").write_bytes(b"PK\x03\x04 and so on")
    with pytest.raises(InputFileError, match="workbook"):
        read(tmp_path / "book.xlsx")
    with pytest.raises(InputFileError, match="MTS 793"):
        read(_write(tmp_path, "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n"))


@pytest.mark.parametrize(("cell", "name", "unit"), [
    ("Stress (kPa)", "Stress", "kPa"), ("Force [N]", "Force", "N"), ("P_MPa", "P", "MPa"), ("strain", "strain", None),
    ("Displacement, mm", "Displacement", "mm"), ("Load / kN", "Load", "kN"),
    ("WE(1).Current (A)", "WE(1).Current", "A"), ("F/N", "F", "N"), ("s/mm", "travel", "mm"),
    ("s [mm]", "travel", "mm"), ("Kraft in kN", "Kraft", "kN"), ("v/v0", "v/v0", None), ("s", "s", None),
    ("sigma_11", "sigma_11", None), ("nominal_strain", "nominal_strain", None)])
def test_names_and_units_of_header_cells(cell: str, name: str, unit: str | None) -> None:
    assert split_name(cell) == (name, unit)


@pytest.mark.parametrize(("unit", "quantity", "factor"), [
    ("mm", "displacement", 1e-3), ("kN", "force", 1e3), ("sec", "time", 1.0), ("min", "time", 60.0),
    ("%", "strain", 0.01), ("µA", "current", 1e-6), ("μA", "current", 1e-6), ("N/mm^2", "stress", 1e6),
    ("MPa", "stress", 1e6), ("-", "strain", 1.0), ("", "stress", None), ("kPa", "force", None), ("1", "time", None),
    ("S/cm", "conductivity", 100)])
def test_units(unit: str, quantity: str, factor: float | None) -> None:
    assert si_factor(unit, quantity) == (None if factor is None else pytest.approx(factor, rel=1e-12))


def test_true_stress_is_not_taken_for_nominal() -> None:
    assert quantity_of("True stress") is None
    assert quantity_of("Nominal stress") == "stress"


@pytest.mark.skipif(not SHARED.exists(), reason="real files are not next to the checkout")
def test_real_foam_tables() -> None:
    compression = read(SHARED / "foam_leap" / "foam_leap_UC.csv").columns
    assert compression["stretch"].min() == 0.4
    assert compression["stress"][0] == pytest.approx(-241599.607)
    shear = read(SHARED / "foam_leap" / "foam_leap_SS.csv")
    assert shear.columns["strain"][0] == -0.15
    assert any("read as strain" in note for note in shear.notes)
    with pytest.raises(InputFileError, match="no line of column names"):
        read(SHARED / "Treloar1944_UT.txt")
