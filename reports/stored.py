"""Rows of a stored table, and what is asked of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

# each maps a column to a number or to words
Rows = Sequence[Mapping[str, Any]]


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
