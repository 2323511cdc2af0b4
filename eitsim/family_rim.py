"""What the rim changes of touches at drawn laws: the central law's change at equal depth, and how far that is off."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

from eitsim.family import Family, table_of
from eitsim.near_rim import corrected
from eitsim.nominal_signal import signal_difference
from eitsim.path import Deviation
from eitsim.rim_cells import cells_of, middles_of, told_by
from eitsim.rim_table import near_rim_from
from eitsim.table import Table, parts_of, touch_from
from eitsim.tabulate import Run
from matcal.errors import NotConverged

# Of the cells of gap and depth, every which gap and depth the farthest law is solved at to tell the error.
_EVERY = (3, 4)


def with_rim(family: Family, table: Table, run: Run = map) -> Family:
    """The family with what the rim changes of the central law's touches, from its table, taken over at equal depth; in
    each cell of gap and depth its deviation is at least that at the law that is farthest off in the nearest cells.

    NotConverged where more than half of the changes that tell it are not found.
    """
    rim = table.rim
    assert rim is not None
    family = replace(family, table=replace(family.table, rim=rim))
    if not family.span.held_out:
        return family
    own = table_of(family, family.span.held_out[0])
    assert own is not None
    cells = [(i, j) for i, j in cells_of(rim) if i % _EVERY[0] == 0 and j % _EVERY[1] == 1]
    found = list(run(partial(_deviation, own), middles_of(rim, cells, rim.diameters.tolist())))
    rim = told_by(rim, {cell: off for cell, (off, _) in zip(cells, found, strict=True)})
    spent = rim.cpu_s + sum(cpu for _, cpu in found)
    return replace(family, table=replace(family.table, rim=replace(rim, cpu_s=spent)))


def _deviation(table: Table, place: tuple[float, float, float]) -> tuple[Deviation | None, float]:
    """How far a table is from the rim's change of its touch solved afresh, None where that is not found, and the CPU
    time."""
    started = time.process_time()
    diameter, gap, depth = place
    law, body, punch = parts_of(table.shape, diameter)
    alone = touch_from(table, law, body, replace(punch, force_N=None, depth_m=depth), table.shape.strain)
    if alone is None:
        return None, time.process_time() - started
    punch = replace(punch, x_m=body.radius_m - diameter / 2 - gap, force_N=alone.force_N)
    stored = near_rim_from(table, alone, body, punch)
    try:
        fresh = corrected(alone, law, body, punch, strain=table.shape.strain)
    except NotConverged:
        return None, time.process_time() - started
    if stored is None or stored.rim is None or fresh.rim is None:
        return None, time.process_time() - started
    signal = signal_difference(body, punch, alone, stored.rim, fresh.rim, table.shape.strain)
    return Deviation(abs(stored.depth_m / fresh.depth_m - 1), signal, 0.0), time.process_time() - started
