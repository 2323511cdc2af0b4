"""TestSuite exports: whole or in parts, in any order, and refused where the parts do not belong together."""

from pathlib import Path

import numpy as np
import pytest

from matcal.readers.detect import files_of, read
from touchcal.errors import InputFileError

REAL = Path(__file__).parents[4] / "shared" / "rawsamples" / "mts_testsuite"
DATA = Path(__file__).parents[3] / "data_raw"
HEAD = ("\ufeffFile Path: C:\\Lab\\foam.txt   \nTest: compression v3\nTest Run: {run}\nDate: 1/2/2024 9:00:00 AM\n\n\n"
        "Crosshead \tLoad \tTime \nmm\tN\tsec\n")


def _part(folder: Path, number: str, times: list[float], run: str = "Run 1", ending: str = "\n") -> Path:
    path = folder / f"foam__DAQ- Crosshead, … - (Timed){number}.txt"
    rows = "".join(f"{-t}\t{2 * t}\t{t}\n" for t in times)
    path.write_bytes((HEAD.format(run=run) + rows).replace("\n", ending).encode())
    return path


def test_columns_in_si_with_head_and_line(tmp_path: Path) -> None:
    got = read(_part(tmp_path, "", [0.0, 0.5, 1.0], ending="\r\n"))
    np.testing.assert_allclose(got.columns["displacement"], [0.0, -0.5e-3, -1e-3])
    np.testing.assert_allclose(got.columns["force"], [0.0, 1.0, 2.0])
    assert got.metadata["Test"] == "compression v3"
    assert (got.vendor, got.first_line, got.names["force"], got.units["time"]) == ("mts_testsuite", 9, "Load", "sec")
    with pytest.raises(ValueError, match="read-only"):
        got.columns["force"][0] = 1.0


def test_parts_out_of_order_with_an_empty_one_equal_the_whole(tmp_path: Path) -> None:
    time = list(np.arange(40) / 10)
    whole = read(_part(tmp_path / "whole" if (tmp_path / "whole").mkdir() is None else tmp_path, "", time))
    parts = tmp_path / "parts"
    parts.mkdir()
    files = [_part(parts, "", time[30:]), _part(parts, "1", time[:10]), _part(parts, "3", time[10:30])]
    empty = parts / files[0].name.replace("(Timed)", "(Timed)2")
    empty.write_bytes(b"\xef\xbb\xbf")
    for given in (parts, *files, empty):
        got = read(given)
        for quantity, values in whole.columns.items():
            np.testing.assert_array_equal(got.columns[quantity], values)
        assert [p.name for p in got.paths] == [files[1].name, files[2].name, files[0].name]
        assert files_of(given) == sorted([*files, empty])
        assert any("3 parts joined" in note for note in got.notes)
        assert any("(Timed)2.txt holds nothing" in note for note in got.notes)


def test_parts_of_two_tests_or_twice_the_same_are_refused(tmp_path: Path) -> None:
    _part(tmp_path, "", [0.0, 1.0])
    other = _part(tmp_path, "1", [2.0, 3.0], run="Run 2")
    with pytest.raises(InputFileError, match="not parts of one test"):
        read(tmp_path)
    other.unlink()
    _part(tmp_path, "1", [0.5, 3.0])
    with pytest.raises(InputFileError, match="there twice"):
        read(tmp_path)


def test_strangers_in_a_folder_are_refused(tmp_path: Path) -> None:
    _part(tmp_path, "", [0.0, 1.0])
    (tmp_path / "notes.txt").write_text("strain,stress (kPa)\n0,0\n0.1,1\n")
    with pytest.raises(InputFileError, match=r"notes.txt.*not a part"):
        read(tmp_path)


@pytest.mark.parametrize(("body", "says", "line"), [
    ("Crosshead \tLoad \tTime \n1\t2\t3\n2\t3\t4\n", "no line of units", 8),
    ("Crosshead \tLoad \tTime \nmm\tN\tsec\n", "without numbers", 8),
    ("Crosshead \tLoad \tTime \nmm\tmm\tsec\n1\t2\t3\n", "no unit of force", 8),
    ("Foo \tBar \tTime \nmm\tN\tsec\n1\t2\t3\n", "fewer than two columns are known", 8),
    ("Crosshead \tLoad \tTime \nmm\tN\tsec\n1\t2\t3\n1\tNaN\t4\n", "'NaN' is not a finite number", 10),
    ("Crosshead \tLoad \tTime \nmm\tN\tsec\n1\t2\t3\n1\t2\n", "the cell is missing", 10),
    ("Crosshead \tLoad \tTime \nmm\tN\tsec\n1\t2\t3\nHold\nCrosshead \tLoad \tTime \nmm\tN\tsec\n1\t2\t3\n",
     r"stand again in line 11\. Save each block", 10),
])
def test_broken_files_are_named_by_line(body: str, says: str, line: int, tmp_path: Path) -> None:
    path = tmp_path / "mts.txt"
    path.write_bytes((HEAD.format(run="1").split("Crosshead")[0] + body).encode())
    with pytest.raises(InputFileError, match=says) as caught:
        read(path)
    assert caught.value.line == line


def test_synthetic_record() -> None:
    got = read(DATA / "mts_relaxation.txt")
    assert got.rows == 18301
    assert "SYNTHETIC" in got.metadata["Test"]


@pytest.mark.skipif(not REAL.exists(), reason="real files are not next to the checkout")
def test_real_split_test() -> None:
    got = read(REAL)
    assert (got.rows, len(got.paths)) == (8888, 5)
    assert np.all(np.diff(got.columns["time"]) > 0)
    assert got.columns["displacement"][0] == pytest.approx(-2.90800840593874e-3)
    assert [p.name[-5] for p in got.paths] == ["5", "1", "4", "3", ")"]
