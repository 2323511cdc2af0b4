"""What the rim changes of a touch, tabulated over diameter, gap and depth, and added to touches from load paths.

A change is solved at a few gaps between the punch's edge and the rim and at a few depths of the axisymmetric touch, and
divided by the depth, in proportion to which it starts; between them it is cubic in the logarithm of gap and depth.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import interp1d

from eitsim.change import Change, changed, signal_difference, within_face
from eitsim.near_rim import corrected
from eitsim.path import Deviation
from eitsim.results import RimField, Touch
from eitsim.scene import Body, Punch
from eitsim.table import Shape, carried_over, parts_of, state, touch_from
from matcal.errors import NotConverged

if TYPE_CHECKING:
    from eitsim.table import Table
    from eitsim.tabulate import Run

Array = NDArray[np.float64]

# Gaps, depths of the axisymmetric touch, both over the thickness, and the most diameters at which changes are solved.
GAPS = tuple((np.geomspace(0.25, 3.2, 7) - 0.2).tolist())
DEPTHS = (0.02, 0.06, 0.12, 0.2, 0.32, 0.48, 0.66, 0.86)
_DIAMETERS = 3
# Added to gaps and depths before the logarithm is taken.
_GAP_SHIFT, _DEPTH_SHIFT = 0.2, 0.1
# Nodes of a local cubic.
_LOCAL = 4
# How many changes are solved afresh to tell the error.
_CHECKS = 6
# Parts of a field's sample: displacement, metric, normal.
_PARTS = 7


@dataclass(frozen=True, eq=False)
class RimTable:
    """Changes of the axisymmetric touch by the rim."""

    # increasing, over the thickness
    diameters: Array
    gaps: Array
    depths: Array
    # (n,) radii of the circles about the middle diameter, over the thickness, and (k,) places on them
    radius: Array
    share: Array
    # (diameters, gaps, depths, n k 7) displacement, metric - (1, 0, 1) and normal - 1 over the depth
    fields: NDArray[np.float32]
    # (diameters, gaps, depths, 7) added depth over the depth, ratios of pressure, area and wall, fraction that is not
    # elliptic, and the errors of depth and signal that the rim's own mesh makes
    numbers: Array
    # largest deviation from changes solved afresh between
    error: Deviation
    cpu_s: float


@dataclass(frozen=True, eq=False)
class Solved:
    """A change by the rim, lengths over the thickness, and the errors that the rim's own mesh makes."""

    change: Change
    depth_error: float
    signal_error: float


def build_rim(table: Table, run: Run = map, gaps: Iterable[float] = GAPS, depths: Iterable[float] = DEPTHS) -> RimTable:
    """Solve the changes of a table's touches; NotConverged where too few of them are found."""
    diameters, gaps, depths = changed_diameters(table.shape), np.array(list(gaps)), np.array(list(depths))
    depths = depths[depths < table.depths[-1]]
    grid = [(d, g, s) for d in diameters for g in gaps for s in depths]
    found = list(run(partial(_solved, table), grid))
    spent = sum(cpu for _, cpu in found)
    solved = np.array([one for one, _ in found], dtype=object).reshape(len(diameters), len(gaps), len(depths))
    gaps, depths, solved = _complete(gaps, depths, solved)
    middle = solved[len(diameters) // 2, 0, 0].change.field
    made = [_row(table.shape, middle.radius_m, diameters, one, d, s) for d, part in zip(diameters, solved, strict=True)
            for line in part for s, one in zip(depths, line, strict=True)]
    fields, numbers = (np.stack(rows).reshape(*solved.shape, -1) for rows in zip(*made, strict=True))
    rim = RimTable(diameters, gaps, depths, middle.radius_m, middle.share, fields.astype(np.float32), numbers,
                   Deviation(0.0, 0.0, 0.0), spent)
    return _checked(table, rim, run)


def changed_diameters(shape: Shape) -> Array:
    """Diameters at which changes are solved, over the thickness."""
    low, high = np.log(shape.diameters[0]), np.log(shape.diameters[-1])
    return np.exp(np.linspace(low, high, _DIAMETERS)) if high > low else np.array(shape.diameters)


def _punch(shape: Shape, diameter: float, gap: float) -> Punch:
    _, body, punch = parts_of(shape, diameter)
    return replace(punch, x_m=body.radius_m - diameter / 2 - gap)


def _solved(table: Table, place: tuple[float, float, float]) -> tuple[Solved | None, float]:
    """The change at a diameter, gap and depth, None where it is not found, and the CPU time."""
    started = time.process_time()
    diameter, gap, depth = place
    law, body, _ = parts_of(table.shape, diameter)
    found = state(table, diameter, depth=depth)
    if found is None:
        return None, 0.0
    force = found.number["mean_pressure"] * np.pi * diameter**2 / 4
    punch = replace(_punch(table.shape, diameter, gap), force_N=force)
    touch = touch_from(table, law, body, punch, table.shape.strain)
    assert touch is not None
    try:
        done = corrected(touch, law, body, punch, strain=table.shape.strain)
    except NotConverged:
        return None, time.process_time() - started
    assert done.rim is not None
    wall = done.wall_contact_m2 / touch.wall_contact_m2 if touch.wall_contact_m2 > 0 else 1.0
    change = Change(done.rim, done.depth_m - touch.depth_m, done.sigma_max_Pa / touch.sigma_max_Pa,
                    done.contact_area_m2 / touch.contact_area_m2, wall, done.fraction_non_elliptic, done.residuals)
    return Solved(change, done.depth_error - touch.depth_error, done.signal_error - touch.signal_error), (
        time.process_time() - started)


def _complete(gaps: Array, depths: Array, solved: NDArray[np.object_]) -> tuple[Array, Array, NDArray[np.object_]]:
    """Without the smallest gaps and the largest depths at which changes were not found."""
    while len(gaps) >= _LOCAL and len(depths) >= _LOCAL:
        missing = solved == None  # noqa: E711
        if not missing.any():
            return gaps, depths, solved
        if missing[:, 0].mean() >= missing[:, :, -1].mean():
            gaps, solved = gaps[1:], solved[:, 1:]
        else:
            depths, solved = depths[:-1], solved[:, :, :-1]
    raise NotConverged("changes by the rim were found at too few gaps and depths for a table.", estimate=gaps)


def _row(shape: Shape, radius: Array, diameters: Array, one: Solved, diameter: float,
         depth: float) -> tuple[Array, Array]:
    """What a table keeps of a change, its circles carried over to those about the middle diameter."""
    change, field = one.change, one.change.field
    own = carried_over(shape, radius, float(diameters[len(diameters) // 2]), diameter)
    parts = np.concatenate([field.displacement_m, field.metric - [1, 0, 1], field.normal[..., None] - 1], axis=-1)
    at = np.clip(own, field.radius_m[0], field.radius_m[-1])
    parts = interp1d(field.radius_m, parts, axis=0, assume_sorted=True)(at) / depth
    numbers = [change.depth_m / depth, change.pressure, change.area, change.wall, change.fraction_non_elliptic,
               one.depth_error, one.signal_error]
    return parts.ravel(), np.array(numbers)


def change_from(shape: Shape, rim: RimTable, diameter: float, gap: float, depth: float) -> Solved | None:
    """The change of an axisymmetric touch of a depth, all over the thickness; None where the table does not reach.

    Below the least depth the change goes on in proportion to the depth.
    """
    low, high = rim.gaps[[0, -1]]
    if not low <= gap <= high or depth > rim.depths[-1]:
        return None
    w_d = _lagrange(np.log(rim.diameters), np.log(diameter))
    i, w_g = _local(np.log(rim.gaps + _GAP_SHIFT), np.log(gap + _GAP_SHIFT))
    j, w_s = _local(np.log(rim.depths + _DEPTH_SHIFT), np.log(max(depth, rim.depths[0]) + _DEPTH_SHIFT))
    weight = w_d[:, None, None] * w_g[:, None] * w_s
    fields, numbers = (np.tensordot(weight, part[:, i, j], 3) for part in (rim.fields, rim.numbers))
    parts = fields.reshape(len(rim.radius), len(rim.share), _PARTS) * depth
    base = float(rim.diameters[len(rim.diameters) // 2])
    disc = shape.disc
    field = RimField(carried_over(shape, rim.radius, base, diameter), rim.share, parts[..., :3],
                     parts[..., 3:6] + [1, 0, 1], parts[..., 6] + 1, disc, disc - diameter / 2 - gap)
    added, pressure, area, wall, lost, depth_error, signal_error = numbers.tolist()
    return Solved(Change(field, added * depth, pressure, area, max(wall, 0.0), min(max(lost, 0.0), 1.0), ()),
                  max(depth_error, 0.0), max(signal_error, 0.0))


def _lagrange(nodes: Array, at: float) -> Array:
    apart = nodes[:, None] - nodes + np.eye(len(nodes))
    return np.array([float(np.prod(np.delete((at - nodes) / apart[j], j))) for j in range(len(nodes))])


def _local(nodes: Array, at: float) -> tuple[slice, Array]:
    """Nodes and weights of the cubic through the nearest four."""
    first = int(np.clip(np.searchsorted(nodes, at) - _LOCAL // 2, 0, len(nodes) - _LOCAL))
    chosen = slice(first, first + _LOCAL)
    return chosen, _lagrange(nodes[chosen], at)


def near_rim_from(table: Table, touch: Touch, body: Body, punch: Punch) -> Touch | None:
    """An axisymmetric touch with the rim's change from a table; None where the table does not reach."""
    unit = body.thickness_m
    if table.rim is None or punch.conductor or punch.force_N is None:
        return None
    gap = body.radius_m - float(np.hypot(punch.x_m, punch.y_m)) - punch.diameter_m / 2
    found = change_from(table.shape, table.rim, punch.diameter_m / unit, gap / unit, touch.depth_m / unit)
    if found is None:
        return None
    field = found.change.field
    field = replace(field, radius_m=field.radius_m * unit, displacement_m=field.displacement_m * unit,
                    disc_m=body.radius_m, offset_m=float(np.hypot(punch.x_m, punch.y_m)))
    with_rim = changed(touch, replace(found.change, field=field, depth_m=found.change.depth_m * unit))
    return replace(within_face(with_rim, punch), depth_error=touch.depth_error + found.depth_error,
                   signal_error=touch.signal_error + found.signal_error)


def _checked(table: Table, rim: RimTable, run: Run) -> RimTable:
    """The table with its largest deviation from changes solved afresh in the middle between its nodes."""
    def middles(nodes: Array) -> Array:
        return np.sqrt(nodes[1:] * nodes[:-1]) if len(nodes) > 1 else nodes

    d, g, s = (middles(nodes) for nodes in (rim.diameters, rim.gaps, rim.depths))
    count = np.arange(_CHECKS)
    places = list(zip(d[count % len(d)].tolist(), g[count % len(g)].tolist(),
                      s[(count * len(s)) // _CHECKS].tolist(), strict=True))
    error, spent = rim.error, rim.cpu_s
    for place, (fresh, cpu) in zip(places, run(partial(_solved, table), places), strict=True):
        diameter, gap, depth = place
        stored = change_from(table.shape, rim, diameter, gap, depth)
        spent += cpu
        if fresh is None or stored is None:
            continue
        law, body, punch = parts_of(table.shape, diameter)
        touch = touch_from(table, law, body, replace(punch, force_N=None, depth_m=depth), table.shape.strain)
        assert touch is not None
        apart = signal_difference(touch, stored.change.field, fresh.change.field, table.shape.strain)
        error = error.at_least(Deviation(abs(stored.change.depth_m - fresh.change.depth_m)
                                         / (depth + fresh.change.depth_m), apart, 0.0))
    return replace(rim, error=error, cpu_s=spent)
