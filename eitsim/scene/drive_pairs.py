"""A drive as a list of readings, each by its source, sink, plus and minus: the columns of a file of pairs."""

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchcal.csv_numbers import read_numbers
from touchcal.errors import InputFileError

PAIRS = ("source", "sink", "plus", "minus")  # columns of a file of pairs, electrodes from 0
_OTHER_DRIVES = ("pattern", "reading", "currents", "measurements")


def drive_of_pairs(pairs: NDArray[np.intp], count: int) -> dict[str, Any]:
    """Currents and measurements, as [drive] holds them, of readings (readings, 4) by source, sink, plus and minus: one
    pattern a run of readings of one current where all runs are as long, else one pattern a reading."""
    ends = [(*map(int, one[:2]),) for one in pairs]
    runs = [len(list(run)) for _, run in itertools.groupby(ends)]
    each = runs[0] if len(set(runs)) == 1 else 1
    unit = np.eye(count)
    weights = (unit[pairs[:, 2]] - unit[pairs[:, 3]]).reshape(-1, each, count)
    return {"currents": (unit[pairs[::each, 0]] - unit[pairs[::each, 1]]).tolist(), "measurements": weights.tolist()}


def read_pairs(path: Path, count: int) -> NDArray[np.intp]:
    """(readings, 4) electrodes from 0 of a CSV with the columns PAIRS; InputFileError names the line of what is none
    of `count` electrodes, or the same electrode twice."""
    table = read_numbers(path, what="electrodes")
    if set(table.names) != set(PAIRS) or len(table.names) != len(PAIRS):
        raise InputFileError(path, f"its header must name {', '.join(PAIRS)}, got {', '.join(table.names) or 'none'}.")
    values = table.values[:, [table.names.index(name) for name in PAIRS]]
    for line, row in zip(table.line, values, strict=True):
        if odd := [cell for cell in row if cell % 1 or not 0 <= cell < count]:
            raise InputFileError(path, f"{odd[0]:g} is no electrode; there are {count}, numbered from 0 (count in "
                                       "[electrodes]).", line=int(line))
        if row[0] == row[1] or row[2] == row[3]:
            raise InputFileError(path, "source and sink, or plus and minus, are the same electrode.", line=int(line))
    return values.astype(np.intp)


def with_pairs(drive: Mapping[str, Any], count: int, folder: Path) -> dict[str, Any]:
    """The table [drive], pairs replaced by the currents and measurements of that many electrodes that they stand for;
    ValueError names the key."""
    if "pairs" not in drive:
        return dict(drive)
    if other := [key for key in _OTHER_DRIVES if key in drive]:
        raise ValueError(f"{other[0]} in [drive] has no effect with pairs; leave one of them out.")
    if not isinstance(drive["pairs"], str):
        raise ValueError(f"pairs in [drive] must be the name of a CSV file, got {drive['pairs']!r:.80}.")
    kept = {key: value for key, value in drive.items() if key != "pairs"}
    return kept | drive_of_pairs(read_pairs(folder / drive["pairs"], count), count)
