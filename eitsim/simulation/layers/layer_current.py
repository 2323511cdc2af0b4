"""Where current flows through the thickness of a touched layer: along a diameter, in a field that is even far away."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from eitsim.mechanics.solid.section_gradient import order_of, shapes
from eitsim.scene.results import Touch
from eitsim.simulation.layers.layer_section import LayerSection
from touchcal.arrays import Array, Index

TENTHS = np.arange(1, 10) / 10
MOST_RADII = 80  # that are kept
UNEVEN = 0.01  # spread of the potential through the thickness, over its mean, from which a sheet does not do


@dataclass(frozen=True, eq=False)
class LayerCurrent:
    """The current of the first harmonic under a touch, at radii (n,) of the untouched layer."""

    radius_m: Array  # (n,)
    # (9, n) places along r and z, moved, below which a tenth, two tenths ... of the current along the layer flows
    lines_r_m: Array
    lines_z_m: Array
    # (n,) range of the potential through the thickness over its mean: where it is small, no current crosses the layer
    # and it is a sheet
    spread: Array

    @property
    def sheet_from_m(self) -> float:
        """Radius from which the layer is a sheet to UNEVEN, m."""
        uneven = np.flatnonzero(self.spread > UNEVEN)
        return float(self.radius_m[uneven[-1]]) if uneven.size else 0.0


def layer_current(layer: LayerSection, touch: Touch) -> LayerCurrent:
    """The current in the plane through the punch's axis along a far, even current: s grad u of the potential u cos
    theta that is 1 where the volume's solution ends."""
    section = layer.section
    inner, potential = layer.first_potential()
    elements = section.elements[inner]
    value, by_r, by_z = shapes(order_of(section), layer.at[0])
    own, half = potential[elements], layer.half_m[inner]
    slope = np.stack([own @ by_r.T / half[:, :1], own @ by_z.T / half[:, 1:]], axis=-1)
    along = np.einsum("eqi,eqi->eq", layer.sigma[inner][..., 0, :2], slope)
    place = np.einsum("qk,ekd->eqd", value, section.nodes_m[elements])
    moved = place + np.einsum("qk,ekd->eqd", value, section.displacement_m[elements])
    slot, share, _ = layer.columns
    current, u = (along * share[inner]).ravel(), (own @ value.T).ravel()
    parts = [_column(rows, current, place.reshape(-1, 2), moved.reshape(-1, 2), u)
             for rows in _rows(slot[inner].ravel().astype(np.intp))]
    kept = np.unique(np.linspace(0, len(parts) - 1, min(len(parts), MOST_RADII)).round().astype(int))
    radius, lines, spread = zip(*(parts[i] for i in kept), strict=True)
    each = np.stack(lines)
    return LayerCurrent(np.array(radius), each[..., 0].T, each[..., 1].T, np.array(spread))


def current_blocks(layers: Sequence[LayerSection], touches: Sequence[Touch]) -> list[dict[str, Any]]:
    """The currents of touches as plain JSON values, mm."""
    found = [layer_current(layer, touch) for layer, touch in zip(layers, touches, strict=True)]
    return [{"radius_mm": (1e3 * one.radius_m).tolist(), "lines_r_mm": (1e3 * one.lines_r_m).tolist(),
             "lines_z_mm": (1e3 * one.lines_z_m).tolist(), "spread": one.spread.tolist(),
             "sheet_from_mm": 1e3 * one.sheet_from_m} for one in found]


def _rows(slot: Index) -> list[Index]:
    """Points of each radius, increasing."""
    order = np.argsort(slot, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(slot[order])) + 1)


def _column(rows: Index, current: Array, place: Array, moved: Array, potential: Array) -> tuple[float, Array, float]:
    """Radius, places (9, 2) that part the current into tenths, and spread of the potential, of a radius's points."""
    upwards = rows[np.argsort(place[rows, 1])]
    below = np.cumsum(current[upwards]) - current[upwards] / 2
    part, own = below / current[upwards].sum(), potential[upwards]
    return (float(place[rows[0], 0]), np.stack([np.interp(TENTHS, part, moved[upwards, i]) for i in (0, 1)], axis=-1),
            float(np.ptp(own) / abs(own.mean())))
