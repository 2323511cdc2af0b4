"""The mechanical response of a touch, learned: (d, F, distance to the edge) -> peak and mean stress, area, depth."""

from dataclasses import dataclass

import numpy as np

from surrogate.data.sensor_ring import Ring, radial
from surrogate.forward_map.load_coordinates import light_pressure, to_unknown, touch_slope
from surrogate.statistics import gaussian_process
from surrogate.statistics.gaussian_process import GaussianProcess
from touchcal.arrays import Array

SOFT = 1.06  # distances to the rim are felt as log(SOFT - radius), over the disc's radius


@dataclass(frozen=True)
class Response:
    """One Gaussian process an output, of log(output / F) on (log d, load g, log of the soft distance to the rim) and
    the states of the material."""

    processes: tuple[GaussianProcess, ...]
    p0: float  # pressure p0 of the load, N/mm^2


@dataclass(frozen=True)
class Answer:
    """Outputs at some touches."""

    value: Array  # (n, outputs)
    slope: Array  # (n, outputs, 2 + k) derivatives by d, F and the states of the material
    sd: Array  # (n, outputs) standard deviation of the response itself


def fit(ring: Ring, touch: Array, target: Array, names: tuple[str, ...], material: Array) -> Response:
    """Learn outputs (n, outputs) > 0 from touches (n, 4) and states (n, k) of their materials; ValueError names an
    output that is not positive."""
    for name, column in zip(names, target.T, strict=True):
        if not np.all(column > 0):
            raise ValueError(f"{name} is {column.min():g} in a training row; the forward method learns its logarithm. "
                             "Leave it out with `outputs`, or use `method` trainbr or ridge.")
    p0 = light_pressure(touch)
    inputs = np.column_stack([_inputs(ring, touch, p0), material])
    return Response(tuple(gaussian_process.fit(inputs, np.log(column / touch[:, 3])) for column in target.T), p0)


def _inputs(ring: Ring, touch: Array, p0: float) -> Array:
    gap = np.log(SOFT - radial(ring, touch))
    return np.column_stack([to_unknown(touch, p0)[:, 2:], gap])


def respond(response: Response, ring: Ring, touch: Array, material: Array) -> Answer:
    """Outputs at touches (n, 4) by materials of states (n, k)."""
    unknown, pressed = to_unknown(touch, response.p0), touch[:, 3]
    to_unknown_slope = np.linalg.inv(touch_slope(unknown, response.p0)[:, 2:, 2:])
    inputs = np.column_stack([_inputs(ring, touch, response.p0), material])
    value, slope, sd = [], [], []
    for process in response.processes:
        mean, by_input, variance = gaussian_process.predict(process, inputs)
        by = np.einsum("np,npq->nq", by_input[:, :2], to_unknown_slope)
        by[:, 1] += 1 / pressed
        value.append(pressed * np.exp(mean))
        slope.append(value[-1][:, None] * np.column_stack([by, by_input[:, 3:]]))
        sd.append(value[-1] * np.sqrt(variance + np.median(process.noise)))
    return Answer(np.column_stack(value), np.stack(slope, axis=1), np.column_stack(sd))
