"""Solving what the rim changes of a table's touches, and its deviation from changes solved anew between them.

A change is solved on the coarse mesh at all places of a grid, and from there on the finer one at some: what that adds
varies less with the gap, and is a cubic through those. Deep touches next to the rim are not found; there lines over the
gap go on as parabolas, and no touch next to such a place is served.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import interp1d

from eitsim.electrics.forward.nominal_sensor import signal_differences
from eitsim.mechanics.load_paths import rim_table
from eitsim.mechanics.load_paths.build_table import Run, timed
from eitsim.mechanics.load_paths.load_path import Deviation
from eitsim.mechanics.load_paths.rim_table import Solved, cells_of, change_from, changed_diameters, extended
from eitsim.mechanics.load_paths.table import carried_over, edge_of, parts_of, touch_from
from eitsim.mechanics.load_paths.types import DimensionlessProblem, RimTable, Table
from eitsim.mechanics.rim.correction import RimCorrection, with_error
from eitsim.mechanics.rim.solve_near_rim import COARSE, FINE, LEAST_GAP, rim_changes
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Punch
from eitsim.simulation.near_edges import with_signal_errors
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# diameter, gap, depth, over the thickness
Place = tuple[float, float, float]
Solve = Callable[[Table, Any], Any]


@dataclass(frozen=True)
class Grid:
    """Gaps and depths of the axisymmetric touch, increasing, over the thickness, at which changes are solved."""

    gaps: tuple[float, ...]
    depths: tuple[float, ...]
    # those of them at which they are solved on the finer mesh too, the ends among them
    fine_gaps: tuple[float, ...]
    fine_depths: tuple[float, ...]


# From the rim itself up to where it no longer counts at a requested error of 1 %. The coarse mesh's contact grows
# element by element, felt most at depths between 0.06 and 0.16, which takes the finer mesh there.
GRID = Grid((0.0, 0.06, 0.18, 0.38, 0.68, 1.14, 1.83, 2.9, 4.5),
            (0.02, 0.035, 0.06, 0.09, 0.12, 0.16, 0.2, 0.26, 0.32, 0.4, 0.48, 0.57, 0.66, 0.76, 0.86),
            (0.0, 0.18, 1.14, 4.5), (0.02, 0.035, 0.06, 0.09, 0.12, 0.16, 0.32, 0.48, 0.66, 0.86))
# Depths up to which changes are tried, over the thickness, on the coarse and on the finer mesh, and what each thickness
# of the gap adds to them: deeper ones next to the rim take a minute each, and many are not found.
_ROUGH_TRIED, _FINE_TRIED, _BY_GAP = 0.66, 0.5, 4.0
# Fewest gaps at which a depth is found.
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class _Nodes:
    """Changes on a grid."""

    gaps: Array
    depths: Array
    solved: NDArray[np.object_]  # (diameters, gaps, depths) of Solved, None where nothing was found

    @property
    def missing(self) -> NDArray[np.bool_]:
        """(diameters, gaps, depths) where none was found."""
        return np.array([one is None for one in self.solved.ravel()]).reshape(self.solved.shape)


def build_rim(table: Table, run: Run = map, grid: Grid = GRID) -> RimTable:
    """Solve the changes of a table's touches on a grid; `run` maps a function over places, possibly in other processes.
    NotConverged where too few changes are found, or too few of those that give the error."""
    diameters = changed_diameters(table.shape)
    rough, fine, spent = _nodes(table, run, grid)
    rough, fine = _as_deep(rough, fine)
    field = fine.solved[len(diameters) // 2, -1, 0].change.field
    (fields, numbers), finer = (_rows(table.shape, field.radius_m, nodes) for nodes in (rough, fine))
    at = rough.gaps, rough.depths, fine.gaps, fine.depths
    fields, numbers = (refined(*at, *pair) for pair in zip((fields, numbers), finer, strict=True))
    unknown = _no_errors(rough)
    rim = RimTable(diameters, rough.gaps, rough.depths, field.radius_m, field.share, fields.astype(np.float32), numbers,
                   unknown, np.full(unknown.shape, np.nan), spent)
    return checked(table, rim, run)


def _nodes(table: Table, run: Run, grid: Grid) -> tuple[_Nodes, _Nodes, float]:
    """Changes on the coarse and on the finer mesh at all gaps and depths at which they are tried, on the rim itself up
    to the deepest, and the CPU time."""
    diameters, least = changed_diameters(table.shape).tolist(), LEAST_GAP * table.shape.disc
    gaps, fine_gaps = (np.maximum(at, least) for at in (grid.gaps, grid.fine_gaps))
    finer = {place for place in itertools.product(diameters, fine_gaps.tolist(), grid.fine_depths)
             if place[2] <= _FINE_TRIED + _BY_GAP * place[1]}
    tried = [place for place in itertools.product(diameters, gaps.tolist(), grid.depths)
             if place[2] <= _ROUGH_TRIED + _BY_GAP * place[1]]
    found = list(run(partial(timed_change, _on_meshes, table), [(place, place in finer) for place in tried]))
    at = {place: one or (None, None) for place, (one, _) in zip(tried, found, strict=True)}

    def nodes(which: int, gaps: Array, depths: Sequence[float]) -> _Nodes:
        solved = np.empty((len(diameters), len(gaps), len(depths)), dtype=object)
        solved.ravel()[:] = [at.get(place, (None, None))[which]
                             for place in itertools.product(diameters, gaps.tolist(), depths)]
        return _Nodes(gaps, np.array(depths), solved)

    return nodes(0, gaps, grid.depths), nodes(1, fine_gaps, grid.fine_depths), sum(cpu for _, cpu in found)


def _as_deep(rough: _Nodes, fine: _Nodes) -> tuple[_Nodes, _Nodes]:
    """Both as deep as a few of the largest gaps are found at; NotConverged where that is at too few depths."""
    ends = [_end(nodes) for nodes in (rough, fine)]
    common = fine.depths[fine.depths <= min(ends)]
    if len(common) < _FEWEST:
        raise NotConverged("changes by the rim were found at too few gaps and depths for a table.", estimate=fine.gaps)
    rough, fine = (replace(nodes, depths=nodes.depths[nodes.depths <= common[-1]],
                           solved=nodes.solved[:, :, nodes.depths <= common[-1]]) for nodes in (rough, fine))
    return rough, fine


def _end(nodes: _Nodes) -> float:
    """Depth up to which the largest gaps are all found, 0 where they are not at the least."""
    lost = np.argwhere(nodes.missing[:, -_FEWEST:])[:, 2]
    count = int(lost.min(initial=len(nodes.depths)))
    return float(nodes.depths[count - 1]) if count else 0.0


def _no_errors(nodes: _Nodes) -> Array:
    """Deviations (gaps - 1, depths, 4): none yet, and infinite where a node about a cell is missing."""
    error_estimate = np.zeros((len(nodes.gaps) - 1, len(nodes.depths), 1 + len(STRAINS)))
    for _, i, j in np.argwhere(nodes.missing).tolist():
        error_estimate[max(i - 1, 0):i + 1, j:j + 2] = np.inf
    return error_estimate


def timed_change(solve: Solve, table: Table, place: Any) -> tuple[Any, float]:
    """What `solve` finds at a place, None where it finds nothing, and the CPU time."""
    return timed(_found, solve, table, place)


def _found(solve: Solve, table: Table, place: Any) -> Any:
    try:
        return solve(table, place)
    except NotConverged:
        return None


def loaded(table: Table, place: Place) -> tuple[Touch, Punch]:
    """The axisymmetric touch of a place, and its punch there; NotConverged where the load paths end before it."""
    diameter, gap, depth = place
    law, body, punch = parts_of(table.shape, diameter)
    touch = touch_from(table, law, body, replace(punch, force_N=None, depth_m=depth))
    if touch is None:
        raise NotConverged("the load paths end before this depth.", estimate=table.depths)
    return touch, replace(punch, x_m=body.radius_m - diameter / 2 - gap, force_N=touch.force_N)


def _on_meshes(table: Table, asked: tuple[Place, bool]) -> tuple[Solved, Solved | None]:
    """The change at a place on the coarse mesh alone, whose errors are not known, and on the finer one where that is
    asked for and found; NotConverged where not even the coarse one is."""
    place, finer = asked
    touch, punch, changes = _changes(table, place)
    rough = next(changes)
    fine = None
    if finer:
        with suppress(NotConverged):
            fine = _with_errors(table, place, touch, punch, rough, next(changes))
    return Solved(rough, 0.0, np.zeros(len(STRAINS))), fine


def finely(table: Table, place: Place) -> Solved:
    """The change at a place, solved as without a table; NotConverged where it is not found."""
    touch, punch, changes = _changes(table, place)
    return _with_errors(table, place, touch, punch, *changes)


def _changes(table: Table, place: Place) -> tuple[Touch, Punch, Iterator[RimCorrection]]:
    """What `loaded` gives, and its changes on the coarse and on the finer mesh."""
    law, body, _ = parts_of(table.shape, place[0])
    touch, punch = loaded(table, place)
    return touch, punch, rim_changes(law, body, punch, (COARSE, FINE), edge_of(table.shape, *place[:2]))


def _with_errors(table: Table, place: Place, touch: Touch, punch: Punch, rough: RimCorrection,
                 change: RimCorrection) -> Solved:
    """A change, its ratios those of the touch, and what it adds to the touch's errors."""
    done = with_signal_errors(with_error(touch, rough, change, parts_of(table.shape, place[0])[1], punch))
    wall = done.wall_contact_m2 / touch.wall_contact_m2 if touch.wall_contact_m2 > 0 else 1.0
    change = replace(change, depth_m=done.depth_m - touch.depth_m, pressure=done.sigma_max_Pa / touch.sigma_max_Pa,
                     area=done.contact_area_m2 / touch.contact_area_m2, wall=wall,
                     fraction_non_elliptic=done.fraction_non_elliptic)
    return Solved(change, done.depth_error - touch.depth_error, done.signal_errors - touch.signal_errors)


def _rows(shape: DimensionlessProblem, radius: Array, nodes: _Nodes) -> tuple[Array, Array]:
    """What a table keeps of changes: fields and numbers (diameters, gaps, depths, ...) at radii about the middle
    diameter, NaN where none was found."""
    diameters = changed_diameters(shape).tolist()
    middle = diameters[len(diameters) // 2]
    made = {(i, j, k): _row(shape, radius, middle, nodes.solved.item(i, j, k), diameters[i], float(nodes.depths[k]))
            for i, j, k in np.argwhere(~nodes.missing).tolist()}
    first = next(iter(made.values()))
    fields, numbers = (np.full((*nodes.solved.shape, len(part)), np.nan) for part in first)
    for place, (parts, own) in made.items():
        fields[place], numbers[place] = parts, own
    return fields, numbers


def _row(shape: DimensionlessProblem, radius: Array, middle: float, one: Solved, diameter: float,
         depth: float) -> tuple[Array, Array]:
    """What a table keeps of a change, its circles carried over to those about the middle diameter."""
    change, field = one.change, one.change.field
    own = carried_over(shape, radius, middle, diameter)
    parts = np.concatenate([field.displacement_m, field.metric - [1, 0, 1], field.normal[..., None] - 1], axis=-1)
    at = np.clip(own, field.radius_m[0], field.radius_m[-1])
    parts = interp1d(field.radius_m, parts, axis=0, assume_sorted=True)(at) / depth
    numbers = [change.depth_m / depth, change.pressure, change.area, change.wall, change.fraction_non_elliptic,
               one.depth_error, *one.signal_errors.tolist()]
    return parts.ravel(), np.array(numbers)


def refined(gaps: Array, depths: Array, fine_gaps: Array, fine_depths: Array, values: Array, finer: Array) -> Array:
    """Values (diameters, gaps, depths, n) with what finer ones at some of the gaps and depths add, cubics through them
    in the logarithms; what is missing next to the rim, NaN, goes on from larger gaps."""
    i, j = np.searchsorted(gaps, fine_gaps), np.searchsorted(depths, fine_depths)
    added = extended(fine_gaps, finer - values[:, i][:, :, j])
    along = np.stack([_spread(len(fine_gaps), rim_table.across_gaps(fine_gaps, at)) for at in gaps.tolist()])
    down = np.stack([_spread(len(fine_depths), rim_table.across_depths(fine_depths, at)) for at in depths.tolist()])
    return extended(gaps, values) + np.einsum("Gg,Ss,dgsn->dGSn", along, down, added, optimize=True)


def _spread(count: int, local: tuple[slice, Array]) -> Array:
    out = np.zeros(count)
    out[local[0]] = local[1]
    return out


def checked(table: Table, rim: RimTable, run: Run) -> RimTable:
    """The table with its deviation from changes solved anew in the middle of every second cell, in each cell the
    largest of those next to it: within a cell deviations differ threefold. NotConverged where more than half of these
    are not found, which leaves the error unknown."""
    cells = [(i, j) for i, j in cells_of(rim) if (i + j) % 2 == 0]
    places = rim_table.middles_of(rim, cells, rim_table.between(table.shape))
    found = list(run(partial(timed_change, finely, table), places))
    off = {cell: None if fresh is None else deviation_from(table, rim, place, fresh)
           for cell, place, (fresh, _) in zip(cells, places, found, strict=True)}
    return replace(rim_table.with_cell_errors(rim, off), cpu_s=rim.cpu_s + sum(cpu for _, cpu in found))


def deviation_from(table: Table, rim: RimTable, place: Place, fresh: Solved) -> Deviation:
    """How far the table is from a change solved anew at a place between its nodes; NotConverged where it does not reach
    it."""
    stored, body = change_from(table.shape, rim, *place), parts_of(table.shape, place[0])[1]
    if stored is None:
        raise NotConverged("the table does not reach this place.", estimate=table.depths)
    touch, punch = loaded(table, place)
    signals = signal_differences(body, punch, touch, stored.change.field, fresh.change.field)
    off = abs(stored.change.depth_m - fresh.change.depth_m) / (place[2] + fresh.change.depth_m)
    return Deviation(off, signals, 0.0)
