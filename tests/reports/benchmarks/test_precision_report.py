import hashlib
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from benchmarks.report.catalogue import BENCHES, Bench, cheapest, points
from benchmarks.report.precision import report
from benchmarks.report.precision_figures import seconds
from benchmarks.report.stored_tables import write
from reports.__main__ import app
from reports.document.verdict import GOOD, NOT_USABLE, USABLE
from touchcal.code_version import ROOT, script_hash
from touchcal.errors import InputFileError
from touchcal.terminal import run

Reader = Callable[[Path], Any]

# touch, method, setting, dv_error, cpu_ms, kept_ms: at 1e-3 "slow" is cheapest at once and "kept" the next time
ELECTRICS = [("near", "quick", "coarse", 2e-2, 1.5, 0.0), ("near", "slow", "fine", 4e-4, 8.0, 0.0),
             ("near", "kept", "fine", 5e-4, 2.25, 7.0), ("far", "slow", "fine", 5e-5, 9.0, 0.0),
             ("once", "set-up", "", None, 40.0, None)]
SIZES = [(100, 60, "eitsim", 0.01), (100, 60, "a peer", 0.05), (1000, 600, "eitsim", 0.125), (1000, 600, "a peer", 2.5)]


def write_electrics(folder: Path) -> None:
    table = pd.DataFrame(ELECTRICS, columns=["touch", "method", "setting", "dv_error", "cpu_ms", "kept_ms"])
    table.assign(machine="a machine", threads=1, versions="numpy 2", date="2026-01-01").to_csv(
        folder / "electrics.csv", index=False)


def write_all(folder: Path) -> None:
    write_electrics(folder)
    pd.DataFrame(SIZES, columns=["triangles", "unknowns", "method", "cpu_s"]).to_csv(
        folder / "peers_electrics.csv", index=False)
    pd.DataFrame({"touch": "flat", "element_um": [240, 60], "depth_error": [0.05, 0.02], "cpu_s": [0.1, 0.4]}).to_csv(
        folder / "mechanics.csv", index=False)
    pd.DataFrame({"touch": "flat", "method": ["ours, from rest", "A peer", "A peer"], "element_um": [120, 120, 60],
                  "setting": ["order 2", "QUAD, soft contact, elastic far field", "QUAD, hard contact"],
                  "depth_error": [7e-4, 2e-2, None], "cpu_s": [0.15, 12.0, 30.0]}).to_csv(
        folder / "peers_mechanics.csv", index=False)


    pd.DataFrame({"method": ["variable projection", "lmfit leastsq"], "cpu_s": [0.02, 0.08],
                  "setting": ["1 starts, tolerance 0.01", "from Table 1, tolerance 0.0001"],
                  "distance_from_best": [1e-4, 0.05]}).to_csv(folder / "calibration.csv", index=False)
    pd.DataFrame({"method": ["matcal, moduli marginalised", "emcee, raw parameters", "lmfit emcee, raw parameters"],
                  "ess_worst": 400.0, "rhat_worst": 1.2, "mean_error_over_sd": [0.05, 0.06, 0.07],
                  "cpu_s": [5.0, 6.0, 7.0]}).to_csv(folder / "sampler.csv", index=False)
    pd.DataFrame({"touch": "inside", "method": ["eitsim", "a peer"], "setting": "300 triangles",
                  "dv_error": [0.02, 0.03], "cpu_s": [0.01, 0.2]}).to_csv(folder / "peers_signal.csv", index=False)
    pd.DataFrame({"scene": ["far, 1 N"], "method": ["as planned"], "wanted": [0.01], "dv_error": [5e-3],
                  "cpu_s": [0.3]}).to_csv(folder / "scenes.csv", index=False)
    pd.DataFrame({"place": ["far"], "way": ["from the tables"], "rows": [40], "dv_error": [3e-4], "cpu_s": [0.02],
                  "tables_cpu_s_per_row": [0.3]}).to_csv(folder / "sweeps_ways.csv", index=False)
    pd.DataFrame({"method": "ridge", "output": ["x0", "A_c"], "steps": None, "r2": [0.99, 0.5], "fit_cpu_s": 2.0}
                 ).to_csv(folder / "surrogates_time.csv", index=False)


def named(name: str) -> Bench:
    return next(bench for bench in BENCHES if bench.name == name)


@pytest.mark.slow
def test_the_report_holds_the_numbers_of_the_tables(tmp_path: Path, read_pdf: Reader) -> None:
    write_all(tmp_path)
    write(report, tmp_path, tmp_path / "p.pdf")
    text = read_pdf(tmp_path / "p.pdf").whole
    for unit in ("CPU time (s)", "Relative error of", "V (–)", "Unknowns (–)", "Relative error of the depth (–)"):
        assert unit in text
    for words in ("10 of 10 benchmarks", "the cheapest is “slow” in 2 of 2 problems (8.00 to 9.00 ms)",
                  "with the set-up already done, “kept” in 1 of 2 problems (2.25 ms), “slow” in 1 of 2 problems",
                  "1 of 5 rows of the file hold no error",
                  "with 600 unknowns, eitsim 125 ms, a peer 2.50 s (20.0 times)",
                  "no method comes within 0.1 %; the least error, 2.0 %, is that of “eitsim” in 400 ms",
                  "the cheapest is “eitsim, from rest, order 2” (150 ms)", "1 of 3 rows of the file",
                  "0.01 % is reached in 2 of 8 problems", "3 % is reached in 0 of 1 problem",
                  "400 effective draws, R-hat 1.20: 5.00 s",
                  "asked for 0.01 of the signal: 300 ms", "from the tables, 40 rows: 320 ms, 300 ms of it set-up",
                  "RMSE over spread", "variable projection, 1 starts, tolerance 0.01: 20.0 ms", "A peer, QUAD"):
        assert words in text, words
    for bench in BENCHES:
        assert hashlib.sha256((tmp_path / bench.file).read_bytes()).hexdigest() in text
    assert "0 of 10 files did" in text
    assert "not recorded" in text
    assert "Before you use these numbers" in text
    assert "electrics.csv is unknown: its rows do not tell their code" in text


@pytest.mark.slow
def test_the_verdict_tells_errors_costs_peers_and_the_code(tmp_path: Path, read_pdf: Reader) -> None:
    write_all(tmp_path)
    verdict = {line.what: (line.grade, line.why) for line in report(tmp_path).verdict}
    assert verdict["Readings of a touch"] == (
        GOOD, "error within 0.1 % in 2 of 2 problems, in 8.00 to 9.00\u00a0ms of CPU")
    assert verdict["Depth of a touch"] == (NOT_USABLE, "error within 0.1 % in 0 of 1 problem; 2.0 % in the worst")
    assert verdict["Rows of a sweep"][0] == GOOD
    assert verdict["Whole scenes"] == (USABLE, "error within 0.1 % in 0 of 1 problem; 0.50 % in the worst")
    assert verdict["Speed next to other programs"] == (GOOD, "eitsim is 20 times as fast as a peer, on the same mesh")
    assert verdict["These times, with the code that is here"] == (USABLE, "0 of 10 tables measured by it")
    write(report, tmp_path, tmp_path / "p.pdf")
    first = read_pdf(tmp_path / "p.pdf").pages[0]
    assert first.index("Readings of a touch") < first.index("Before you use these numbers")


@pytest.mark.parametrize(("own", "grade"), [(2.4, GOOD), (4.9, USABLE), (5.1, NOT_USABLE)])
def test_a_slower_program_is_not_called_fast(tmp_path: Path, own: float, grade: str) -> None:
    pd.DataFrame([(1000, 600, "eitsim", own), (1000, 600, "a peer", 2.5)],
                 columns=["triangles", "unknowns", "method", "cpu_s"]).to_csv(tmp_path / "peers_electrics.csv")
    assert report(tmp_path).verdict[0].grade == grade


@pytest.mark.parametrize(("changed", "words"), [
    ({}, None), ({"code": "0" * 12}, "Stale, measured by other code or other versions than are here: electrics.csv."),
    ({"versions": "numpy 1.0"}, "Stale, measured by other code or other versions than are here: electrics.csv.")])
def test_stale_tables_are_marked_and_current_ones_are_not(tmp_path: Path, changed: dict[str, str],
                                                          words: str | None) -> None:
    write_electrics(tmp_path)
    table, code = pd.read_csv(tmp_path / "electrics.csv"), script_hash(ROOT / "benchmarks" / "electrics.py")
    table.assign(**{"code": code, "versions": f"numpy {version('numpy')}"} | changed).to_csv(
        tmp_path / "electrics.csv", index=False)
    made = report(tmp_path)
    assert list(made.cautions) == ([] if words is None else [words])
    (plate,) = made.plates
    assert ("electrics.csv is stale" in plate.caption) == (words is not None)
    assert made.tables["conditions"].rows[0][-1].startswith("current" if words is None else "stale")


def test_the_table_of_the_cheapest_counts_what_is_done_once(tmp_path: Path, read_pdf: Reader) -> None:
    write_electrics(tmp_path)
    write(report, tmp_path, tmp_path / "p.pdf")
    text = read_pdf(tmp_path / "p.pdf").whole
    assert "within 1 % within 0.1 % within 0.01 %" in text
    assert "208 readings of one touch: near slow, fine: 8.00 ms slow, fine: 8.00 ms none" in text
    assert "208 readings of one touch: far slow, fine: 9.00 ms slow, fine: 9.00 ms slow, fine: 9.00 ms" in text
    near = [p for p in points(named("electrics"), tmp_path)[0] if p.problem == "near"]
    once, again, loose = (cheapest(near, 1e-3), cheapest(near, 1e-3, again=True), cheapest(near, 0.1))
    assert once is not None
    assert once.method == "slow"
    assert again is not None
    assert again.method == "kept"
    assert loose is not None
    assert loose.method == "quick"
    assert cheapest(near, 1e-5) is None


def test_methods_are_named_as_a_stranger_reads_them_and_a_cost_stands_above_a_size(tmp_path: Path) -> None:
    table = pd.DataFrame({"touch": "near", "method": ["P2 that follows, condensed", "rings that scatter"],
                          "setting": "", "dv_error": 1e-4, "cpu_ms": 2.0, "kept_ms": 0.0})
    table.to_csv(tmp_path / "electrics.csv", index=False)
    pd.DataFrame(SIZES, columns=["triangles", "unknowns", "method", "cpu_s"]).to_csv(tmp_path / "peers_electrics.csv")
    errors, sizes = report(tmp_path).plates
    assert set(errors.data["electrics"]["method"]) == {"P2, mesh follows the touch, condensed", "scattering by rings"}
    assert "that scatter" not in errors.caption
    (axes,) = sizes.figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Unknowns (–)", "CPU time (s)")


def test_what_was_not_run_is_said(tmp_path: Path, read_pdf: Reader) -> None:
    write_electrics(tmp_path)
    write(report, tmp_path, tmp_path / "p.pdf")
    text = read_pdf(tmp_path / "p.pdf").whole
    for bench in BENCHES:
        said = f"Not there: {bench.file}. Run benchmarks/{bench.benchmark}.py" in text.replace("- ", "-")
        assert said == (bench.name != "electrics")
    assert sorted(p.name for p in (tmp_path / "p_files").glob("*.svg")) == ["electrics.svg"]


def test_without_any_benchmark_nothing_is_drawn(tmp_path: Path, read_pdf: Reader) -> None:
    write(report, tmp_path, tmp_path / "p.pdf")
    assert "Any statement on error or run time not usable no benchmark has been run" in read_pdf(
        tmp_path / "p.pdf").whole
    assert not list((tmp_path / "p_files").glob("*.svg"))


def test_a_table_without_a_number_is_said(tmp_path: Path, read_pdf: Reader) -> None:
    (tmp_path / "mechanics.csv").write_text("touch,element_um,depth_error,cpu_s\nflat,240,,0.1\n")
    write(report, tmp_path, tmp_path / "p.pdf")
    assert "no row of mechanics.csv (1 row) holds a number" in read_pdf(tmp_path / "p.pdf").whole


def test_the_points_drawn_lie_beside_the_page(tmp_path: Path) -> None:
    write_electrics(tmp_path)
    write(report, tmp_path, tmp_path / "p.pdf")
    drawn = pd.read_csv(tmp_path / "p_files" / "electrics.csv")
    assert drawn["dv_error"].tolist() == [row[3] for row in ELECTRICS[:-1]]
    assert drawn["cost_s"].tolist() == pytest.approx([row[4] / 1e3 for row in ELECTRICS[:-1]])
    assert drawn["once_s"].tolist() == pytest.approx([0, 0, 7e-3, 0])


def test_errors_name_file_column_and_folder(tmp_path: Path) -> None:
    (tmp_path / "mechanics.csv").write_text("touch,element_um,cpu_s\nflat,240,0.1\n")
    with pytest.raises(InputFileError, match=r"mechanics\.csv.*'depth_error'.*benchmarks/mechanics\.py"):
        write(report, tmp_path, tmp_path / "p.pdf")
    with pytest.raises(ValueError, match=r"An installed package holds none: .*source folder.*--results"):
        write(report, tmp_path / "nowhere", tmp_path / "p.pdf")


@pytest.mark.parametrize(("values", "text"), [((0.0123,), "12.3 ms"), ((0.002, 1.5), "0.00200 to 1.50 s"),
                                              ((2.0, 2.0), "2.00 s")])
def test_times_get_the_unit_of_the_largest(values: tuple[float, ...], text: str) -> None:
    assert seconds(*values).replace("\u00a0", " ") == text


@pytest.mark.slow
def test_the_command_writes_into_a_folder(tmp_path: Path) -> None:
    write_electrics(tmp_path)
    command = [sys.executable, "-m", "reports", "precision", "--results", str(tmp_path), "--out"]
    done = subprocess.run([*command, str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "precision.pdf").is_file()


def test_a_file_that_is_no_pdf_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.argv", ["", "precision", "--results", str(tmp_path), "--out", str(tmp_path / "p.txt")])
    with pytest.raises(SystemExit) as end:
        run(app, "python -m reports")
    assert end.value.code == 2
    assert "ends in .pdf" in capsys.readouterr().err


def test_every_bench_reads_the_columns_of_its_stored_table() -> None:
    folder = Path(__file__).parents[3] / "benchmarks" / "results"
    stored = [bench for bench in BENCHES if (folder / bench.file).is_file()]
    assert len(stored) >= 6
    for bench in stored:
        found, rows = points(bench, folder)
        assert 0 < len(found) <= rows
