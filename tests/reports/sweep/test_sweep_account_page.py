"""The first page of a sweep's report: cost by stage, errors against requested ones, the last run, what was left out."""

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.dataset.sweep_record import RUNS, Run
from eitsim.sweeps.run.omissions import LEFT_OUT, Omission
from reports.document.numerals import percent
from reports.document.verdict import NOT_USABLE
from reports.sweep import sweep_report
from reports.sweep.sweep_report import report


def with_account(folder: Path) -> Path:
    """A synthetic set with the columns, a run and omissions as sweeps write them."""
    for part in parquet.parts(folder):
        table = pd.read_parquet(part)
        shares = {"mechanics_cpu_s": 0.5, "electrics_cpu_s": 0.25, "fields_cpu_s": 0.125}
        how = {"mechanics_method": np.where(table["scene"] < 15, "table", "solved"), "electrics_method": "multipole"}
        costs = {name: share * table["cpu_s"] for name, share in shares.items()}
        parquet.write_table(part, table.assign(**costs, **how))
    run = Run("touches from a table", 20, 16.0, 10.0, 2, 5.0, 0.5, 0.1, 0.2, paths=5, paths_cpu_s=90.0)
    left = [Omission("the skin is a sheet", "thin", 0.0016, False, 20, 20),
            Omission("no friction", "none", 0.0, True, 9, 20)]
    parquet.write_manifest(folder, {**parquet.read_manifest(folder), RUNS: [asdict(run)],
                                    LEFT_OUT: [asdict(one) for one in left]})
    return folder


def test_stages_part_the_cost(write_set: Callable[..., Path]) -> None:
    made = report(with_account(write_set(20)))
    rows = {name: (int(count), float(cpu)) for name, count, cpu, _ in made.tables["stages"].rows}
    assert rows["table: load paths"] == (5, 90.0)
    assert (rows["touches: table"][0], rows["touches: solved"][0]) == (15, 5)
    touches = rows["touches: table"][1] + rows["touches: solved"][1]
    assert np.isclose(touches, 2 * rows["readings: multipole"][1], rtol=0.01)
    assert np.isclose(rows["fields on the skin"][1], rows["planning and the rest of rows"][1], rtol=0.01)


def test_the_verdict_tells_the_share_of_the_signal_that_is_extrapolated(write_set: Callable[..., Path]) -> None:
    folder = write_set(20)
    lines = {line.what: (line.grade, line.why) for line in report(folder).verdict}
    shares = parquet.read_dataset(folder).table["signal_share_extrapolated"].to_numpy(dtype=float)
    assert lines["Signals of a real skin"] == (NOT_USABLE, (
        f"{percent(np.median(shares))} of the signal comes from extrapolated conductivity in the median scene, at most "
        f"{percent(shares.max())}"))
    for part in parquet.parts(folder):  # as earlier versions wrote them
        parquet.write_table(part, pd.read_parquet(part).drop(columns="signal_share_extrapolated"))
    lines = {line.what: (line.grade, line.why) for line in report(folder).verdict}
    assert lines["Signals of a real skin"][0] == NOT_USABLE
    assert "not in the rows" in lines["Signals of a real skin"][1]


def test_older_sets_have_their_whole_cost_in_one_stage(write_set: Callable[..., Path]) -> None:
    made = report(write_set(8))
    assert [row[:2] for row in made.tables["stages"].rows] == [["planning and the rest of rows", "8"]]


def test_rows_of_other_code_are_marked(write_set: Callable[..., Path], tmp_path: Path,
                                       read_pdf: Callable[[Path], Any]) -> None:
    folder = write_set(8)
    assert not report(folder).cautions
    parquet.write_manifest(folder, {**parquet.read_manifest(folder), "code": "0" * 64})
    sweep_report.write(folder, tmp_path / "s.pdf")
    text = read_pdf(tmp_path / "s.pdf").whole
    assert "Stale: other code or libraries than are here solved its rows." in text
