"""What the rim changes of touches at drawn laws: the central law's change at equal depth, and how far that is off."""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial, reduce

import numpy as np

from eitsim.change import signal_difference
from eitsim.family import Family, table_of
from eitsim.near_rim import corrected
from eitsim.path import Deviation
from eitsim.rim_table import RimTable, near_rim_from
from eitsim.table import Table, parts_of, touch_from
from eitsim.tabulate import Run
from matcal.errors import NotConverged

# Changes by which the farthest law tells their error.
_CHECKS = 4


def with_rim(family: Family, table: Table, run: Run = map) -> Family:
    """The family with what the rim changes of the central law's touches, from its table, taken over at equal depth; its
    error is at least that at the law that is farthest off.

    NotConverged where more than half of the changes that tell it are not found.
    """
    rim = table.rim
    assert rim is not None
    family = replace(family, table=replace(family.table, rim=rim))
    if not family.span.held_out:
        return family
    own = table_of(family, family.span.held_out[0])
    assert own is not None
    found = list(run(partial(_deviation, own), _places(rim)))
    apart = [one for one, _ in found if one is not None]
    if 2 * len(apart) < len(found):
        raise NotConverged(f"{len(found) - len(apart)} of {len(found)} changes by the rim that tell the error at a "
                           "drawn law were not found; touches near the rim have to be solved one by one.",
                           estimate=rim.gaps)
    spent = rim.cpu_s + sum(cpu for _, cpu in found)
    rim = replace(rim, error=reduce(Deviation.at_least, apart, rim.error), cpu_s=spent)
    return replace(family, table=replace(family.table, rim=rim))


def _places(rim: RimTable) -> list[tuple[float, float, float]]:
    """Diameters, gaps and depths between the nodes of a table of changes."""
    gaps, depths = (np.sqrt(nodes[1:] * nodes[:-1]) for nodes in (rim.gaps, rim.depths))
    return [(float(rim.diameters[i % len(rim.diameters)]), float(gaps[i * len(gaps) // _CHECKS]),
             float(depths[(2 * i + 1) * len(depths) // (2 * _CHECKS)])) for i in range(_CHECKS)]


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
    signal = signal_difference(alone, stored.rim, fresh.rim, table.shape.strain)
    return Deviation(abs(stored.depth_m / fresh.depth_m - 1), signal, 0.0), time.process_time() - started
