"""One-sided standard deviations of what the punch does to the foam."""

from unittest.mock import patch

import numpy as np

from surrogate.data.samples import SweepSamples, take
from surrogate.forward_map.inversion.diameter_force_posterior import Table
from surrogate.forward_map.inversion.invert import LEAST_SIDE
from surrogate.learners import forward
from surrogate.model.train import train
from surrogate.model.trained import estimate
from touchcal.arrays import Array


def test_a_mean_outside_the_likely_punches_keeps_an_interval_on_both_sides(samples: SweepSamples) -> None:
    """Where a mean lies at the end of the likely punches, nothing of them is left on one side; where the response is
    exact, too, a side of 0 would make the calibrating ratio of error to standard deviation infinite."""
    inner = take(samples, np.hypot(*samples.target[:, :2].T) < 45)
    model = train(inner, "forward", seed=1)

    def nothing(found: object, values: Array, mean: Array) -> Array:
        return np.zeros((2, *mean.shape))

    def exact(learner: forward.TouchInversion, table: Table) -> tuple[Array, Array]:
        nodes, variance = table_response(learner, table)
        return nodes, np.zeros_like(variance)

    table_response = forward._table_response
    with patch.object(forward, "one_sided", nothing), patch.object(forward, "_table_response", exact):
        found = estimate(model, inner.signal_V, 0.02 * float(np.std(inner.signal_V)))
    assert found.below is not None
    assert found.above is not None
    for side in (found.below, found.above):
        assert np.all(side >= 0.999 * LEAST_SIDE * found.sd)
        assert np.all(side > 0)
