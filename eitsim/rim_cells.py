"""How far a table of what the rim changes is off, cell by cell: some are checked, and others take it from these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eitsim.path import Deviation
from eitsim.rim_table import RimTable, middle_depths, middle_gaps
from matcal.errors import NotConverged

Array = NDArray[np.float64]
# positions of a cell among gaps and among depths
Cell = tuple[int, int]


def cells_of(rim: RimTable) -> list[Cell]:
    """The cells whose touches are served."""
    return [(i, j) for i, j in np.argwhere(np.isfinite(rim.told).all(axis=-1)).tolist()]


def middles_of(rim: RimTable, cells: Sequence[Cell], diameters: Sequence[float]) -> list[tuple[float, float, float]]:
    """Diameter, gap and depth in the middle of cells, the diameters by turns."""
    gaps, depths = middle_gaps(rim.gaps), middle_depths(rim.depths)
    return [(diameters[(i // 2 + j // 2) % len(diameters)], float(gaps[i]), float(depths[j])) for i, j in cells]


def told_by(rim: RimTable, checked: Mapping[Cell, Deviation | None]) -> RimTable:
    """The table with its deviation at least the largest of the checked cells next to each, itself among them, or of the
    nearest where these are farther away; cells at which None was found are not served.

    NotConverged where more than half were not found, which leaves the error untold.
    """
    found = {cell: off for cell, off in checked.items() if off is not None}
    if 2 * len(found) < len(checked) or not found:
        raise NotConverged(f"{len(checked) - len(found)} of {len(checked)} changes by the rim that tell the error of "
                           "their table were not found; touches near the rim have to be solved one by one.",
                           estimate=rim.gaps)
    places, off = np.array(list(found)), np.array([[one.depth, one.signal] for one in found.values()])
    told = rim.told.copy()
    for cell in cells_of(rim):
        apart = np.abs(places - cell).max(axis=1)
        near = off[apart <= max(apart.min(), 1)].max(axis=0)
        told[cell] = np.inf if checked.get(cell, near) is None else np.maximum(told[cell], near)
    return replace(rim, told=told)
