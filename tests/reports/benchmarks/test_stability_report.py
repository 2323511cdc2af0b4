"""The report of stiff and extreme cases shows every cell, lost ones too, and says what was not measured."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from benchmarks.report.stability import WRITERS, report
from benchmarks.report.stability_numerics import _cell as digits_cell
from benchmarks.report.stability_readings import cell as reading_cell
from benchmarks.report.state_map import CAUTION, KEPT, LOST
from benchmarks.report.stored_tables import write
from reports.document.verdict import GOOD, NOT_USABLE, USABLE
from touchcal.errors import InputFileError

Reader = Callable[[Path], Any]
TABLES: dict[str, dict[str, Any]] = {
    "stable_ranges": {"law": "foam", "criterion": ["drucker", "drucker", "elliptic"], "mode": "uniaxial",
                      "strain_from": [-0.9, -0.5, -0.9], "strain_to": [-0.5, -0.3, 1.0],
                      "state": ["kept", "lost", "kept"]},
    "stable_functions": {"law": "foam", "stretch": [0.5, 1.0, 1.5], "h_over_mu_0": [-0.1, 1.0, 2.0]},
    "stiff": {"case": ["deep", "deeper"], "outcome": ["9 mm deep", "not converged: too deep. And so on"],
              "error": [1e-3, None],
              "cpu_s": [1.25, 60.0]},
    "random_scenes": {"card": "foam", "d_mm": [8.0, 20.0, 12.0], "F_N": [0.01, 10.0, 1.0], "x_mm": [0.0, 30.0, 3.0],
                      "y_mm": [0.0, 40.0, 4.0], "friction": "none", "outcome": ["ok", "not_converged", "ok"],
                      "message": [None, "It stopped. Press less. Third.", None],
                      "fraction_non_elliptic": [0.0, None, 0.02]},
    "relaxation_stiff": {"what": ["history in shear"] * 2 + ["touch held at 1 N"], "ratio": [1.0, 1e6, 1.5],
                         "step_over_tau_1": [1.0, 1.0, None], "outcome": "ok", "error": [2.2e-14, 2.2e-6, 5e-4]},
    "electrics_stiff": {"elements": "P1", "of": ["disc of 15 mm"] * 2 + ["cut"], "contrast": [1e-9, 1e-9, 1e-18],
                        "z_Ohm_m": 1.0, "method": ["eitsim", "LU", "eitsim"], "refinements": [0, 0, None],
                        "digits_lost": [0.5, 12.5, None], "outcome": ["solved", "solved", "refused: torn"]},
    "surrogate_noise": {"method": "ridge", "kind": ["noise", "noise", "shift"], "case": ["none", "40 dB", "gain"],
                        "output": "x0", "rmse_ratio": [1.0, 20.0, 3.0], "coverage_90": [0.91, 0.9, 0.85]}}


def write_tables(folder: Path, *names: str) -> None:
    for name in names:
        table = pd.DataFrame(TABLES[name]).assign(machine="a machine", threads=1, versions="none 1", date="2026-01-01")
        table.assign(code="0" * 12 if name == "stiff" else None).to_csv(folder / f"{name}.csv", index=False)


@pytest.mark.thorough
def test_the_report_holds_every_state_of_its_tables(tmp_path: Path, read_pdf: Reader) -> None:
    write_tables(tmp_path, *TABLES)
    write(report, tmp_path, tmp_path / "s.pdf")
    text = read_pdf(tmp_path / "s.pdf").whole
    for unit in ("Stretch", "Diameter (mm)", "Force, up to (N)", "Contact impedance (", "CPU (s)", "F (N)",
                 "relaxation time (–)", "Conductance over that of the skin (–)"):
        assert unit in text, unit
    for words in ("7 of 7 stored tables", "1 of 3 scenes lost", "1 converged with points that lost ellipticity",
                  "at most 2.0 % of the points", "It stopped. Press less.", "by LU at most 12.5 of 16", "refused",
                  "at most 10.0 of 16 digits", "1 of 2 cases did not converge", "not converged: too deep",
                  "1 of 3 cells are lost (first: 40 dB, x0)", "1 of 1 touch ok", "a scene lost", "20.0, 90 %"):
        assert words in text.replace("20, 90", "20.0, 90"), words
    assert "stiff.csv" in text
    assert "stale: the rows are of other code" in text
    assert "0 of 7 files did" in text
    for name in WRITERS:
        assert hashlib.sha256((tmp_path / f"{name}.csv").read_bytes()).hexdigest() in text
    assert "Third" not in text


def test_the_verdict_grades_laws_touches_rounding_and_noise(tmp_path: Path) -> None:
    write_tables(tmp_path, *TABLES)
    verdict = {line.what: (line.grade, line.why) for line in report(tmp_path).verdict}
    assert verdict["These laws at every strain"] == (
        USABLE, "0 of 1 lose strong ellipticity somewhere, 1 of 1 lose Drucker's condition somewhere")
    assert verdict["Touches anywhere on the disc"] == (
        NOT_USABLE, "1 of 3 random scenes lost, 1 ended with points not elliptic")
    assert verdict["Stress while a foam is held"] == (
        NOT_USABLE, "at most 10.0 of 16 digits are lost, over time ratios to 1.0 × 10⁶")
    assert verdict["Readings of any conductance"] == (
        GOOD, "at most 0.5 of 16 digits are lost, over contrasts to 1.0 × 10⁹")
    assert verdict["“ridge” under noise and shift"] == (
        NOT_USABLE, "1 of 3 outputs lost; all outputs hold at none of the levels of noise")
    assert verdict["These maps, with the code that is here"] == (USABLE, "0 of 7 tables measured by it")


def test_without_any_table_nothing_is_usable(tmp_path: Path) -> None:
    assert [line.grade for line in report(tmp_path).verdict] == [NOT_USABLE]


def test_what_was_not_measured_is_said(tmp_path: Path) -> None:
    write_tables(tmp_path, "stiff")
    made = report(tmp_path)
    assert set(made.absent) == {"laws", "functions", "scenes", "relaxation", "electrics", "readings"}
    assert made.absent["readings"].endswith("Run benchmarks/surrogate_noise.py, which writes it.")
    (tmp_path / "stiff.csv").write_text("case\nx\n")
    with pytest.raises(InputFileError, match=r"stiff\.csv.*'outcome'.*benchmarks/stiff\.py"):
        report(tmp_path)
    with pytest.raises(ValueError, match="no such folder"):
        write(report, tmp_path / "nowhere", tmp_path / "s.pdf")


def test_cells_are_lost_where_digits_intervals_or_errors_are(tmp_path: Path) -> None:
    assert [cell.state for value in (0.5, 5.0, 9.0, float("inf")) if (cell := digits_cell(value)) is not None] == [
        KEPT, CAUTION, LOST, LOST]
    assert digits_cell(None) is None
    assert [reading_cell(*one).state for one in ((1.0, 0.9), (3.0, 0.9), (30.0, 0.9), (1.0, 0.5))] == [
        KEPT, CAUTION, LOST, LOST]
