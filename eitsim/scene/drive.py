"""Current patterns and readings; both are linear in the impedance matrix of the electrodes."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from touchcal.arrays import Array, Mask
from touchcal.csv_numbers import read_numbers
from touchcal.errors import InputFileError

Rows = tuple[tuple[float, ...], ...]

PATTERNS = ("adjacent", "opposite", "skip-N")
READINGS = ("single-ended", "differential")
# What the currents of a pattern may leave over, of the largest: the rounding of written numbers.
_LEFT_OVER = 1e-9
MATRICES = ("currents", "measurements")
MOST_WEIGHT = 1e9  # largest entry of one of them, in size


@dataclass(frozen=True)
class Drive:
    """Which currents are driven and what is read."""

    current_A: float = 5e-3  # injected current, A; the unit of `currents`
    pattern: str = "adjacent"  # "adjacent", "opposite" or "skip-N"
    reading: str = "single-ended"  # what is read of a named pattern, one of READINGS
    currents: Rows | None = None  # (patterns, electrodes) currents, in units of current_A; None: the named pattern
    # (readings, electrodes) weights of the voltages for all patterns, or (patterns, readings, electrodes); None: as
    # `reading` says
    measurements: Rows | tuple[Rows, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("currents", "measurements"):
            object.__setattr__(self, name, as_tuples(getattr(self, name)))


def as_tuples(value: Any) -> Any:
    """Lists and arrays as tuples, so that a scene can be a key; anything else as it is."""
    value = value.tolist() if isinstance(value, np.ndarray) else value
    return tuple(map(as_tuples, value)) if isinstance(value, list | tuple) else value


@dataclass(frozen=True, eq=False)
class Protocol:
    """A drive as matrices: reading m of pattern p is weights[p, m] . Z currents_A[p]."""

    currents_A: Array  # (patterns, electrodes) currents into the electrodes, A; each row sums to zero
    weights: Array  # (patterns, readings, electrodes) weights of the electrodes' voltages, whose mean is 0 V

    @property
    def shape(self) -> tuple[int, int]:
        """Patterns, and readings of each."""
        return self.weights.shape[0], self.weights.shape[1]


@lru_cache(maxsize=64)
def protocol(drive: Drive, count: int) -> Protocol:
    """The matrices of a drive for that many electrodes.

    Named pattern k drives +I into electrode k and -I out of k + step. "single-ended" reads the others
    counter-clockwise from k + 1 against electrode k - 1; adjacent: k + 2 ... k + 14 of 16 (paper, section 4.4).
    "differential" reads V_(j+1) - V_j of neighbours that carry no current, j counter-clockwise from k + 1: EIDORS's
    default signs, in the order of its rotate_meas.

    ValueError names the keys: an unknown name, an odd count with opposite electrodes, a sink on the source or the
    reference, matrices of another size, currents that do not sum to zero, a row of zeros.
    """
    if drive.currents is None:
        unit, weights = _named(drive, count)
    else:
        if (drive.pattern, drive.reading) != (Drive.pattern, Drive.reading):
            raise ValueError("pattern and reading in [drive] have no effect with currents; leave them out.")
        if drive.measurements is None:
            raise ValueError("currents in [drive] needs measurements: which weights of the voltages each reading has.")
        unit, weights = _matrix("currents", drive.currents, count), np.empty(0)
    if drive.measurements is not None:
        if drive.reading != Drive.reading:
            raise ValueError("reading in [drive] has no effect with measurements; leave it out.")
        weights = _weights(drive.measurements, len(unit), count)
    try:
        return matrices(drive.current_A * unit, weights)
    except ValueError as error:
        keys = "pattern and reading" if drive.currents is None and drive.measurements is None else (
            "currents and measurements")
        raise ValueError(f"{keys} in [drive]: {error}") from None


def matrices(currents_A: ArrayLike, weights: ArrayLike) -> Protocol:
    """A protocol of currents (patterns, electrodes), A, and weights (patterns, readings, electrodes); ValueError where
    currents do not sum to zero, or where a pattern or a reading is all zeros. Patterns and readings count from 0."""
    currents, weights = np.array(currents_A, dtype=float), np.array(weights, dtype=float)
    if not weights.shape[1]:
        raise ValueError("nothing is read: every electrode, or one of any two neighbours, carries current.")
    largest = np.abs(currents).max(axis=1)
    for k, (size, total) in enumerate(zip(largest, currents.sum(axis=1), strict=True)):
        if size == 0:
            raise ValueError(f"pattern {k} drives no current; leave it out.")
        if abs(total) > _LEFT_OVER * size:
            raise ValueError(f"the currents of pattern {k} sum to {total:g} A; what goes in must come out: make them "
                             "sum to zero.")
    silent = np.argwhere(~weights.any(axis=2))
    if len(silent):
        raise ValueError(f"reading {silent[0, 1]} of pattern {silent[0, 0]} has no weight but 0; leave it out.")
    currents -= currents.mean(axis=1, keepdims=True)
    currents.flags.writeable = weights.flags.writeable = False
    return Protocol(currents, weights)


def readings(asked: Protocol, impedance_Ohm: Array) -> Array:
    """Readings (..., patterns, readings), V, of impedance matrices (..., electrodes, electrodes), Ohm, or of changes of
    one; NaN where one needs an electrode whose rows and columns are NaN, since it has no contact."""
    diagonals = np.diagonal(impedance_Ohm, axis1=-2, axis2=-1).reshape(-1, impedance_Ohm.shape[-1])
    missing: Mask = np.isnan(diagonals).max(axis=0)
    known = np.where(missing | missing[:, None], 0.0, impedance_Ohm)
    out = np.einsum("pre,...pe->...pr", asked.weights, asked.currents_A @ known.swapaxes(-1, -2))
    out[..., asked.currents_A[:, missing].any(axis=1), :] = np.nan
    out[..., asked.weights[..., missing].any(axis=-1)] = np.nan
    return out


def read_out(drive: Drive, impedance_Ohm: Array) -> Array:
    """Readings (patterns, readings), V, of a drive from an impedance matrix (electrodes, electrodes), Ohm."""
    return readings(protocol(drive, len(impedance_Ohm)), impedance_Ohm)


def _named(drive: Drive, count: int) -> tuple[Array, Array]:
    """Currents (count, count) of 1 A and weights (count, readings, count) of a named pattern, as `protocol` says."""
    step, kind = _step(drive.pattern, count), drive.reading
    if kind == "single-ended":
        positive = [o for o in range(1, count - 1) if o != step]
        negative = [count - 1] * len(positive)
    elif kind == "differential":
        negative = [o for o in range(1, count - 1) if step not in (o, o + 1)]
        positive = [o + 1 for o in negative]
    else:
        raise ValueError(f"reading in [drive]: '{kind}' is unknown; known: {', '.join(READINGS)}.")
    first, unit = np.arange(count), np.eye(count)
    plus, minus = ((first[:, None] + np.array(side, dtype=int)) % count for side in (positive, negative))
    weights = unit[plus] - unit[minus]
    return unit - unit[(first + step) % count], weights


def _step(pattern: str, count: int) -> int:
    """How many electrodes counter-clockwise from the source the sink lies: 1 adjacent, count/2 opposite, N + 1."""
    skip = re.fullmatch(r"skip-(\d{1,9})", pattern)
    if not skip and pattern not in PATTERNS[:2]:
        raise ValueError(f"pattern in [drive]: '{pattern}' is unknown; known: {', '.join(PATTERNS)} (for instance "
                         "skip-2).")
    if pattern == "opposite" and count % 2:
        raise ValueError(f"pattern 'opposite' in [drive] needs an even number of electrodes, got {count}.")
    step = int(skip.group(1)) + 1 if skip else {"adjacent": 1, "opposite": count // 2}[pattern]
    if not 1 <= step <= count - 2:
        raise ValueError(f"pattern '{pattern}' in [drive] with {count} electrodes puts the sink on the source or on "
                         f"the reference; skip at most {count - 3}.")
    return step


def _weights(given: Rows | tuple[Rows, ...], patterns: int, count: int) -> Array:
    """(patterns, readings, count), one matrix for all patterns repeated."""
    if not (len(given) and len(given[0]) and isinstance(given[0][0], tuple)):
        return np.repeat(_matrix("measurements", given, count)[None], patterns, axis=0)
    if len(given) != patterns:
        raise ValueError(f"measurements in [drive] holds matrices for {len(given)} patterns, but {patterns} are "
                         "driven; give one for each, or one for all.")
    parts = [_matrix(f"measurements of pattern {k}", part, count) for k, part in enumerate(given)]
    if len({len(part) for part in parts}) > 1:
        raise ValueError("measurements in [drive] have " + ", ".join(str(len(part)) for part in parts) + " readings "
                         "by pattern; give every pattern as many.")
    return np.stack(parts)


def _matrix(name: str, rows: object, count: int) -> Array:
    try:
        matrix = np.array(rows, dtype=float)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.ndim != 2 or matrix.shape[1:] != (count,) or not np.all(np.isfinite(matrix)):
        raise ValueError(f"{name} in [drive] must hold rows of {count} finite numbers, one an electrode, got "
                         f"{'x'.join(map(str, matrix.shape)) if matrix.ndim > 1 else 'rows of unequal length'}.")
    return matrix


def voltage_columns(count: int, prefix: str = "v") -> list[str]:
    """Names of `count` reading columns: v_000, v_001 ... (prefix "v" touched, "dv" signal)."""
    return [f"{prefix}_{i:03d}" for i in range(count)]


def with_matrices(raw: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a scene or design file, CSV files named by MATRICES in [drive] replaced by the rows they hold, so
    that the tables need no other file from here on. Names are relative to `folder`; InputFileError names the file."""
    drive = raw.get("drive")
    if not isinstance(drive, Mapping):
        return dict(raw)
    read = {key: matrix_rows(folder / value) if key in MATRICES and isinstance(value, str) else value
            for key, value in drive.items()}
    return {**raw, "drive": read}


def matrix_rows(path: Path) -> list[Any]:
    """Rows of numbers, one column an electrode; where the first column is named "pattern", a list of rows for each
    pattern, numbered from 0."""
    if not path.exists():
        raise InputFileError(path, "no such file of rows, which currents or measurements in [drive] names. Check the "
                                   "name, which is relative to the scene file.")
    table = read_numbers(path)
    if not table.names or table.names[0].lower() != "pattern":
        return table.values.tolist()
    pattern, rows = table.values[:, 0], table.values[:, 1:]
    odd = np.flatnonzero((pattern < 0) | (pattern % 1 != 0))
    if odd.size:
        raise InputFileError(path, f"the pattern {pattern[odd[0]]:g} is no whole number from 0.",
                             line=int(table.line[odd[0]]))
    numbers = np.unique(pattern)
    if (missing := np.flatnonzero(numbers != np.arange(len(numbers)))).size:
        raise InputFileError(path, f"pattern {missing[0]} has no rows; number the patterns from 0 without gaps.")
    return [rows[pattern == k].tolist() for k in numbers]
