"""MTS 793 files: any delimiter, decimal mark and language; blocks counted, put together, or left out with a reason."""

from pathlib import Path

import numpy as np
import pytest

from matcal.readers.column_options import parse_selection
from matcal.readers.detect import read
from touchcal.errors import InputFileError

TIMES, TRAVELS, FORCES = np.arange(12) / 4, -np.arange(12) * 0.3, -np.arange(12) * 0.0021
WORDS = {
    "DEU": ("Bediener Information", "Datenerfassung", "Zeit:", ["Laufzeit", "Ch 1 Weg", "Ch 1 Kraft"]),
    "ENU": ("Operator Information", "Data Acquisition", "Time:", ["Running Time", "Axial Displacement", "Axial Force"]),
    "FRA": ("Informations opérateur", "Acquisition de données", "Temps:", ["Temps", "Déplacement", "Force"]),
    "CHS": ("操作员信息", "数据采集", "时间:", ["运行时间", "轴向位移", "轴向力"]),
}


def _file(folder: Path, language: str = "ENU", code: str = "2", decimal: str = ".", splits: tuple[int, ...] = (5,),
          padding: int = 0, units: tuple[str, ...] = ("s", "mm", "kN")) -> Path:
    """One record cut into acquisition blocks at `splits`."""
    operator, acquisition, clock, names = WORDS[language]
    delimiter = {"0": " ", "1": ",", "2": "\t"}[code]

    def line(*cells: object) -> str:
        texts = [str(c).replace(".", decimal) if isinstance(c, float) else f'"{c}"' if " " in str(c) else str(c)
                 for c in cells]
        return delimiter.join(texts) + delimiter * padding + "\n"

    gap = [] if code == "0" else [""] * 5
    text = f"MTS793|MPT|{language}|1|{code}|{decimal}|.|:|49|1|1|A\n\n"
    text += line(operator, *gap, clock, 3.8, "s", "1/28/15")
    text += line("Remarks", "a quoted cell") + line("Diameter (mm)", 50.5) + line("Mass", 12.0) + "\n"
    for rows in np.split(np.column_stack([TIMES, TRAVELS, FORCES]), splits):
        text += line(acquisition, *gap, clock, 20.5, "s", "1/28/15") + line(*names) + line(*units)
        text += "".join(line(*(float(v) for v in row)) for row in rows) + "\n"
    path = folder / "specimen.dat"
    path.write_bytes(text.encode("gb18030" if language == "CHS" else "cp1252"))
    return path


@pytest.mark.parametrize(("language", "code", "decimal", "splits", "padding"), [
    ("ENU", "2", ".", (5,), 0), ("DEU", "2", ",", (3, 8), 0), ("FRA", "2", ",", (5,), 4), ("CHS", "2", ".", (5,), 0),
    ("ENU", "1", ".", (5,), 0), ("ENU", "0", ".", (), 0), ("DEU", "0", ",", (5,), 0)])
def test_one_record_in_any_delimiter_mark_language_and_cut(language: str, code: str, decimal: str,
                                                           splits: tuple[int, ...], padding: int,
                                                           tmp_path: Path) -> None:
    got = read(_file(tmp_path, language, code, decimal, splits, padding))
    assert got.vendor == "mts_793"
    np.testing.assert_allclose(got.columns["time"], TIMES)
    np.testing.assert_allclose(got.columns["displacement"], TRAVELS * 1e-3)
    np.testing.assert_allclose(got.columns["force"], FORCES * 1e3)
    np.testing.assert_array_equal(np.unique(got.columns["block"]), np.arange(len(splits) + 1) + 1)
    assert got.properties == {"diameter": pytest.approx(0.0505)}
    assert any(f"{len(splits) + 1} acquisition blocks" in note for note in got.notes)


def test_blocks_with_other_columns_or_none_are_left_out_and_said(tmp_path: Path) -> None:
    path = _file(tmp_path)
    title = "Data Acquisition\t\t\tTime:\t1\ts\t1/28/15\n"
    text = path.read_text(encoding="cp1252")
    first, rest = text.split('"Data Acquisition"', 1)
    path.write_text(first + title + "Axial Force\tAxial Displacement\nkN\tmm\n-0.02\t-3\n\nData Acquisition" + rest
                    + title + "Running Time\tAxial Displacement\tAxial Force\ns\tmm\tkN\n", encoding="cp1252")
    got = read(path)
    assert got.rows == TIMES.size
    np.testing.assert_array_equal(np.unique(got.columns["block"]), [2, 3])
    assert any("block 1 (1 rows of force, displacement) left out" in note for note in got.notes)
    assert "block 4 holds nothing." in got.notes


def test_a_set_point_is_not_taken_for_the_force(tmp_path: Path) -> None:
    path = tmp_path / "specimen.dat"
    path.write_text("MTS793|MPT|DEU|1|2|,|.|:|49|1|1|A\n\nDatenerfassung\t\tZeit:\t3,5\tSec\t9.7.2010\n"
                    "Laufzeit\tCh 1 Kraft Sollwert\tCh 1 Kraft\tCh 1 Weg\nSec\tkN\tkN\tmm\n0,5\t-1\t-0,9\t0,1\n"
                    "1,0\t-2\t-1,9\t0,2\n")
    got = read(path)
    np.testing.assert_allclose(got.columns["force"], [-900, -1900])
    got = read(path, parse_selection("time=Laufzeit,force=Ch 1 Kraft Sollwert,displacement=4"))
    np.testing.assert_allclose(got.columns["force"], [-1000, -2000])


def test_a_title_with_lines_about_the_station_below_it(tmp_path: Path) -> None:
    path = _file(tmp_path, splits=())
    text = path.read_text(encoding="cp1252").replace('"Running Time"', "Station Name:\trig 2\nFile:\tspecimen.dat\n\n"
                                                     '"Running Time"')
    path.write_text(text, encoding="cp1252")
    got = read(path)
    np.testing.assert_allclose(got.columns["displacement"], TRAVELS * 1e-3)
    assert got.metadata["Station Name"] == "rig 2"
    path.write_text(text.replace("Running Time", "9").replace("Axial", "7"), encoding="cp1252")
    assert {"displacement", "force"} <= set(read(path).columns)  # a channel may be named by a number
    head = text.split("\n")[:7]
    path.write_text("\n".join([*head, head[2], "a word", ""]), encoding="cp1252")
    with pytest.raises(InputFileError, match=r"line 3: .*titles stand in line 3, 8, but no names .* ends in a clock"):
        read(path)


def test_blocks_with_clocks_of_their_own_are_chosen_one_by_one(tmp_path: Path) -> None:
    path = _file(tmp_path)
    path.write_text(path.read_text(encoding="cp1252").replace("\n1.25\t", "\n0.25\t"), encoding="cp1252")
    with pytest.raises(InputFileError) as refused:
        read(path)
    option = str(refused.value).partition('`columns` "')[2].partition('"')[0].partition("=")[2]
    got = read(path, parse_selection(option))
    np.testing.assert_allclose(got.columns["force"], FORCES[:5] * 1e3)
    assert any("block 1 of 2 read, as given" in note for note in got.notes)
    with pytest.raises(InputFileError, match=r"block 5; blocks with numbers: 1 \(5 rows\), 2 \(7 rows\)"):
        read(path, parse_selection("block=5"))
    (tmp_path / "a.csv").write_text("strain,stress\n-,Pa\n0,0\n0.1,1\n")
    with pytest.raises(InputFileError, match="only MTS 793 files have blocks"):
        read(tmp_path / "a.csv", parse_selection("block=1"))


@pytest.mark.parametrize(("change", "says"), [
    (("|2|.|", "|7|.|"), "line 1 should give delimiter"), (("MTS793|MPT|ENU|1|2|.", "MTS793|MPT|"), "line 1"),
    (("mm\tkN", "kN\tmm"), "look exchanged"), (("\n2.0\t", "\n0.1\t"), "time runs backwards"),
    (("\n2.0\t", "\nx\t"), "'x' is not a finite number"), (("s\tmm\tkN\n", "s\tmm\n"), "line of units has 2 cells"),
    (("Data Acquisition", "Data"), "without a block"), (("\n1.25\t", "\n0.25\t"), "no common clock")])
def test_broken_files_are_named(change: tuple[str, str], says: str, tmp_path: Path) -> None:
    path = _file(tmp_path)
    text = path.read_text(encoding="cp1252")
    if says == "without a block":
        text = text.partition('"Data Acquisition"')[0]
    path.write_text(text.replace(*change), encoding="cp1252")
    with pytest.raises(InputFileError, match=says):
        read(path)
