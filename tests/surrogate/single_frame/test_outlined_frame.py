"""One frame in depth on a skin with an outline: the posterior of the learned map, and the simulator inverted."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import surrogate
from matcal.posterior import ensembles
from surrogate.data.outlined_sheet import edge_distance_mm
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.learners.forward import TouchInversion
from surrogate.single_frame import simulator_inversion as direct_module
from surrogate.single_frame.posterior import log_prior, posterior_of, prior_of
from surrogate.single_frame.simulator_inversion import direct
from surrogate.single_frame.simulator_likelihood import Simulator, Solved
from touchcal.arrays import Array

Signals = Callable[[Array], Array]


@pytest.fixture(scope="module")
def forward(rectangle_model: surrogate.Model) -> ForwardMap:
    assert isinstance(rectangle_model.learner, TouchInversion)
    return rectangle_model.learner.forward


def distance(ring: Ring, touch: Array) -> Array:
    assert ring.sheet is not None
    return edge_distance_mm(ring.sheet, touch[:, :2])[0]


def test_the_prior_of_the_place_is_even_where_the_punch_keeps_from_the_edges_what_it_was_trained_with(
        forward: ForwardMap) -> None:
    prior, rng = prior_of(forward), np.random.default_rng(0)
    touch = np.column_stack([rng.uniform(-80, 80, 500), rng.uniform(-55, 55, 500), np.full(500, 10.0),
                             np.full(500, 0.5)])
    found = log_prior(forward, prior, to_unknown(touch, forward.p0))
    away = distance(forward.ring, touch)
    assert np.array_equal(np.isfinite(found), away >= prior.gap_mm + 5.0)
    assert np.ptp(found[np.isfinite(found)]) < 1e-9
    trained = forward.ring.radius_mm - forward.bounds[1, 0]
    assert prior.gap_mm + prior.d_mm[0] / 2 == pytest.approx(trained)


@pytest.mark.slow
def test_posteriors_hold_the_touches_of_noisy_frames_as_often_as_they_say(
        forward: ForwardMap, rectangle_signal: Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    """Chains that a slow machine ends short say so; here they may go on."""
    monkeypatch.setattr(ensembles, "MOST_CPU_S", np.inf)
    rng, noise, inside = np.random.default_rng(8), 3e-6, []
    touch = np.column_stack([rng.uniform(-48, 48, 6), rng.uniform(-24, 24, 6), rng.uniform(8.5, 11.5, 6),
                             rng.uniform(0.2, 0.9, 6)])
    for k, (truth, clean) in enumerate(zip(touch, rectangle_signal(touch), strict=True)):
        found = posterior_of(forward, clean + noise * rng.normal(size=clean.size), noise, seed=k)
        low, high = np.quantile(found.draws, (0.05, 0.95), axis=0)
        inside.append((truth > low) & (truth < high))
        assert found.checks["converged"]
        assert distance(forward.ring, found.draws).min() > forward.ring.radius_mm - forward.bounds[1, 0] - 1e-6
    held = np.mean(inside)
    print(f"90 % intervals hold {held:.0%} of {np.size(inside)}")
    assert held >= 0.75


@pytest.mark.slow
def test_the_posterior_ends_where_touches_near_an_edge_begin(forward: ForwardMap, rectangle_signal: Signals) -> None:
    """Half of the likelihood of a touch on that line lies outside the prior."""
    prior = prior_of(forward)
    truth = np.array([[10.0, 50 - prior.gap_mm - 5.0, 10.0, 0.6]])
    found = posterior_of(forward, rectangle_signal(truth)[0], 3e-6, seed=1)
    away = distance(forward.ring, found.draws) - prior.gap_mm - found.draws[:, 2] / 2
    print("nearest", away.min(), "median", np.median(away), "sd of y", found.draws[:, 1].std())
    assert away.min() >= 0
    assert away.min() < 0.05 * np.median(away)


def test_the_simulator_is_inverted_with_the_map_s_derivatives(monkeypatch: pytest.MonkeyPatch,
                                                              forward: ForwardMap) -> None:
    """A stand-in turns the map by some hundredths, and makes it stronger."""
    def signal(touch: Array) -> Array:
        x, y, d, force = touch
        turned = np.array([[x + 0.01 * y, y - 0.01 * x, d, 1.03 * force]])
        return linearise(forward, to_unknown(turned, forward.p0)).signal_V[0]

    def solved(_: Any, touch: Array) -> Solved:
        return Solved(signal(touch), np.ones_like(forward.ring.read, float), 1e-6, 1e-6)

    monkeypatch.setattr(direct_module, "solved", solved)
    truth = np.array([20.0, -11.0, 10.0, 0.6])
    found = direct(Simulator.__new__(Simulator), forward, signal(truth), 1e-7, truth + np.array([0.5, 0.4, 0.2, -0.05]))
    assert found.converged
    assert np.all(np.abs(found.touch - truth) < 0.3 * np.sqrt(np.diag(found.covariance)))
