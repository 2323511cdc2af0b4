"""The mechanical response of a touch, learned: (d, F) -> peak and mean stress, contact area, depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surrogate import gaussian_process
from surrogate.gaussian_process import GaussianProcess
from surrogate.loading import light_pressure, to_unknown, touch_slope

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """One Gaussian process an output, of log(output / F) on (log d, load g)."""

    processes: tuple[GaussianProcess, ...]
    # pressure p0 of the load, N/mm^2
    p0: float


def learn(touch: Array, target: Array, names: tuple[str, ...]) -> Response:
    """Learn outputs (n, k) > 0 from touches (n, 4); ValueError names an output that is not positive."""
    for name, column in zip(names, target.T, strict=True):
        if not np.all(column > 0):
            raise ValueError(f"{name} is {column.min():g} in a training row; the forward method learns its logarithm. "
                             "Leave it out with --outputs, or use --method trainbr or ridge.")
    p0 = light_pressure(touch)
    inputs = to_unknown(touch, p0)[:, 2:]
    return Response(tuple(gaussian_process.fit(inputs, np.log(column / touch[:, 3])) for column in target.T), p0)


def respond(response: Response, touch: Array, covariance: Array) -> tuple[Array, Array]:
    """Outputs (n, k) and their standard deviations at touches (n, 4) with a covariance (n, 2, 2) of (d, F)."""
    unknown, pressed = to_unknown(touch, response.p0), touch[:, 3]
    to_unknown_slope = np.linalg.inv(touch_slope(unknown, response.p0)[:, 2:, 2:])
    value, sd = [], []
    for process in response.processes:
        mean, by_unknown, variance = gaussian_process.predict(process, unknown[:, 2:])
        slope = np.einsum("np,npq->nq", by_unknown, to_unknown_slope)
        slope[:, 1] += 1 / pressed
        carried = np.einsum("np,npq,nq->n", slope, covariance, slope)
        value.append(pressed * np.exp(mean))
        sd.append(value[-1] * np.sqrt(variance + np.median(process.noise) + carried))
    return np.column_stack(value), np.column_stack(sd)
