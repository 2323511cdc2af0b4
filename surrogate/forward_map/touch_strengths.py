"""Multipole strengths of touches by what was learned of them, with their derivatives."""

from dataclasses import dataclass

import numpy as np

from surrogate.data.edge_frame import EdgeFrame
from surrogate.forward_map.strength_size import PUNCH, Size
from surrogate.statistics import gaussian_process
from surrogate.statistics.gaussian_process import Together
from touchcal.arrays import Array
from touchcal.jit import compiled

TOUCH_INPUTS = 3  # inputs of the strengths that the touch gives: log d, g, |z0|^2


@dataclass(frozen=True)
class TouchStrengths:
    """Strengths of touches given as (x, y, log d, g)."""

    value: Array  # (n, orders) p_n, V
    slope: Array  # (n, orders, 4) derivatives by (x, y, log d, g)
    by_card: Array  # (n, orders, k) derivatives by the material
    size: Array  # (n,) V
    size_slope: Array  # (n, 4) derivatives by (x, y, log d, g)
    size_by_card: Array  # (k,) derivatives of its logarithm by the material


def inputs_of(near: Array, interior: float, unknown: Array, material: Array) -> Array:
    """Inputs of the strengths at touches (n, 4) that are so near (n,) to an edge."""
    inputs = np.empty((len(unknown), TOUCH_INPUTS + material.shape[1]))
    inputs[:, :2], inputs[:, 2] = unknown[:, 2:], np.minimum(near, interior) ** 2
    inputs[:, TOUCH_INPUTS:] = material
    return inputs


def at(size: Size, over_size: Together, p0: float, interior: float, radius_mm: float, frame: EdgeFrame,
       unknown: Array, material: Array) -> TouchStrengths:
    """Strengths of touches (n, 4) in a frame by materials (n, k)."""
    inputs = inputs_of(frame.radial, interior, unknown, material)
    over, gradient = gaussian_process.means(over_size, inputs)
    # of one layout, so that the loop is compiled once
    over, gradient = np.ascontiguousarray(over), np.ascontiguousarray(gradient)
    return TouchStrengths(*_times_size(inputs, size.centre, size.weights, size.curvature, p0, over, gradient,
                                       frame.radial, frame.outwards, interior, radius_mm))


@compiled
def _times_size(inputs, centre, weights, curvature, p0, over, gradient, radial, outwards, interior, radius_mm):
    count, orders, known = *over.shape, inputs.shape[1]
    value, slope = np.empty((count, orders)), np.empty((count, orders, 4))
    by_card = np.empty((count, orders, known - TOUCH_INPUTS))
    size, size_slope, by_log = np.empty(count), np.empty((count, 4)), weights[1:1 + known].copy()
    for i in range(count):
        log_size = weights[0]
        for q in range(known):
            off, by_log[q] = inputs[i, q] - centre[q], weights[1 + q]
            log_size += off * weights[1 + q]
            if q < PUNCH:
                for p in range(PUNCH):
                    bent = curvature[q, p] * (inputs[i, p] - centre[p])
                    by_log[q] += bent
                    log_size += 0.5 * off * bent
        load = inputs[i, 1]
        size[i] = np.exp(log_size + 2 * inputs[i, 0]) * p0 * np.sinh(load)
        by_log[0] += 2.0
        by_log[1] += 1 / np.tanh(load)
        felt = 2 / radius_mm * radial[i] if radial[i] < interior else 0.0
        by_x, by_y = felt * outwards[i].real, felt * outwards[i].imag
        size_slope[i, 0], size_slope[i, 1] = by_x * by_log[2] * size[i], by_y * by_log[2] * size[i]
        size_slope[i, 2], size_slope[i, 3] = by_log[0] * size[i], by_log[1] * size[i]
        for n in range(orders):
            value[i, n] = over[i, n] * size[i]
            for q in range(known):
                along = (over[i, n] * by_log[q] + gradient[i, n, q]) * size[i]
                if q < 2:
                    slope[i, n, 2 + q] = along
                elif q == 2:
                    slope[i, n, 0], slope[i, n, 1] = along * by_x, along * by_y
                else:
                    by_card[i, n, q - TOUCH_INPUTS] = along
    return value, slope, by_card, size, size_slope, weights[1 + TOUCH_INPUTS:1 + known].copy()
