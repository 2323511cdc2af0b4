"""Solving what a few laws change of a table's load paths, and how far weighted means are from other laws' touches."""

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from functools import partial, reduce

import numpy as np
from scipy.interpolate import PchipInterpolator

from eitsim.mechanics.load_paths.build_rim_table import Place, deviation_from, finely, timed_change
from eitsim.mechanics.load_paths.build_table import Run, compared, course_at, tabulated, timed
from eitsim.mechanics.load_paths.law_family import Family, places, table_of
from eitsim.mechanics.load_paths.load_path import NUMBERS, Deviation, Node, alongside, course_of, first_node
from eitsim.mechanics.load_paths.reduced_basis import ReducedBasis
from eitsim.mechanics.load_paths.rim_table import cells_of, middles_of, with_cell_errors
from eitsim.mechanics.load_paths.table import as_deep_as, of_law, parts_of, state
from eitsim.mechanics.load_paths.types import DimensionlessProblem, Table
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Touches by which the error is found, of each law at each of the diameters.
_CHECKS = 6
# Of the cells of gap and depth, every which gap and depth the farthest law is solved at for the error.
_EVERY = (3, 4)


def build_family(table: Table, span: ReducedBasis, run: Run = map) -> Family:
    """Solve the load paths of a span's laws but its central one's, which the table holds; `run` maps a function over
    laws and diameters, possibly in other processes. NotConverged where a path is found at too few depths, or no touch
    for the error."""
    shape = table.shape
    some, depths = places(table)
    diameters = [shape.solved[i] for i in some]
    pressures = {d: table.values[i, depths, -len(NUMBERS)] for i, d in zip(some, diameters, strict=True)}
    solved = list(run(partial(timed, _path, table.depths[depths], pressures),
                      [(of_law(shape, law), d) for law in span.chosen for d in diameters]))
    paths = [path for path, _ in solved]
    common = min((len(values) for values, _ in paths), default=len(depths))
    if common < len(depths):
        table = as_deep_as(table, depths[common - 1] + 1)
        depths = places(table)[1]
    values, slopes = (np.array([path[part][:len(depths)] for path in paths]).reshape(
        len(span.chosen), len(some), len(depths), table.values.shape[-1]) for part in range(2))
    spent = table.cpu_s + sum(cpu for _, cpu in solved)
    family = Family(replace(table, cpu_s=spent), span, *_changes(table, values, slopes))
    return family if not span.held_out else _checked(family, run)


def _path(depths: Array, pressures: Mapping[float, Array],
          which: tuple[DimensionlessProblem, float]) -> tuple[Array, Array]:
    shape, diameter = which
    nodes = list(alongside(course_at(shape, diameter), depths.tolist(), pressures[diameter].tolist()))
    return tabulated(nodes, depths[:len(nodes)])[:2]


def _changes(table: Table, values: Array, slopes: Array) -> tuple[Array, Array]:
    """Differences of values and slopes to the table's; slopes of numbers but the pressure's are those of monotone
    cubics through the differences."""
    some, depths = places(table)
    at = np.ix_(some, depths)
    values, slopes = values - table.values[at], slopes - table.slopes[at]
    rest = 1 - len(NUMBERS)
    if len(values):
        slopes[..., rest:] = PchipInterpolator(table.depths[depths], values[..., rest:], axis=2).derivative()(
            table.depths[depths])
    return values, slopes


def _checked(family: Family, run: Run) -> Family:
    table, laws = family.table, family.span.held_out
    depths = (table.depths[1:] + table.depths[:-1]) / 2
    depths = depths[np.unique(np.linspace(0, len(depths) - 1, _CHECKS).round().astype(int))]
    pressures = {d: _pressures(table, d, depths) for d in _diameters(table)}
    found = list(run(partial(timed, _fresh),
                     [(of_law(table.shape, law), d, p) for law in laws for d, p in pressures.items()]))
    nodes = iter(nodes for nodes, _ in found)
    tables = [compared(_of(family, law), {d: next(nodes) for d in pressures}) for law in laws]
    error = reduce(Deviation.at_least, [own.error for own in tables], table.error)
    return replace(family, table=replace(
        table, error=error, checks=table.checks + sum(own.checks for own in tables),
        cpu_s=table.cpu_s + sum(cpu for _, cpu in found)))


def _pressures(table: Table, diameter: float, depths: Array) -> tuple[float, ...]:
    """Mean pressures of the central law at depths, without those where its paths end."""
    found = (state(table, diameter, depth=depth) for depth in depths.tolist())
    return tuple(one.number["mean_pressure"] for one in found if one is not None)


def _diameters(table: Table) -> list[float]:
    """Diameters at which other laws are solved for the error: between those solved, or else those where changes are
    not."""
    if table.shape.spans:
        return list(table.shape.held_out)
    some = places(table)[0]
    rest = [d for i, d in enumerate(table.shape.solved) if i not in some]
    return (rest or list(table.shape.solved))[:2]


def _fresh(which: tuple[DimensionlessProblem, float, tuple[float, ...]]) -> list[Node]:
    """Nodes of a law and diameter under mean pressures, each from rest, those left out that are not found."""
    shape, diameter, pressures = which
    course, nodes = course_of(*parts_of(shape, diameter)), []
    for pressure in pressures:
        with contextlib.suppress(NotConverged):
            nodes.append(first_node(course, pressure))
    return nodes


def _of(family: Family, law: Law) -> Table:
    own = table_of(family, law)
    assert own is not None
    return own


def with_rim(family: Family, table: Table, run: Run = map) -> Family:
    """The family with what the rim changes of the central law's touches, from its table, taken over at equal depth; in
    each cell of gap and depth its deviation is at least that at the law that is farthest off in the nearest cells.
    NotConverged where more than half of the changes that give it are not found."""
    rim = table.rim
    assert rim is not None
    family = replace(family, table=replace(family.table, rim=rim))
    if not family.span.held_out:
        return family
    own = _of(family, family.span.held_out[0])
    cells = [(i, j) for i, j in cells_of(rim) if i % _EVERY[0] == 0 and j % _EVERY[1] == 1]
    found = list(run(partial(timed_change, _deviation, own), middles_of(rim, cells, rim.diameters.tolist())))
    rim = with_cell_errors(rim, {cell: off for cell, (off, _) in zip(cells, found, strict=True)})
    spent = rim.cpu_s + sum(cpu for _, cpu in found)
    return replace(family, table=replace(family.table, rim=replace(rim, cpu_s=spent)))


def _deviation(table: Table, place: Place) -> Deviation:
    """How far a table is from the rim's change of its touch solved anew."""
    assert table.rim is not None
    return deviation_from(table, table.rim, place, finely(table, place))
