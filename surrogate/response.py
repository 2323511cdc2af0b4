"""The mechanical response of a touch, learned: (d, F) -> peak and mean stress, contact area, depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surrogate import gaussian_process
from surrogate.gaussian_process import GaussianProcess

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """One Gaussian process an output, of log output on (log d, log F)."""

    processes: tuple[GaussianProcess, ...]


def learn(touch: Array, target: Array, names: tuple[str, ...]) -> Response:
    """Learn outputs (n, k) > 0 from touches (n, 4); ValueError names an output that is not positive."""
    for name, column in zip(names, target.T, strict=True):
        if not np.all(column > 0):
            raise ValueError(f"{name} is {column.min():g} in a training row; the forward method learns its logarithm. "
                             "Leave it out with --outputs, or use --method trainbr or ridge.")
    inputs = np.log(touch[:, 2:])
    return Response(tuple(gaussian_process.fit(inputs, np.log(column)) for column in target.T))


def respond(response: Response, touch: Array, covariance: Array) -> tuple[Array, Array]:
    """Outputs (n, k) and their standard deviations at touches (n, 4) with a covariance (n, 2, 2) of (log d, log F)."""
    inputs = np.log(touch[:, 2:])
    value, sd = [], []
    for process in response.processes:
        mean, slope, variance = gaussian_process.predict(process, inputs)
        carried = np.einsum("np,npq,nq->n", slope, covariance, slope)
        value.append(np.exp(mean))
        sd.append(np.exp(mean) * np.sqrt(variance + np.median(process.noise) + carried))
    return np.column_stack(value), np.column_stack(sd)
