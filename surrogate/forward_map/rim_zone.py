"""Where an edge sets in: its share of a touch, 0 as far as a zone begins and 1 from its end on."""

from dataclasses import dataclass

import numpy as np

from surrogate.data.edge_frame import EdgeFrame
from touchcal.arrays import Array, Complex
from touchcal.jit import compiled

Zone = tuple[float, float]  # `EdgeFrame.radial` at which it begins and ends
ORDERS = 3  # orders of the series that do not end; higher ones grow without bound near an edge


@dataclass(frozen=True)
class Zones:
    """Where things set in."""

    learned: Zone  # what is learned of the edge takes the place of the series
    high_end: Zone  # high orders of the series end


DISC = Zones((0.33, 0.40), (0.50, 0.70))


def zones_from(full: float) -> Zones:
    """Zones in proportion to those of a disc, by the distances to the edge, the first of which ends at `full`."""
    scale = (1 - full) / (1 - DISC.learned[1])
    return Zones((1 - scale * (1 - DISC.learned[0]), full),
                 (1 - scale * (1 - DISC.high_end[0]), 1 - scale * (1 - DISC.high_end[1])))


def part_at(radial: Array, zone: Zone) -> Array:
    """(n,) the edge's share at places that are so near (n,)."""
    t = np.clip((radial - zone[0]) / (zone[1] - zone[0]), 0, 1)
    return t**2 * (3 - 2 * t)


def part_slope(frame: EdgeFrame, zone: Zone) -> Array:
    """(n, 2) derivatives of that share by x and y over the radius."""
    t = np.clip((frame.radial - zone[0]) / (zone[1] - zone[0]), 0, 1)
    by_radial = 6 * t * (1 - t) / (zone[1] - zone[0])
    return by_radial[:, None] * np.column_stack([frame.outwards.real, frame.outwards.imag])


def counted(frame: EdgeFrame, orders: int, *ends: tuple[Zone, int]) -> tuple[Array, Array]:
    """Parts (n, orders) of the orders of the series that count, and their slopes (n, orders, 2) by x and y over the
    radius, where in each of some zones those above the first so many end."""
    begin, end, kept = np.array([[*zone, first] for zone, first in ends]).reshape(-1, 3).T
    return _counted(frame.radial, frame.outwards, orders, begin, end, kept)


@compiled
def _counted(radial: Array, outwards: Complex, orders: int, begin: Array, end: Array,
             kept: Array) -> tuple[Array, Array]:
    part, slope = np.ones((len(radial), orders)), np.zeros((len(radial), orders, 2))
    for i in range(len(radial)):
        for k in range(len(begin)):
            t = min(max((radial[i] - begin[k]) / (end[k] - begin[k]), 0.0), 1.0)
            left, by_radial = 1 - t**2 * (3 - 2 * t), 6 * t * (1 - t) / (end[k] - begin[k])
            for n in range(int(kept[k]), orders):
                slope[i, n, 0] = slope[i, n, 0] * left - part[i, n] * by_radial * outwards[i].real
                slope[i, n, 1] = slope[i, n, 1] * left - part[i, n] * by_radial * outwards[i].imag
                part[i, n] *= left
    return part, slope
