"""What a user may give as tests: words and paths of files, or arrays and tables in SI, as (kind, sources) a test."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from matcal.readers.columns import check_clock
from matcal.readers.recording import QUANTITIES, Recording

# kind of a test (None: its files say it), and the files or recordings that belong to it
Input = tuple[str | None, tuple[Path | Recording, ...]]

# name of a column with its SI unit -> quantity
COLUMNS = {f"{quantity}_{unit.replace('/', '_per_')}" if unit else quantity: quantity
           for quantity, unit in QUANTITIES.items()}
# kind -> quantities of a pair of arrays, where they are not strain and stress; time may follow
_PAIRS = {"volumetric": ("volume_ratio", "stress"), "conductivity": ("strain", "conductivity")}


def inputs_of(given: str | Path | Mapping[str, Any]) -> list[Input]:
    """The tests that one entry stands for: `[KIND=]FILE[,FILE]`, a path, or a mapping kind -> one of these: a file, the
    files of one test, arrays (strain, value[, time_s]), a mapping or data frame of COLUMNS; ValueError for another."""
    if isinstance(given, Path):
        return [(None, (given,))]
    if isinstance(given, str):
        return [files_named(given)]
    if not isinstance(given, Mapping):
        raise ValueError(f"a test is given as {type(given).__name__}; expected a path, '[KIND=]FILE[,FILE]', an "
                         "Experiment or a mapping such as {'uniaxial': (strain, stress_Pa)}.")
    return [(kind, _sources(kind, value)) for kind, value in given.items()]


def files_named(text: str) -> tuple[str | None, tuple[Path, ...]]:
    """(kind or None, files) of `[KIND=]FILE[,FILE]`; a file of that very name goes first."""
    kind, _, rest = text.rpartition("=") if "=" in text and not Path(text).exists() else ("", "", text)
    return kind or None, tuple(Path(part) for part in (rest.split(",") if not Path(rest).exists() else [rest]))


def _sources(kind: str, value: Any) -> tuple[Path | Recording, ...]:
    if isinstance(value, str | Path):
        return (Path(value),)
    if hasattr(value, "keys"):
        return (_recording(kind, {str(name): value[name] for name in value.keys()}),)  # noqa: SIM118 (a data frame)
    if all(isinstance(part, str | Path) for part in value):
        return tuple(Path(part) for part in value)
    names = (*_PAIRS.get(kind, ("strain", "stress")), "time")
    if not 2 <= len(value) <= len(names):
        raise ValueError(f"{kind}: {len(value)} arrays; expected ({', '.join(names)}), time being optional, in SI.")
    known = {quantity: name for name, quantity in COLUMNS.items()}
    return (_recording(kind, {known[name]: column for name, column in zip(names, value, strict=False)}),)


def _recording(kind: str, columns: Mapping[str, Sequence[float]]) -> Recording:
    """Columns of COLUMNS as a recording without a file; ValueError for an unknown column or a value that is no finite
    number."""
    if unknown := [name for name in columns if name not in COLUMNS]:
        raise ValueError(f"{kind}: column '{unknown[0]}' is unknown; known, in SI: {', '.join(COLUMNS)}.")
    values = {COLUMNS[name]: np.array(column, dtype=float) for name, column in columns.items()}
    for name, column in zip(columns, values.values(), strict=True):
        if column.ndim != 1 or not np.all(np.isfinite(column)):
            raise ValueError(f"{kind}: column '{name}' must be one row of finite numbers, got shape {column.shape}"
                             f"{'' if np.all(np.isfinite(column)) else ' with a value that is none'}.")
    units = {quantity: QUANTITIES[quantity] for quantity in values}
    return check_clock(Recording((Path(f"{kind} arrays"),), "arrays", values, dict(zip(values, columns, strict=True)),
                                 units, None))
