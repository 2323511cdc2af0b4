"""What the reports of stored tables share: rows, the conditions they ran under, whether by the code that is here."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pandas as pd

from reports.document.numerals import counted
from reports.document.page import Report, Table, write_pdf
from reports.document.style import house
from reports.document.verdict import GOOD, USABLE, Verdict
from touchcal.code_version import ROOT, script_hash

Rows = Sequence[Mapping[str, Any]]  # each maps a column to a number or to words
CURRENT, UNKNOWN, STALE = "current", "unknown", "stale"
CODE, VERSIONS = "code", "versions"


def write(report: Callable[[Path], Report], results: Path, out: Path) -> None:
    """Write the PDF of the tables in a folder, `out`; what is not there is said on the page. ValueError where a folder
    is missing; InputFileError where a table lacks a column."""
    if not results.is_dir():
        raise ValueError(f"{results}: no such folder of results. An installed package holds none: the tables are in "
                         "benchmarks/results of the source folder. Run this there, or name that folder with --results.")
    with house():
        write_pdf(report(results), out)


@dataclass(frozen=True)
class State:
    """How a table stands to the code that is here."""

    file: str  # the table's file
    kind: str  # one of CURRENT, UNKNOWN and STALE
    words: str  # kind and cause, for a cell or the end of a caption


def state(table: pd.DataFrame, file: str, benchmark: str, folder: Path = ROOT / "benchmarks") -> State:
    """How the rows of `file`, which benchmarks/`benchmark`.py in `folder` writes, stand to that code and its libraries.
    Stale where a row was measured by other code or other versions; unknown where a row does not tell its code."""
    path = folder / f"{benchmark}.py"
    if not path.is_file():
        return State(file, UNKNOWN, f"unknown: {path.name} is not here")
    codes = _column(table, CODE)
    old = codes.notna() & (codes != script_hash(path, folder.parent))
    if changed := _changed({str(words) for words in _column(table, VERSIONS).dropna()}):
        return State(file, STALE, f"stale: measured with {', '.join(changed)}")
    if old.any():
        rows = "the rows are" if old.all() else f"{old.sum()} of {counted(len(table), 'row')} are"
        return State(file, STALE, f"stale: {rows} of other code")
    if codes.isna().any():
        return State(file, UNKNOWN, "unknown: its rows do not tell their code")
    return State(file, CURRENT, CURRENT)


def cautions(states: Sequence[State]) -> list[str]:
    """What a reader must know of tables that are not current, one sentence a kind."""
    said = {STALE: "Stale, measured by other code or other versions than are here",
            UNKNOWN: "Not known to be current, since their rows do not tell what code they measured"}
    return [f"{words}: {', '.join(found)}." for kind, words in said.items()
            if (found := [one.file for one in states if one.kind == kind])]


def present_code(what: str, states: Sequence[State]) -> list[Verdict]:
    """The line of the verdict that says how many tables the code that is here measured; none without tables."""
    current = sum(one.kind == CURRENT for one in states)
    grade = GOOD if current == len(states) else USABLE
    return [Verdict(what, grade, f"{current} of {counted(len(states), 'table')} measured by it")] if states else []


def _column(table: pd.DataFrame, name: str) -> pd.Series:
    return pd.Series(table.get(name, None), index=table.index, dtype=object)


def _changed(recorded: Iterable[str]) -> list[str]:
    """Names and versions, as "numpy 2.4.6", that are not those installed."""
    found = []
    for words in sorted(recorded):
        parts = words.replace(",", " ").split()
        found += [f"{name} {used}" for name, used in zip(parts[::2], parts[1::2], strict=False)
                  if _installed(name) not in (used, None)]
    return list(dict.fromkeys(found))


def _installed(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def condition_table(read: Sequence[tuple[str, pd.DataFrame, State]]) -> Table:
    """Under what conditions stored tables (file, rows, state) were measured, and whether they are current."""
    rows = [[file, *conditions(table), state.words] for file, table, state in read]
    current = sum(state.kind == CURRENT for _, _, state in read)
    return Table(f"Under what conditions they ran, and whether by the code that is here: {current} of "
                 f"{counted(len(rows), 'file')} did.",
                 ["file", "machine", "threads", "versions", "date", "state"], rows, "lllwlw")


def conditions(table: pd.DataFrame) -> list[str]:
    """Machine, threads, versions and date that the rows of a table carry, "not recorded" where none does."""
    names = ("machine", "threads", "versions", "date")
    columns = (table[name].dropna().astype(str) if name in table else [] for name in names)
    return [", ".join(sorted(set(found))) or "not recorded" for found in columns]


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
    """The rows as a table, to be written next to a page."""
    return pd.DataFrame([dict(row) for row in rows])
