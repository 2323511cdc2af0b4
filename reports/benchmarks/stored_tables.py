"""What the reports of the benchmarks' stored tables share: how one is written, and under what conditions it ran."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from reports.benchmarks import staleness
from reports.benchmarks.catalogue import conditions
from reports.benchmarks.staleness import State
from reports.document.numerals import counted
from reports.document.page import Report, Table, write_pdf
from reports.document.style import house

# each maps a column to a number or to words
Rows = Sequence[Mapping[str, Any]]


def write(report: Callable[[Path], Report], results: Path, out: Path) -> None:
    """Write the PDF of the tables in a folder, `out`; what is not there is said on the page.

    ValueError where a folder is missing; InputFileError where a table lacks a column.
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


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Rows of a CSV; empty cells are NaN."""
    return [{str(name): value for name, value in row.items()} for row in pd.read_csv(path).to_dict("records")]


def distinct(rows: Rows, column: str) -> list[Any]:
    """Values of a column, each once, in the order of the rows; KeyError where it is missing."""
    return list(dict.fromkeys(row[column] for row in rows))


def where(rows: Rows, **values: Any) -> list[Mapping[str, Any]]:
    """Rows whose columns have these values; KeyError where one is missing."""
    return [row for row in rows if all(row[name] == value for name, value in values.items())]


def frame(rows: Rows) -> pd.DataFrame:
    """The rows as a table, to be written beside a page."""
    return pd.DataFrame([dict(row) for row in rows])
