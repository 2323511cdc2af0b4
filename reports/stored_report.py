"""What the reports of the benchmarks' stored tables share: how one is written, and under what conditions it ran."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from reports import staleness
from reports.benches import conditions
from reports.numerals import counted
from reports.page import Report, Table, write_pdf
from reports.staleness import State
from reports.style import house


def write(report: Callable[[Path], Report], results: Path, out: Path) -> None:
    """Write the PDF of the tables in a folder, `out`; what is not there is said on the page.

    ValueError where a folder is missing; TestFileError where a table lacks a column.
    """
    if not results.is_dir():
        raise ValueError(f"{results}: no such folder of results. Run `make bench`, or name the folder with --results.")
    with house():
        write_pdf(report(results), out)


def condition_table(read: Sequence[tuple[str, pd.DataFrame, State]]) -> Table:
    """Under what conditions stored tables (file, rows, state) were measured, and whether they are current."""
    rows = [[file, *conditions(table), state.words] for file, table, state in read]
    current = sum(state.kind == staleness.CURRENT for _, _, state in read)
    return Table(f"Under what conditions they ran, and whether by the code that is here: {current} of "
                 f"{counted(len(rows), 'file')} did.",
                 ["file", "machine", "threads", "versions", "date", "state"], rows, "lllwlw")
