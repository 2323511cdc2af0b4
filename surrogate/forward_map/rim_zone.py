"""Where an edge sets in: its share of a touch, 0 as far as a zone begins and 1 from its end on."""

from dataclasses import dataclass

import numpy as np

from surrogate.data.edge_frame import EdgeFrame
from touchcal.arrays import Array

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
    t = _way(radial, zone)
    return t**2 * (3 - 2 * t)


def part_slope(frame: EdgeFrame, zone: Zone) -> Array:
    """(n, 2) derivatives of that share by x and y over the radius."""
    t = _way(frame.radial, zone)
    by_radial, slope = 6 * t * (1 - t) / (zone[1] - zone[0]), np.empty((len(t), 2))
    slope[:, 0], slope[:, 1] = by_radial * frame.outwards.real, by_radial * frame.outwards.imag
    return slope


def _way(radial: Array, zone: Zone) -> Array:
    return np.minimum(np.maximum((radial - zone[0]) / (zone[1] - zone[0]), 0.0), 1.0)


def counted(frame: EdgeFrame, orders: int, *ends: tuple[Zone, int]) -> tuple[Array, Array]:
    """Parts (n, orders) of the orders of the series that count, and their slopes (n, orders, 2) by x and y over the
    radius, where in each of some zones those above the first so many end."""
    part, slope = np.ones((len(frame.radial), orders)), np.zeros((len(frame.radial), orders, 2))
    for zone, kept in ends:
        left, by_place = 1 - part_at(frame.radial, zone)[:, None], part_slope(frame, zone)[:, None]
        slope[:, kept:] *= left[..., None]
        slope[:, kept:] -= part[:, kept:, None] * by_place
        part[:, kept:] *= left
    return part, slope
