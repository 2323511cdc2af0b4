"""Whether stored results are those of this code and these libraries."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pandas as pd

from reports.document.numerals import counted
from touchcal.code_version import ROOT, script_hash

CURRENT, UNKNOWN, STALE = "current", "unknown", "stale"
CODE, VERSIONS = "code", "versions"


@dataclass(frozen=True)
class State:
    """How a table stands to the code that is here."""

    # the table's file
    file: str
    # one of CURRENT, UNKNOWN and STALE
    kind: str
    # kind and cause, for a cell or the end of a caption
    words: str


def state(table: pd.DataFrame, file: str, benchmark: str, folder: Path = ROOT / "benchmarks") -> State:
    """How the rows of `file`, which benchmarks/`benchmark`.py in `folder` writes, stand to that code and its libraries.

    Stale where a row was measured by other code or other versions; unknown where a row does not tell its code.
    """
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


def _column(table: pd.DataFrame, name: str) -> pd.Series:
    return pd.Series(table.get(name, None), index=table.index, dtype=object)


def _changed(recorded: Iterable[str]) -> list[str]:
    """Names and versions, as "numpy 2.4.6", that are not those installed."""
    found = []
    for words in sorted(recorded):
        parts = words.replace(",", " ").split()
        found += [f"{name} {told}" for name, told in zip(parts[::2], parts[1::2], strict=False)
                  if _installed(name) not in (told, None)]
    return list(dict.fromkeys(found))


def _installed(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
