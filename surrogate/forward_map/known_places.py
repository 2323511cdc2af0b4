"""Which touches a forward map is learned from and holds for: how near to edges they lie, and how large they are.

On a disc all places are known. On a skin with an outline those are that
no edge is near to, and those near one straight edge alone that leave the fields' series enough room.
"""

from dataclasses import dataclass

import numpy as np

from surrogate.data.edge_frame import EdgeFrame, edge_frame
from surrogate.data.outputs import ROUNDING
from surrogate.data.sensor_ring import Ring, place, radial
from surrogate.data.skin_edges import by_one_straight_edge
from surrogate.forward_map import polarization, rim_zone
from surrogate.forward_map.rim_zone import Zones
from touchcal.arrays import Array, Mask

MIN_ROWS = 14  # fewest training rows that the map is learned from
# Half a punch's diameter over its distance to an edge up to which touches near one are learned: five orders of the
# fields' series about it leave its fifth power.
CONVERGES = 0.55
INNER = 0.4  # part of the touches that no edge is near to which teach the series where nearer ones teach, too
ONE_D = 5e-5  # part of a diameter by which another one is still that, where all training punches have one


@dataclass(frozen=True)
class NearEdges:
    """How near to the edges of an outline, as `EdgeFrame.radial`, touches come that no edge is near to, and those that
    teach the series; what is learned of one edge has taken over from there."""

    far: float
    inner: float


def near_edges_of(near: Array, near_edge: Mask) -> NearEdges:
    """Of touches that are so near (n,) to an edge, where those near one (n,) teach, too; the farthest of all that no
    edge is near to where none does."""
    far = near[~near_edge]
    return NearEdges(float(far.max()), float(np.quantile(far, INNER) if np.any(near_edge) else far.max()))


def zones_of(ring: Ring, inner: float) -> Zones:
    """Zones of a disc, or of a skin with an outline whose series is learned from touches as near as `inner`."""
    return rim_zone.DISC if ring.sheet is None else rim_zone.zones_from(inner)


def learned_within(ring: Ring, near: Array, zones: Zones, rim: bool) -> float:
    """How near to the edge, as touches are (n,), the series is learned: as far as the interior reaches, and on a disc
    as far as high orders go where nothing is learned of the rim; at least the innermost MIN_ROWS."""
    reach = zones.high_end[0] if ring.sheet is None and not rim else zones.learned[1]
    return max(reach, float(np.sort(near)[MIN_ROWS - 1]))


def gap(ring: Ring, unknown: Array) -> Array:
    """(n,) gap between punch and rim over the disc's radius."""
    return gap_of(ring, edge_frame(ring, place(ring, unknown)), unknown)


def gap_of(ring: Ring, frame: EdgeFrame, unknown: Array) -> Array:
    """As `gap`, of touches in a frame."""
    return 1 - frame.radial - polarization.half_width(ring, unknown[:, 2])


def extent(ring: Ring, touch: Array) -> Array:
    """(n, 3) radius, d and F of touches (n, 4); with an outline the radius is how much nearer to the edges they are
    than the farthest place."""
    radius = np.hypot(touch[:, 0], touch[:, 1]) if ring.sheet is None else ring.radius_mm * radial(ring, touch)
    return np.column_stack([radius, touch[:, 2:]])


def bounds_of(ring: Ring, touch: Array) -> Array:
    """(2, 3) lowest and highest (radius, d, F) of touches (n, 4), widened twice as far as n uniform draws end inside
    their range, span / n; not towards the edges of a skin with an outline, where touches of another kind may follow."""
    reached = extent(ring, touch)
    lowest, highest = reached.min(axis=0), reached.max(axis=0)
    slack = 2 * (highest - lowest) / len(touch)
    if ring.sheet is not None:
        slack[0] = 0.0
    return np.array([np.maximum(lowest - slack, lowest / 2), highest + slack])


def within(ring: Ring, bounds: Array, edges: NearEdges | None, touch: Array) -> Mask:
    """(n,) whether places of touches (n, 4) are known, and radius, d and F lie within the bounds (2, 3) of the training
    touches, rounding aside: a range may be one diameter."""
    reached, (lowest, highest) = extent(ring, touch), bounds
    slack = np.array([ROUNDING, ROUNDING if highest[1] > lowest[1] else ONE_D, ROUNDING]) * highest
    return known_place(ring, float(highest[0]), edges, touch) & np.all(
        (reached >= np.r_[0.0, lowest[1:]] - slack) & (reached <= highest + slack), axis=1)


def known_place(ring: Ring, reach_mm: float, edges: NearEdges | None, touch: Array) -> Mask:
    """(n,) whether no edge is near to touches (n, 4), or one straight edge that is no nearer than to the training
    touches, whose largest radius is `reach_mm`, and leaves the series enough room; all on a disc."""
    if ring.sheet is None:
        return np.ones(len(touch), bool)
    near, nearest = radial(ring, touch), reach_mm / ring.radius_mm + ROUNDING
    if edges is None:
        return near <= nearest
    return (near <= edges.far + ROUNDING) | (
        (near <= nearest) & by_one_edge(ring, touch, edges.far) & series_suffices(ring, touch))


def series_suffices(ring: Ring, touch: Array) -> Mask:
    """(n,) whether the fields' series about the punches of touches (n, 4) converge so fast that few orders do."""
    return touch[:, 2] / 2 <= CONVERGES * ring.radius_mm * (1 - radial(ring, touch))


def by_one_edge(ring: Ring, touch: Array, far: float) -> Mask:
    """(n,) whether touches on a skin with an outline that begin with x and y in mm have but one straight edge as near
    as touches come that no edge is near to."""
    assert ring.sheet is not None
    return by_one_straight_edge(touch[:, :2], ring.sheet.start_mm, ring.sheet.end_mm, alone_mm(ring, far))


def alone_mm(ring: Ring, far: float) -> float:
    """Distance to an edge of an outline, mm, within which touches are learned near one straight edge alone."""
    return (1 - far) * ring.radius_mm
