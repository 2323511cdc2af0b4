"""The signal of a touch, its derivatives and what its discrepancies make, as columns of one table, in one loop."""

import numpy as np

from surrogate.forward_map.touch_strengths import TouchStrengths
from touchcal.arrays import Array, Index
from touchcal.jit import compiled

TOUCH = 5  # columns of the signal and of its derivatives by (x, y, log d, g)


def columns(base: Array, moved: Array, found: TouchStrengths, discrepancy: Array, rows: Index,
            added: tuple[Array, Array], scale: Array, shift: Array, radius_mm: float) -> Array:
    """(n, readings, TOUCH + orders + 3 + k) signal, its derivatives, and those by the discrepancies: along each
    strength, along the signal, by x, by y, and along each state of the material.

    base, moved: as `multipole_series.signals`; discrepancy (n, orders): of the strengths, over their size; added: what
    an edge adds to signals (m, readings) and derivatives (m, readings, 4) of some touches; rows (n,): which of these
    each touch is, -1 of none; scale, shift (n,): standard deviations of the size of the signal, and of the place, mm.
    """
    return _columns(base, moved, found.value, found.slope, found.by_card, found.size, found.size_by_card,
                    np.ascontiguousarray(discrepancy), rows, *added, scale, shift, radius_mm)


@compiled
def _columns(base, moved, value, slope, by_card, size, size_by_card, discrepancy, rows, added, added_slope, scale,
             shift, radius_mm):
    count, readings, orders = base.shape
    materials = by_card.shape[2]
    own = TOUCH + orders
    out = np.zeros((count, readings, own + 3 + materials))
    for i in range(count):
        for r in range(readings):
            row = out[i, r]
            for n in range(orders):
                part = base[i, r, n]
                row[0] += part * value[i, n]
                for q in range(4):
                    row[1 + q] += part * slope[i, n, q]
                row[TOUCH + n] = part * size[i] * discrepancy[i, n]
                for k in range(materials):
                    row[own + 3 + k] += part * by_card[i, n, k]
            for q in range(2):
                row[1 + q] += moved[i, r, q] / radius_mm
            if rows[i] >= 0:
                row[0] += added[rows[i], r]
                for q in range(4):
                    row[1 + q] += added_slope[rows[i], r, q]
                for k in range(materials):
                    row[own + 3 + k] += added[rows[i], r] * size_by_card[k]
            row[own] = row[0] * scale[i]
            row[own + 1], row[own + 2] = row[1] * shift[i], row[2] * shift[i]
    return out
