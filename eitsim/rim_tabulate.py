"""Solving what the rim changes of a table's touches, and its deviation from changes solved afresh between them.

A change is solved on the coarse mesh at all places of a grid, and on the finer one at some: what that adds varies less,
and is a quadratic through those.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial, reduce

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import interp1d

from eitsim.change import Change, signal_difference
from eitsim.near_rim import COARSE, corrected, rim_change
from eitsim.path import Deviation
from eitsim.results import Touch
from eitsim.rim_table import LOCAL, RimTable, Solved, across_depths, across_gaps, change_from, changed_diameters
from eitsim.scene import Punch
from eitsim.table import Shape, Table, carried_over, parts_of, touch_from
from eitsim.tabulate import Run
from matcal.errors import NotConverged

Array = NDArray[np.float64]
# (diameters, gaps, depths) of Solved, None where nothing was found
Found = NDArray[np.object_]
# diameter, gap, depth, over the thickness
Place = tuple[float, float, float]
Solve = Callable[[Table, Place], Solved]

# Gaps, from where deep touches still are found at once up to where the rim no longer counts at a wanted error of 1 %,
# and depths of the axisymmetric touch, both over the thickness, at which changes are solved.
GAPS = tuple((np.geomspace(0.25, 4.7, 8)[1:] - 0.2).tolist())
DEPTHS = (0.02, 0.06, 0.12, 0.2, 0.32, 0.48, 0.66, 0.86)
# How many of them, each, are solved on the finer mesh too.
_FINE = 3
# How many changes are solved afresh to tell the error.
_CHECKS = 6


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Changes on a grid."""

    gaps: Array
    depths: Array
    solved: Found
    cpu_s: float


def build_rim(table: Table, run: Run = map, gaps: Iterable[float] = GAPS, depths: Iterable[float] = DEPTHS) -> RimTable:
    """Solve the changes of a table's touches at increasing gaps and depths, over the thickness; `run` maps a function
    over places, possibly in other processes.

    NotConverged where too few changes are found, or too few of those that tell the error.
    """
    diameters = changed_diameters(table.shape)
    rough = _nodes(table, run, _roughly, np.array(list(gaps)), np.array(list(depths)), LOCAL)
    fine = _nodes(table, run, _finely, _some(rough.gaps), _some(rough.depths), LOCAL - 1)
    rough = _within(rough, fine)
    field = fine.solved[len(diameters) // 2, 0, 0].change.field
    (fields, numbers), finer = (_rows(table.shape, field.radius_m, nodes) for nodes in (rough, fine))
    at = rough.gaps, rough.depths, fine.gaps, fine.depths
    fields, numbers = (refined(*at, *pair) for pair in zip((fields, numbers), finer, strict=True))
    rim = RimTable(diameters, rough.gaps, rough.depths, field.radius_m, field.share, fields.astype(np.float32), numbers,
                   Deviation(0.0, 0.0, 0.0), rough.cpu_s + fine.cpu_s)
    return checked(table, rim, run)


def _nodes(table: Table, run: Run, solve: Solve, gaps: Array, depths: Array, least: int) -> _Nodes:
    """Changes at all gaps and depths where they are found, at least so many of each."""
    diameters = changed_diameters(table.shape)
    grid = [(d, g, s) for d in diameters.tolist() for g in gaps.tolist() for s in depths.tolist()]
    found = list(run(partial(_timed, solve, table), grid))
    solved = np.array([one for one, _ in found], dtype=object).reshape(len(diameters), len(gaps), len(depths))
    return _Nodes(*_complete(gaps, depths, solved, least), sum(cpu for _, cpu in found))


def _some(nodes: Array) -> Array:
    return nodes[np.linspace(0, len(nodes) - 1, _FINE).round().astype(int)]


def _within(nodes: _Nodes, other: _Nodes) -> _Nodes:
    """The nodes between the least gap and the largest depth of others."""
    i, j = nodes.gaps >= other.gaps[0], nodes.depths <= other.depths[-1]
    return replace(nodes, gaps=nodes.gaps[i], depths=nodes.depths[j], solved=nodes.solved[:, i][:, :, j])


def _timed(solve: Solve, table: Table, place: Place) -> tuple[Solved | None, float]:
    """What `solve` finds at a place, None where it finds nothing, and the CPU time."""
    started = time.process_time()
    try:
        found = solve(table, place)
    except NotConverged:
        found = None
    return found, time.process_time() - started


def _loaded(table: Table, place: Place) -> tuple[Touch, Punch]:
    """The axisymmetric touch of a place, and its punch there."""
    diameter, gap, depth = place
    law, body, punch = parts_of(table.shape, diameter)
    touch = touch_from(table, law, body, replace(punch, force_N=None, depth_m=depth), table.shape.strain)
    if touch is None:
        raise NotConverged("the load paths end before this depth.", estimate=table.depths)
    return touch, replace(punch, x_m=body.radius_m - diameter / 2 - gap, force_N=touch.force_N)


def _roughly(table: Table, place: Place) -> Solved:
    """The change on the coarse mesh alone, whose errors are not told."""
    law, body, _ = parts_of(table.shape, place[0])
    return Solved(rim_change(law, body, _loaded(table, place)[1], COARSE), 0.0, 0.0)


def _finely(table: Table, place: Place) -> Solved:
    law, body, _ = parts_of(table.shape, place[0])
    touch, punch = _loaded(table, place)
    done = corrected(touch, law, body, punch, strain=table.shape.strain)
    assert done.rim is not None
    wall = done.wall_contact_m2 / touch.wall_contact_m2 if touch.wall_contact_m2 > 0 else 1.0
    change = Change(done.rim, done.depth_m - touch.depth_m, done.sigma_max_Pa / touch.sigma_max_Pa,
                    done.contact_area_m2 / touch.contact_area_m2, wall, done.fraction_non_elliptic, done.residuals)
    return Solved(change, done.depth_error - touch.depth_error, done.signal_error - touch.signal_error)


def _complete(gaps: Array, depths: Array, solved: Found, least: int) -> tuple[Array, Array, Found]:
    """Without the smallest gaps and the largest depths at which changes were not found, at least so many of each."""
    while len(gaps) >= least and len(depths) >= least:
        missing = solved == None  # noqa: E711
        if not missing.any():
            return gaps, depths, solved
        if missing[:, 0].mean() >= missing[:, :, -1].mean():
            gaps, solved = gaps[1:], solved[:, 1:]
        else:
            depths, solved = depths[:-1], solved[:, :, :-1]
    raise NotConverged("changes by the rim were found at too few gaps and depths for a table.", estimate=gaps)


def _rows(shape: Shape, radius: Array, nodes: _Nodes) -> tuple[Array, Array]:
    """What a table keeps of changes: fields and numbers (diameters, gaps, depths, ...) at radii about the middle
    diameter."""
    diameters = changed_diameters(shape).tolist()
    middle = diameters[len(diameters) // 2]
    made = [_row(shape, radius, middle, one, d, s) for d, part in zip(diameters, nodes.solved, strict=True)
            for line in part for s, one in zip(nodes.depths.tolist(), line, strict=True)]
    fields, numbers = (np.stack(rows).reshape(*nodes.solved.shape, -1) for rows in zip(*made, strict=True))
    return fields, numbers


def _row(shape: Shape, radius: Array, middle: float, one: Solved, diameter: float, depth: float) -> tuple[Array, Array]:
    """What a table keeps of a change, its circles carried over to those about the middle diameter."""
    change, field = one.change, one.change.field
    own = carried_over(shape, radius, middle, diameter)
    parts = np.concatenate([field.displacement_m, field.metric - [1, 0, 1], field.normal[..., None] - 1], axis=-1)
    at = np.clip(own, field.radius_m[0], field.radius_m[-1])
    parts = interp1d(field.radius_m, parts, axis=0, assume_sorted=True)(at) / depth
    numbers = [change.depth_m / depth, change.pressure, change.area, change.wall, change.fraction_non_elliptic,
               one.depth_error, one.signal_error]
    return parts.ravel(), np.array(numbers)


def refined(gaps: Array, depths: Array, fine_gaps: Array, fine_depths: Array, values: Array, finer: Array) -> Array:
    """Values (diameters, gaps, depths, n) with what finer ones at some of the gaps and depths add, a polynomial through
    them in the logarithms."""
    i, j = np.searchsorted(gaps, fine_gaps), np.searchsorted(depths, fine_depths)
    added = finer - values[:, i][:, :, j]
    along = np.stack([_spread(len(fine_gaps), across_gaps(fine_gaps, gap)) for gap in gaps.tolist()])
    down = np.stack([_spread(len(fine_depths), across_depths(fine_depths, depth)) for depth in depths.tolist()])
    return values + np.einsum("Gg,Ss,dgsn->dGSn", along, down, added, optimize=True)


def _spread(count: int, local: tuple[slice, Array]) -> Array:
    """Weights of some nodes among all (count,) of them."""
    out = np.zeros(count)
    out[local[0]] = local[1]
    return out


def checked(table: Table, rim: RimTable, run: Run) -> RimTable:
    """The table with its largest deviation from changes solved afresh in the middle between its nodes.

    NotConverged where more than half of these are not found, which leaves the error untold.
    """
    def middles(nodes: Array) -> Array:
        return np.sqrt(nodes[1:] * nodes[:-1]) if len(nodes) > 1 else nodes

    d, g, s = (middles(nodes) for nodes in (rim.diameters, rim.gaps, rim.depths))
    count = np.arange(_CHECKS)
    places = list(zip(d[count % len(d)].tolist(), g[(2 * count + 1) % len(g)].tolist(),
                      s[np.linspace(0, len(s) - 1, _CHECKS).round().astype(int)].tolist(), strict=True))
    found = list(run(partial(_timed, _finely, table), places))
    apart = [_apart(table, rim, place, fresh) for place, (fresh, _) in zip(places, found, strict=True)
             if fresh is not None]
    if 2 * len(apart) < _CHECKS:
        raise NotConverged(f"{_CHECKS - len(apart)} of {_CHECKS} changes by the rim that tell the error of their table "
                           "were not found; touches near the rim have to be solved one by one.", estimate=rim.gaps)
    spent = rim.cpu_s + sum(cpu for _, cpu in found)
    return replace(rim, error=reduce(Deviation.at_least, apart, rim.error), cpu_s=spent)


def _apart(table: Table, rim: RimTable, place: Place, fresh: Solved) -> Deviation:
    """How far the table is from a change solved afresh at a place between its nodes."""
    diameter, gap, depth = place
    stored = change_from(table.shape, rim, diameter, gap, depth)
    law, body, punch = parts_of(table.shape, diameter)
    touch = touch_from(table, law, body, replace(punch, force_N=None, depth_m=depth), table.shape.strain)
    assert stored is not None
    assert touch is not None
    signal = signal_difference(touch, stored.change.field, fresh.change.field, table.shape.strain)
    return Deviation(abs(stored.change.depth_m - fresh.change.depth_m) / (depth + fresh.change.depth_m), signal, 0.0)
