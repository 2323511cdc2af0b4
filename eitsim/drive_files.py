"""Matrices of currents and measurements that a scene or design file names as CSV files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.number_table import read_numbers
from matcal.errors import TestFileError

MATRICES = ("currents", "measurements")


def with_matrices(raw: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a scene or design file, CSV files named by MATRICES in [drive] replaced by the rows they hold, so
    that the tables need no other file from here on. Names are relative to `folder`; TestFileError names the file."""
    drive = raw.get("drive")
    if not isinstance(drive, Mapping):
        return dict(raw)
    read = {key: matrix_rows(folder / value) if key in MATRICES and isinstance(value, str) else value
            for key, value in drive.items()}
    return {**raw, "drive": read}


def matrix_rows(path: Path) -> list[Any]:
    """Rows of numbers, one column an electrode; where the first column is named "pattern", a list of rows for each
    pattern, numbered from 0."""
    table = read_numbers(path)
    if not table.names or table.names[0].lower() != "pattern":
        return table.values.tolist()
    pattern, rows = table.values[:, 0], table.values[:, 1:]
    count = int(pattern.max()) + 1
    if missing := sorted(set(range(count)) - set(pattern.tolist())):
        raise TestFileError(path, f"pattern {missing[0]} has no rows; number the patterns from 0 without gaps.")
    odd = np.flatnonzero(~np.isin(pattern, np.arange(count)))
    if odd.size:
        raise TestFileError(path, f"the pattern {pattern[odd[0]]:g} is no whole number from 0.",
                            line=int(table.line[odd[0]]))
    return [rows[pattern == k].tolist() for k in range(count)]
