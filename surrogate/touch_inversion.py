"""The forward method: invert the learned forward map for the touch, then read its response off the learned response."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from surrogate import forward_map, outputs, response
from surrogate.estimate import Estimate
from surrogate.forward_map import ForwardMap
from surrogate.invert import Inversion, invert
from surrogate.punches import make_table, moments
from surrogate.response import Response
from surrogate.ring import Ring

Array = NDArray[np.float64]

# Frames solved together, to bound the memory.
BATCH = 256


@dataclass(frozen=True, eq=False)
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
    learned = response.learn(ring.radius_mm, touch, target[:, mechanical],
                             tuple(outputs.NAMES[i] for i in mechanical))
    order = [*outputs.NAMES[:outputs.TOUCH], *(outputs.NAMES[i] for i in mechanical)]
    return TouchInversion(forward_map.learn(ring, touch, signal_V), learned, np.array([order.index(n) for n in names]))


def estimate(learner: TouchInversion, signal_V: Array, noise_V: float) -> Estimate:
    """The wanted outputs of signals (n, readings) under white noise."""
    parts = [_estimate(learner, signal_V[i:i + BATCH], noise_V) for i in range(0, len(signal_V), BATCH)]
    return Estimate(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Estimate)))


def _estimate(learner: TouchInversion, signal: Array, noise_V: float) -> Estimate:
    found = invert(learner.forward, signal, noise_V)
    value, sd = found.touch, np.sqrt(np.einsum("npp->np", found.covariance))
    if learner.response.processes:
        mechanical, doubt = _response(learner, found)
        value, sd = np.column_stack([value, mechanical]), np.column_stack([sd, doubt])
    return Estimate(value[:, learner.columns], sd[:, learner.columns], found.misfit, found.inside)


def _response(learner: TouchInversion, found: Inversion) -> tuple[Array, Array]:
    """Mechanical outputs and their standard deviations; over the whole posterior where that is broad."""
    value, sd = response.respond(learner.response, found.touch, found.covariance[:, 2:, 2:])
    of_table, doubt = _table_response(learner)
    mean, covariance = moments(found.punches, of_table)
    spread = np.sqrt(np.einsum("npp->np", covariance) + found.punches.weight @ doubt**2)
    broad = found.broad[:, None]
    return np.where(broad, mean, value), np.where(broad, spread, sd)


@lru_cache(maxsize=8)
def _table_response(learner: TouchInversion) -> tuple[Array, Array]:
    touch = make_table(learner.forward).touch
    return response.respond(learner.response, touch, np.zeros((len(touch), 2, 2)))
