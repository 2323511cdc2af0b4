"""NOVA exports: columns by name, both decimal marks, overloads dropped, an impedance spectrum refused by name."""

from pathlib import Path

import numpy as np
import pytest

from matcal.readers.detect import read
from touchcal.errors import InputFileError

REAL = Path(__file__).parents[4] / "shared" / "rawsamples" / "autolab_nova"
HEAD = "Potential applied (V);Time (s);WE(1).Current (A);WE(1).Potential (V);Index;Current range\n"
ROWS = "0.5;1131.5;2.8E-04;0.4998;1;1 mA\n0.5;1132.0;-1.25e-05;0.5001;2;100 µA\n0.5;1132.5;9E-5;0.4995;3;100 µA\n"


def _write(folder: Path, text: str) -> Path:
    path = folder / "nova.txt"
    path.write_bytes(text.encode())
    return path


def _shuffled(text: str) -> str:
    order = [5, 2, 4, 1, 0, 3]
    return "".join(";".join(line.split(";")[k] for k in order) + "\n" for line in text.strip().split("\n"))


@pytest.mark.parametrize("text", [HEAD + ROWS, "\ufeff" + (HEAD + ROWS).replace("\n", "\r\n"),
                                  HEAD + ROWS.replace(".", ","), _shuffled(HEAD + ROWS),
                                  (HEAD + ROWS).replace(";", "\t"), (HEAD + ROWS).replace(";", ",")],
                         ids=["dot", "BOM and CRLF", "decimal comma", "other order", "tabs", "commas"])
def test_one_record_in_many_layouts(text: str, tmp_path: Path) -> None:
    got = read(_write(tmp_path, text))
    assert got.vendor == "nova"
    np.testing.assert_array_equal(got.columns["time"], [1131.5, 1132.0, 1132.5])
    np.testing.assert_array_equal(got.columns["current"], [2.8e-4, -1.25e-5, 9e-5])
    np.testing.assert_array_equal(got.columns["potential"], [0.4998, 0.5001, 0.4995])


def test_overloads_are_dropped_and_counted(tmp_path: Path) -> None:
    rows = ROWS.replace("1 mA", "1 mA;Current overload").replace("100 µA", "100 µA;")
    got = read(_write(tmp_path, HEAD.strip() + ";Overload\n" + rows))
    assert got.rows == 2
    assert got.notes[0] == "1 rows flagged as current overload dropped."
    with pytest.raises(InputFileError, match="every row is flagged"):
        read(_write(tmp_path, HEAD.strip() + ";Overload\n" + rows.replace("µA;", "µA;Current overload")))


@pytest.mark.parametrize(("text", "says", "line"), [
    (HEAD.replace("Time (s)", "Turn (s)") + ROWS, "no time column", 1),
    (HEAD.replace("Current (A)", "Current (V)") + ROWS, "no unit of current", 1),
    (HEAD + ROWS.replace("9E-5", "NaN"), "'NaN' is not a finite number", 4),
    (HEAD + ROWS.replace("1132.5", "1130"), "time runs backwards", None),
    (HEAD, "no table of numbers", None),
    ('"Z60W Data File: Version 1.1"\n""\n10,0,1\n', "impedance spectrum", None),
    ("Index;Frequency (Hz);Z' (Ω);-Z'' (Ω);Z (Ω)\n1;1000;1;2;3\n", "impedance spectrum", None),
])
def test_what_is_no_record_of_current_is_refused(text: str, says: str, line: int | None, tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=says) as caught:
        read(_write(tmp_path, text))
    assert caught.value.line == line


@pytest.mark.skipif(not REAL.exists(), reason="real files are not next to the checkout")
def test_real_exports() -> None:
    got = read(REAL / "HDV_G_DMAB_first400.txt")
    assert got.rows == 399
    assert got.columns["time"][0] == pytest.approx(1131.93820914213)
    assert got.columns["current"][0] == pytest.approx(-6.7169189453125e-05)
    with pytest.raises(InputFileError, match="impedance spectrum"):
        read(REAL / "impedancepy_exampleDataAutolab.txt")
