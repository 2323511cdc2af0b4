"""The forward method: invert the learned forward map for the touch, then read its response off the learned response."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from surrogate import forward_map, outputs, response
from surrogate.estimate import Estimate
from surrogate.forward_map import ForwardMap
from surrogate.invert import invert
from surrogate.response import Response
from surrogate.ring import Ring

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TouchInversion:
    """A forward map and the response of the wanted mechanical outputs, if any."""

    forward: ForwardMap
    response: Response
    # positions of the wanted outputs among the touch's four and the response's
    columns: NDArray[np.int64]


def learn(ring: Ring, signal_V: Array, target: Array, names: tuple[str, ...]) -> TouchInversion:
    """Learn from signals (n, readings) and the targets (n, 8) of outputs.ALL, for the outputs of these names."""
    touch = target[:, :outputs.TOUCH]
    mechanical = [i for i in range(outputs.TOUCH, len(outputs.NAMES)) if outputs.NAMES[i] in names]
    learned = response.learn(touch, target[:, mechanical], tuple(outputs.NAMES[i] for i in mechanical))
    order = [*outputs.NAMES[:outputs.TOUCH], *(outputs.NAMES[i] for i in mechanical)]
    return TouchInversion(forward_map.learn(ring, touch, signal_V), learned, np.array([order.index(n) for n in names]))


def estimate(learner: TouchInversion, signal_V: Array, noise_V: float) -> Estimate:
    """The wanted outputs of signals (n, readings) under white noise."""
    found = invert(learner.forward, signal_V, noise_V)
    sd = np.sqrt(np.einsum("npp->np", found.covariance))
    sd[:, 2:] *= found.touch[:, 2:]
    value = found.touch
    if learner.response.processes:
        mechanical, doubt = response.respond(learner.response, found.touch, found.covariance[:, 2:, 2:])
        value, sd = np.column_stack([value, mechanical]), np.column_stack([sd, doubt])
    return Estimate(value[:, learner.columns], sd[:, learner.columns], found.misfit, found.inside)
