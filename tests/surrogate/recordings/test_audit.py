"""The verdict on intervals: of a model, and of a table from elsewhere whose intervals are right, too narrow or flagged.
All numbers are drawn."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from surrogate.cli.main import app
from surrogate.statistics.calibration import LEVELS, expected_coverage, random_point_coverage, rank_histogram
from touchcal.arrays import Array


def drawn(seed: int, rows: int, width: float) -> tuple[Array, Array, Array]:
    """Targets, values and half widths (n, 2) of errors normal about 0, whose 90 % intervals are so many times too
    wide."""
    rng = np.random.default_rng(seed)
    target = rng.uniform(-40, 40, (rows, 2))
    sd = rng.uniform(1, 3, (rows, 2))
    return target, target + sd * rng.standard_normal((rows, 2)), width * 1.645 * sd


def test_diagnostics_are_even_where_intervals_are_right() -> None:
    target, value, half = drawn(1, 4000, 1.0)
    np.testing.assert_allclose(expected_coverage(target[:, 0], value[:, 0], half[:, 0]), LEVELS, atol=0.03)
    np.testing.assert_allclose(random_point_coverage(target, value, half), LEVELS, atol=0.03)
    np.testing.assert_allclose(rank_histogram(target[:, 0], value[:, 0], half[:, 0]), 0.1, atol=0.02)


@pytest.mark.parametrize("width", [0.5, 2.0])
def test_diagnostics_show_what_is_wrong(width: float) -> None:
    target, value, half = drawn(2, 4000, width)
    at_ends = rank_histogram(target[:, 0], value[:, 0], half[:, 0])[0]
    assert (at_ends > 0.15) == (width < 1)
    assert (expected_coverage(target[:, 0], value[:, 0], half[:, 0])[1] < 0.4) == (width < 1)
    shifted = random_point_coverage(target, value + 2 * half, half)
    assert abs(shifted[1] - 0.5) > 0.03 or abs(shifted[3] - 0.9) > 0.03


def judged(folder: Path, width: float, presses: int, frames: int = 1, flag: str = "") -> tuple[int, dict]:
    """Exit status and scores of a table with intervals so many times too wide, of presses of several frames."""
    target, value, half = drawn(3, presses, width)
    rows = np.repeat(np.arange(presses), frames)
    named = [f"p{row}" for row in rows]
    table = pd.DataFrame({"touch": named, "x0_mm": value[rows, 0], "y0_mm": value[rows, 1], "flag": flag})
    for column, axis in (("x0", 0), ("y0", 1)):
        table[f"{column}_lo90_mm"] = value[rows, axis] - half[rows, axis]
        table[f"{column}_hi90_mm"] = value[rows, axis] + half[rows, axis]
    table.to_csv(folder / "predictions.csv", index=False)
    pd.DataFrame({"touch": [one for name in named for one in ("", name)], "v_000": 0.0, "v_001": 1.0}).to_csv(
        folder / "frames.csv", index=False)
    pd.DataFrame({"touch": [f"p{row}" for row in range(presses)], "x_mm": target[:, 0], "y_mm": target[:, 1]}).to_csv(
        folder / "touches.csv", index=False)
    words = words_of(folder)
    done, described = CliRunner().invoke(app, words), CliRunner().invoke(app, [*words, "--json"])
    assert done.exit_code == described.exit_code, done.output
    assert len(done.output.splitlines()) < 20
    assert "verdict: " in done.output
    return done.exit_code, json.loads(described.stdout)


def test_right_intervals_pass_and_narrow_ones_end_with_status_3(tmp_path: Path) -> None:
    status, scores = judged(tmp_path, 1.0, 200)
    assert (status, scores["verdict"]["holds"], scores["verdict"]["presses"]) == (0, True, 200)
    assert scores["verdict"]["distance_mm"] == pytest.approx(2.6, abs=0.4)
    status, scores = judged(tmp_path, 0.6, 200)
    assert (status, scores["verdict"]["outputs"]["x0"]["holds"]) == (3, False)


def test_presses_count_and_not_their_frames(tmp_path: Path) -> None:
    status, scores = judged(tmp_path, 0.75, 12, 40)
    assert status == 0  # what 12 presses show may be chance, however many frames they have
    assert (scores["verdict"]["presses"], scores["verdict"]["frames"]) == (12, 480)


def test_flagged_frames_are_counted_and_not_judged(tmp_path: Path) -> None:
    status, scores = judged(tmp_path, 1.0, 50, flag="odd")
    assert (status, scores["verdict"]) == (3, None)
    held = 100 * scores["outputs"]["x0"]["all"]["coverage_90"]
    said = CliRunner().invoke(app, words_of(tmp_path)).output
    assert f"50 of 50 frames are flagged, the first: odd); their 90 % intervals hold x0 {held:.0f} %" in said


def test_intervals_on_one_side_of_the_value_hold_half(tmp_path: Path) -> None:
    judged(tmp_path, 1.0, 200)
    table = pd.read_csv(tmp_path / "predictions.csv")
    table["x0_hi90_mm"] += table["x0_mm"] - table["x0_lo90_mm"]
    table["x0_lo90_mm"] = table["x0_mm"]
    table.to_csv(tmp_path / "predictions.csv", index=False)
    done = CliRunner().invoke(app, [*words_of(tmp_path), "--json"])
    one = json.loads(done.stdout)["verdict"]["outputs"]["x0"]
    assert (done.exit_code, one["holds"]) == (3, False)
    assert one["coverage_90"] == pytest.approx(0.5, abs=0.1)


def words_of(folder: Path) -> list[str]:
    return ["audit", str(folder / "predictions.csv"), str(folder / "frames.csv"), "--labels",
            str(folder / "touches.csv")]


def test_tables_without_intervals_are_refused(tmp_path: Path) -> None:
    judged(tmp_path, 1.0, 20)
    table, words = pd.read_csv(tmp_path / "predictions.csv"), words_of(tmp_path)
    for lacking, words_of_it in ((table.drop(columns="x0_lo90_mm"), "no x0_lo90_mm"), (table[:-1], "lack a row of"),
                                 (table.drop(columns="touch"), "no column touch"), (table[:0], "holds no predictions"),
                                 (table.assign(x0_lo90_mm=table["x0_hi90_mm"], x0_hi90_mm=table["x0_lo90_mm"]),
                                  "p0 and no interval from x0_lo90_mm up to x0_hi90_mm"),
                                 (table.assign(y0_hi90_mm=np.nan), "p0 and no interval from y0_lo90_mm"),
                                 (table.assign(x0_mm="far"), "'far' as x0_mm of touch p0")):
        lacking.to_csv(tmp_path / "predictions.csv", index=False)
        assert words_of_it in str(CliRunner().invoke(app, words).exception)
