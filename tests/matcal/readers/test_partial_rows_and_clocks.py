"""Tables whose columns end at different rows, gaps within them, and times that are written as clocks."""

from pathlib import Path

import numpy as np
import pytest

from matcal.readers.clocks import elapsed
from matcal.readers.detect import read
from touchcal.errors import InputFileError

N = 60
E = np.linspace(0, -0.59, N)
P = 30 * E - 20 * E**2


def _write(folder: Path, lines: list[str], head: str = "strain,stress (kPa),C2 (V)") -> Path:
    path = folder / "uniaxial.csv"
    path.write_text("\n".join([head, *lines, ""]), encoding="utf-8")
    return path


def _rows() -> list[str]:
    return [f"{e:.6f},{p:.6f},0.83" for e, p in zip(E, P, strict=True)]


def test_the_dates_of_a_spreadsheet_are_days(tmp_path: Path) -> None:
    rows = [f"{row},{45358.5 + n / 86400:.10g}" for n, row in enumerate(_rows())]
    path = _write(tmp_path, rows, "strain,stress (kPa),C2 (V),Date/Time")
    with pytest.raises(InputFileError, match=r"days since 1900.*time=4:d"):
        read(path)


@pytest.mark.parametrize("tail", [1, 15, 19, 20, 25, 50])
@pytest.mark.parametrize("place", ["end", "start"])
def test_one_column_runs_on(tail: int, place: str, tmp_path: Path) -> None:
    lone = [",,0.83"] * tail
    got = read(_write(tmp_path, _rows() + lone if place == "end" else lone + _rows()))
    assert got.rows == N
    np.testing.assert_allclose(got.columns["stress"], 1e3 * P, atol=1e-2)
    assert any("only some" in note for note in got.notes)


def test_a_row_without_numbers_within_a_record_is_left_out_and_said(tmp_path: Path) -> None:
    rows = _rows()
    rows[30] = "NaN,NaN,NaN"
    got = read(_write(tmp_path, rows))
    np.testing.assert_allclose(got.columns["strain"], np.delete(E, 30), atol=1e-6)
    assert any("1 rows within the record" in note and "line 32" in note for note in got.notes)
    rows[5:20] = ["NaN,1,1"] * 15
    with pytest.raises(InputFileError, match="not a finite number"):
        read(_write(tmp_path, rows))


def test_a_column_that_ends_half_way_is_named(tmp_path: Path) -> None:
    rows = _rows()[:10] + [f"{e:.6f},,0.83" for e in E[10:]]
    with pytest.raises(InputFileError, match="column 'stress' has numbers in 10 of 60 rows"):
        read(_write(tmp_path, rows))


@pytest.mark.parametrize(("first", "second", "seconds"), [
    ("10:00:01", "10:00:03", 2.0), ("10:00:01.250", "10:00:03.5", 2.25), ("00:59", "01:01", 2.0),
    ("01:02.5", "01:03.0", 0.5),
    ("2024-01-31T23:59:59", "2024-02-01T00:00:01.5", 2.5), ("2024-01-31 10:00:00Z", "2024-01-31 10:01:00Z", 60.0),
    ("31.01.2024 23:59:59,5", "01.02.2024 00:00:00,5", 1.0), ("1/31/2024 11:59:59 AM", "1/31/2024 12:00:00 PM", 1.0),
    ("20241231T235959.5", "20250101T000001Z", 1.5), ("31-Dec-2024 23:59:59", "1 Jan 2025 00:00:00", 1.0),
    ("Jan 31, 2024 11:59:59 AM", "Jan 31, 2024 12:00:00 PM", 1.0),
    ("Do, 7. März 2024 10:00:00", "7. Mai 2024 10:00:00", 5270400.0),
    ("23:59:59", "00:00:01", 2.0), ("100:00:00", "100:00:01", 1.0)])
def test_a_clock_is_seconds_from_the_first_row(first: str, second: str, seconds: float) -> None:
    assert elapsed([first, second, "word"]) == [0.0, pytest.approx(seconds), None]


@pytest.mark.parametrize("head", ["Time,strain,stress (kPa)", "Time (hh:mm:ss),strain,stress (kPa)",
                                  "Timestamp,strain,stress\nhh:mm:ss.fff,-,kPa", "Zeit [s],strain,stress (kPa)"])
@pytest.mark.parametrize("dated", [False, True])
def test_a_table_with_a_clock(head: str, dated: bool, tmp_path: Path) -> None:
    rows = [f"{'2024-03-01T' if dated else ''}09:{k // 60 + 58:02d}:{k % 60:02d}.500,{e:.6f},{p:.6f}"
            for k, (e, p) in enumerate(zip(E, P, strict=True))]
    got = read(_write(tmp_path, rows, head))
    np.testing.assert_allclose(got.columns["time"], np.arange(N))
    np.testing.assert_allclose(got.columns["strain"], E, atol=1e-6)
