"""What the rim changes of a touch, tabulated over diameter, gap and depth, and added to touches from load paths.

A change is known at a few gaps between the punch's edge and the rim and at a few depths of the axisymmetric touch, and
divided by the depth, in proportion to which it starts; between them it is cubic in the logarithm of gap and depth. How
far it is off is known for each cell between neighbouring gaps and depths.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.mechanics.load_paths.load_path import Deviation
from eitsim.mechanics.load_paths.table import carried_over, edge_of, lagrange_weights
from eitsim.mechanics.load_paths.types import DimensionlessProblem, RimTable, Table
from eitsim.mechanics.rim.correction import RimCorrection, apply_correction, within_face
from eitsim.scene.nearest_edge import STRAIGHT_M, NearestEdge
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import STRAINS, Body, Punch, rim_gap_m
from touchcal.arrays import Array
from touchcal.errors import NotConverged

# Most diameters at which changes are solved.
_DIAMETERS = 3
# Added to gaps and depths before the logarithm is taken.
_GAP_SHIFT, _DEPTH_SHIFT = 0.2, 0.1
# Nodes of a local cubic.
LOCAL = 4
# Parts of a field's sample: displacement, metric, normal.
_PARTS = 7
# Times the error of a change solved anew, by its own mesh, up to which the table serves: that error is estimated by a
# coarser mesh, and known no better.
_KNOWN_TO = 2.0
# positions of a cell among gaps and among depths
Cell = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Solved:
    """A change by the rim, lengths over the thickness, and the errors that the rim's own mesh makes."""

    change: RimCorrection
    depth_error: float
    signal_errors: Array  # (3,) by scene.STRAINS


def changed_diameters(shape: DimensionlessProblem) -> Array:
    """Diameters at which changes are solved, over the thickness: of a choice, some whose load paths there are."""
    diameters = np.array(shape.diameters)
    if shape.spans:
        return np.geomspace(diameters[0], diameters[-1], _DIAMETERS)
    return diameters[np.linspace(0, len(diameters) - 1, min(len(diameters), _DIAMETERS)).round().astype(int)]


def between(shape: DimensionlessProblem) -> list[float]:
    """Diameters at which a table of changes is checked: in the middle between those solved, or of a choice, those where
    it is not solved."""
    solved = changed_diameters(shape)
    if shape.spans:
        return np.sqrt(solved[1:] * solved[:-1]).tolist()
    return [d for d in shape.diameters if d not in solved] or solved.tolist()


def change_from(shape: DimensionlessProblem, rim: RimTable, diameter: float, gap: float, depth: float) -> Solved | None:
    """The change of an axisymmetric touch of a depth, all over the thickness; None where the table does not reach.
    Below the least depth the change goes on in proportion to the depth."""
    off = deviation_at(rim, gap, depth)
    if off is None:
        return None
    w_d = lagrange_weights(np.log(rim.diameters), np.log(diameter))
    i, w_g = across_gaps(rim.gaps, gap)
    j, w_s = across_depths(rim.depths, max(depth, rim.depths[0]))
    weight = w_d[:, None, None] * w_g[:, None] * w_s
    fields, numbers = (np.tensordot(weight, part[:, i, j], 3) for part in (rim.fields, rim.numbers))
    parts = fields.reshape(len(rim.radius), len(rim.share), _PARTS) * depth
    base = float(rim.diameters[len(rim.diameters) // 2])
    edge = edge_of(shape, diameter, gap)
    field = RimField(carried_over(shape, rim.radius, base, diameter), rim.share, parts[..., :3],
                     parts[..., 3:6] + [1, 0, 1], parts[..., 6] + 1, edge.disc, edge.offset, error_estimate=off)
    added, pressure, area, wall, lost, depth_error, *signal_errors = numbers.tolist()
    return Solved(RimCorrection(field, added * depth, pressure, area, max(wall, 0.0), min(max(lost, 0.0), 1.0), ()),
                  max(depth_error, 0.0), np.maximum(signal_errors, 0.0))


def deviation_at(rim: RimTable, gap: float, depth: float) -> Array | None:
    """(4,) how far depth and signals may be off at a gap and a depth, over the thickness; None where they are solved
    anew."""
    if not rim.gaps[0] <= gap <= rim.gaps[-1] or depth > rim.depths[-1]:
        return None
    i = min(int(np.searchsorted(rim.gaps, gap, side="right")), len(rim.gaps) - 1) - 1
    off = rim.error_estimate[i, np.searchsorted(rim.depths, depth)]
    return off if np.isfinite(off).all() else None


def within(rim: RimTable, signal: float, strain: str) -> RimTable:
    """The table with the cells alone about which the signals, of a skin driven by that strain, were measured no farther
    off, or no farther than twice what changes solved anew there are by their own mesh."""
    which = STRAINS.index(strain)
    measured = rim.measured[..., 1 + which]
    far = measured > np.maximum(signal, _KNOWN_TO * _own_errors(rim, which))
    places, cells = np.argwhere(np.isfinite(measured)), np.argwhere(_served(rim))
    kept = rim.error_estimate.copy()
    kept[tuple(cells[(_about(places, cells) & far[tuple(places.T)]).any(axis=1)].T)] = np.inf
    return replace(rim, error_estimate=kept)


def _own_errors(rim: RimTable, which: int) -> Array:
    """(gaps - 1, depths) signal errors of the cells' changes by their own mesh: means over the diameters, and the
    largest of the nodes, as errors are the largest of the cells next to each."""
    at = rim.numbers[..., which - len(STRAINS)].mean(axis=0)
    cells = np.maximum(at[1:], at[:-1])
    return np.maximum(cells, np.column_stack([cells[:, :1], cells[:, :-1]]))


def across_gaps(gaps: Array, at: float) -> tuple[slice, Array]:
    """Gaps next to one, and the weights of a cubic through them."""
    return _local(np.log(gaps + _GAP_SHIFT), np.log(at + _GAP_SHIFT))


def extended(gaps: Array, values: Array) -> Array:
    """Values (diameters, gaps, depths, n) with those of a line over the gap up to its last NaN on the parabola through
    the next three gaps."""
    out, nodes = values.copy(), np.log(gaps + _GAP_SHIFT)
    for i, last, j in np.argwhere(np.isnan(values[..., 0])).tolist():
        chosen = slice(last + 1, last + 4)
        for k in range(last + 1):
            out[i, k, j] = lagrange_weights(nodes[chosen], nodes[k]) @ values[i, chosen, j]
    return out


def middle_gaps(gaps: Array) -> Array:
    """Gaps in the middle between neighbouring ones, as cubics count it."""
    return np.sqrt((gaps[1:] + _GAP_SHIFT) * (gaps[:-1] + _GAP_SHIFT)) - _GAP_SHIFT


def middle_depths(depths: Array) -> Array:
    """Depths in the middle of each cell, as cubics count it; the first one half the least depth."""
    between = np.sqrt((depths[1:] + _DEPTH_SHIFT) * (depths[:-1] + _DEPTH_SHIFT)) - _DEPTH_SHIFT
    return np.array([depths[0] / 2, *between])


def across_depths(depths: Array, at: float) -> tuple[slice, Array]:
    """Depths next to one, and the weights of a cubic through them."""
    return _local(np.log(depths + _DEPTH_SHIFT), np.log(at + _DEPTH_SHIFT))


def _local(nodes: Array, at: float) -> tuple[slice, Array]:
    """The nearest four nodes, or all where there are fewer, and the weights of the polynomial through them."""
    count = min(LOCAL, len(nodes))
    first = int(np.clip(np.searchsorted(nodes, at) - count // 2, 0, len(nodes) - count))
    chosen = slice(first, first + count)
    return chosen, lagrange_weights(nodes[chosen], at)


def near_rim_from(table: Table, touch: Touch, body: Body, punch: Punch) -> Touch | None:
    """An axisymmetric touch with the rim's change from a table; None where the table does not reach, or is of straight
    edges and the nearest one is not."""
    unit = body.thickness_m
    edge = served_edge(table.shape, body, punch)
    if table.rim is None or punch.force_N is None or edge is None:
        return None
    gap = rim_gap_m(body, punch)
    found = change_from(table.shape, table.rim, punch.diameter_m / unit, gap / unit, touch.depth_m / unit)
    if found is None:
        return None
    field = found.change.field
    field = replace(field, radius_m=field.radius_m * unit, displacement_m=field.displacement_m * unit,
                    disc_m=edge.disc_m, offset_m=edge.offset_m, towards=edge.towards if table.shape.straight else None)
    with_rim = apply_correction(touch, replace(found.change, field=field, depth_m=found.change.depth_m * unit))
    return replace(within_face(with_rim, punch), depth_error=touch.depth_error + found.depth_error,
                   signal_errors=touch.signal_errors + found.signal_errors)


def served_edge(shape: DimensionlessProblem, body: Body, punch: Punch) -> NearestEdge | None:
    """The edge next to a punch where a table is made for such: the rim of its disc, or a straight one."""
    edge = body.edge.nearest((punch.x_m, punch.y_m))
    return edge if shape.straight == (edge.disc_m == STRAIGHT_M) else None


def cells_of(rim: RimTable) -> list[Cell]:
    """The cells whose touches are served."""
    return [(i, j) for i, j in np.argwhere(_served(rim)).tolist()]


def _served(rim: RimTable) -> NDArray[np.bool_]:
    """(gaps - 1, depths) whether a cell's touches are served."""
    return np.array(np.isfinite(rim.error_estimate).all(axis=-1))


def middles_of(rim: RimTable, cells: Sequence[Cell], diameters: Sequence[float]) -> list[tuple[float, float, float]]:
    """Diameter, gap and depth in the middle of cells, the diameters by turns."""
    gaps, depths = middle_gaps(rim.gaps), middle_depths(rim.depths)
    return [(diameters[(i // 2 + j // 2) % len(diameters)], float(gaps[i]), float(depths[j])) for i, j in cells]


def with_cell_errors(rim: RimTable, checked: Mapping[Cell, Deviation | None]) -> RimTable:
    """The table with its deviation at least the largest of the checked cells next to each, itself among them, or of the
    nearest where these are farther away; cells at which None was found are not served. NotConverged where more than
    half were not found, which leaves the error unknown."""
    found = {cell: off for cell, off in checked.items() if off is not None}
    if 2 * len(found) < len(checked) or not found:
        raise NotConverged(f"{len(checked) - len(found)} of {len(checked)} changes by the rim that give the error of "
                           "their table were not found; touches near the rim have to be solved one by one.",
                           estimate=rim.gaps)
    places, off = np.array(list(found)), np.array([[one.depth, *one.signals] for one in found.values()])
    error_estimate, measured = rim.error_estimate.copy(), rim.measured.copy()
    measured[tuple(places.T)] = off
    for cell in cells_of(rim):
        near = off[_about(places, cell)].max(axis=0)
        error_estimate[cell] = np.inf if checked.get(cell, near) is None else np.maximum(error_estimate[cell], near)
    return replace(rim, error_estimate=error_estimate, measured=measured)


def _about(places: NDArray[np.integer], cells: ArrayLike) -> NDArray[np.bool_]:
    """(..., n) which of some cells (n, 2) lie next to cells (..., 2), themselves among them, or are the nearest where
    all are farther away."""
    separation: Array = np.abs(places - np.asarray(cells)[..., None, :]).max(axis=-1)
    return separation <= np.maximum(separation.min(axis=-1, keepdims=True), 1)
