"""The page of real skins, from a table made by formula in the layout of the benchmark; no skin measured."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from matplotlib.figure import Figure

from benchmarks.report.real_skins import report
from benchmarks.report.stored_tables import write
from touchcal.errors import InputFileError


def rows() -> pd.DataFrame:
    """Two skins; the error falls as the root of the labels, the intervals of the second hold 70 % from 20 labels."""
    made = []
    for skin in ("skin_plain", "hydrogel"):
        for labels, trained in ((20, 20), (100, 100), (0, 1600)):
            for split in ("time", "random"):
                held = 0.7 if (skin, labels) == ("hydrogel", 20) else 0.9
                made.append({"skin": skin, "labels": labels, "split": split, "taken": "last" if split == "time"
                             else "random", "drift": None, "output": "place", "unit": "mm", "trained": trained,
                             "tested": 400, "error": 40 / trained**0.5, "kernel_ridge": 60 / trained**0.5,
                             "mean": 26.0, "x_in_90": held, "y_in_90": 0.91})
    depth = made[0] | {"output": "z_mm", "error": 0.4, "kernel_ridge": 0.6, "mean": 3.2, "x_in_90": None,
                       "y_in_90": None, "label_in_90": 0.93}
    return pd.DataFrame([*made, depth])


def test_the_page_grades_skins_and_intervals_and_lists_other_labels(
        tmp_path: Path, read_pdf: Callable[[Path], Any], drawn: list[Figure]) -> None:
    rows().to_csv(tmp_path / "real_skins.csv", index=False)
    found = report(tmp_path)
    grades = {line.what: line.grade for line in found.verdict}
    assert grades["Places on hydrogel"] == "good"
    assert grades["90 % intervals from fewer than 100 labels"] == "not usable"
    assert grades["90 % intervals from 100 labels on"] == "good"
    write(report, tmp_path, tmp_path / "page.pdf")
    assert len(drawn) == 1
    text = read_pdf(tmp_path / "page.pdf").whole
    assert "z_mm" in text
    assert "70 % to 91 %" in text


def test_a_missing_table_or_column_is_said(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "reports", "real-skins", "--results", str(tmp_path), "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "real_skins.pdf").is_file()
    rows().drop(columns="kernel_ridge").to_csv(tmp_path / "real_skins.csv", index=False)
    with pytest.raises(InputFileError, match="no column kernel_ridge"):
        report(tmp_path)
