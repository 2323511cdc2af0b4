from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from surrogate import forward_map, polarization, shared_process
from surrogate.loading import to_unknown
from surrogate.ring import Ring

Array = NDArray[np.float64]
Synthetic = Callable[..., tuple[Array, Array]]


def test_rows_that_single_determine_little_teach_coefficients_together() -> None:
    """Two readings a row, three smooth coefficients: no row determines its own, all together do, and the gradient."""
    rng = np.random.default_rng(0)
    x, design = rng.random((300, 2)), rng.normal(size=(300, 2, 3))

    def truth(at: Array) -> Array:
        return np.column_stack([np.sin(2 * at[:, 0]), at[:, 1] ** 2, 1 + at.sum(1)])

    process = shared_process.fit(x, design, (design @ truth(x)[..., None])[..., 0], np.ones(2), x[:, 0])
    at = 0.1 + 0.8 * rng.random((20, 2))
    mean, gradient = shared_process.predict(process, at)
    assert np.allclose(mean, truth(at), atol=2e-3)
    for j, h in enumerate(1e-5 * np.eye(2)):
        change = (shared_process.predict(process, at + h)[0] - shared_process.predict(process, at - h)[0]) / 2e-5
        assert np.allclose(gradient[..., j], change, atol=1e-5)


def test_polarization_improves_the_map_near_the_rim_by_itself(ring: Ring, synthetic: Synthetic) -> None:
    """Without the effect of the metal, of which point electrodes have none."""
    touch, signal = synthetic(300, 0, (), 85.0)
    whole = forward_map.learn(ring, touch, signal)
    assert len(whole.polarization.nodes)
    touch, signal = synthetic(100, 1, (), 85.0)
    near = np.hypot(touch[:, 0], touch[:, 1]) > 70
    unknown, left = to_unknown(touch, whole.p0)[near], []
    for answer in (polarization.none_of(), whole.polarization):
        found = forward_map.linearise(replace(whole, polarization=answer, rim=replace(
            whole.rim, directions=0 * whole.rim.directions)), unknown)
        left.append(np.median(np.linalg.norm(found.signal_V - signal[near], axis=1)
                              / np.linalg.norm(signal[near], axis=1)))
    print("relative error of the series, and with polarization:", left)
    assert left[1] < left[0] / 2
