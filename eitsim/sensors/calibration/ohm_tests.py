"""Whether readings are those of an ohmmeter, without a model: a linear, reciprocal body and channels free of ground.

Such an instrument repeats a reading, changes its sign alone where source and sink are exchanged, reads the same where
what drives and what is read are exchanged, and adds up the readings of drives that add up.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.scene.drive import Protocol
from touchcal.arrays import Array

_EXACT = 1e-9  # currents and weights closer than this to each other, of the largest, are the same


@dataclass(frozen=True)
class OhmTests:
    """2-norms of differences between readings that an ohmmeter would give alike, over those of the readings; None where
    the drive asks for no such readings, or magnitudes cannot tell."""

    repeats: float | None  # the same drive read in the same way
    source_against_sink: float | None  # source and sink exchanged
    reciprocity: float | None  # what drives and what is read exchanged
    superposition: float | None  # readings against what is linear in the currents


def ohm_tests(asked: Protocol, volts: Array, signed: bool = True) -> OhmTests:
    """The tests of one frame (patterns, readings), NaN where dead; of magnitudes those that need no sign."""
    drives, reads, of_drive, of_read, value = _transfer(asked, volts, signed)
    table = np.full((len(drives), len(reads)), np.nan)
    count, total = np.zeros((2, *table.shape))
    np.add.at(count, (of_drive, of_read), 1)
    np.add.at(total, (of_drive, of_read), value)
    table[count > 0] = total[count > 0] / count[count > 0]
    again = count[of_drive, of_read] > 1
    # n values about their own mean: n - 1 of n parts of their variance
    spread = (value - table[of_drive, of_read]) * np.sqrt(2.0)
    return OhmTests(_over(spread[again], value[again]), _exchanged(drives, table, signed),
                    _reciprocity(drives, reads, table) if signed else None,
                    _superposition(drives, table) if signed else None)


def _transfer(asked: Protocol, volts: Array, signed: bool) -> tuple[Array, Array, Array, Array, Array]:
    """Different drives (d, N) and readings (r, N), which of them each finite reading is, and its value for 1 A."""
    size = np.abs(asked.currents_A).max(axis=1)
    drives, of_drive = _different(asked.currents_A / size[:, None])
    weights = asked.weights.reshape(-1, asked.weights.shape[2])
    first = weights[np.arange(len(weights)), (weights != 0).argmax(axis=1)]
    reads, of_read = _different(weights * np.sign(first)[:, None])
    value = (volts / size[:, None]).ravel() * (np.sign(first) if signed else 1.0)
    there = np.isfinite(value)
    return drives, reads, np.repeat(of_drive, volts.shape[1])[there], of_read[there], value[there]


def _different(rows: Array) -> tuple[Array, Array]:
    found, place = np.unique(np.round(rows / _EXACT) * _EXACT, axis=0, return_inverse=True)
    return found, place.ravel()


def _over(difference: Array, value: Array) -> float | None:
    return float(np.linalg.norm(difference) / np.linalg.norm(value)) if value.any() else None


def _exchanged(drives: Array, table: Array, signed: bool) -> float | None:
    one, other = np.nonzero(np.triu(np.abs(drives[:, None] + drives).max(axis=2) < 2 * _EXACT))
    back = -table[other] if signed else table[other]
    both = np.isfinite(table[one] + back)
    return _over(((table[one] - back) * np.sqrt(2.0))[both], np.concatenate([table[one][both], back[both]]))


def _reciprocity(drives: Array, reads: Array, table: Array) -> float | None:
    """Readings combined to the voltage over each other drive: a symmetric matrix."""
    over = np.full((len(drives), len(drives)), np.nan)
    for own, row in zip(over, table, strict=True):
        read = np.isfinite(row)
        combined = drives @ np.linalg.pinv(reads[read])
        exact = np.abs(combined @ reads[read] - drives).max(axis=1) < 1e-6
        own[exact] = combined[exact] @ row[read]
    different = np.isfinite(over + over.T) & ~np.eye(len(over), dtype=bool)
    return _over((over - over.T)[different], over[different])


def _superposition(drives: Array, table: Array) -> float | None:
    left, value = [], []
    for column in table.T:
        read = np.isfinite(column)
        own = drives[read]
        if np.linalg.matrix_rank(own) < len(own):
            left.append(column[read] - own @ np.linalg.lstsq(own, column[read])[0])
            value.append(column[read])
    return _over(np.concatenate(left), np.concatenate(value)) if left else None
