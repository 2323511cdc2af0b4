from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import forward_map
from surrogate.forward_map.forward_map import INTERIOR, ForwardMap, log_strengths
from surrogate.forward_map.inversion import diameter_force_posterior
from surrogate.forward_map.inversion.multipole_location import Located, locate
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.statistics import levenberg_marquardt

Array = NDArray[np.float64]
Synthetic = Callable[..., tuple[Array, Array]]


@pytest.fixture(scope="module")
def learned(ring: Ring, synthetic: Synthetic) -> ForwardMap:
    return forward_map.fit(ring, *synthetic(140, 0))


def measured(learned: ForwardMap, d_mm: float, force_N: float, sd: Array) -> Located:
    """Exact strengths of one punch at the table's radius, said to be known to sd."""
    place = np.array([[np.hypot(*learned.sd[:2]), 0.0]])
    unknown = to_unknown(np.column_stack([place, [[d_mm, force_N]]]), learned.p0)
    return Located(place, log_strengths(learned, unknown), np.diag(sd**2)[None])


def brute_force(learned: ForwardMap, located: Located, points: int = 240) -> tuple[Array, Array]:
    """Posterior mean and standard deviation of (d, F) by summing over a fine grid, uniform in d and F."""
    (_, d_lo, f_lo), (_, d_hi, f_hi) = learned.bounds
    d, force = (g.ravel() for g in np.meshgrid(np.linspace(d_lo, d_hi, points), np.linspace(f_lo, f_hi, points)))
    place = np.repeat(located.place_mm, len(d), axis=0)
    miss = log_strengths(learned, to_unknown(np.column_stack([place, d, force]), learned.p0)) - located.strengths
    scatter = np.diag([np.median(process.noise) for process in learned.strengths])
    log_weight = -0.5 * np.einsum("np,pq,nq->n", miss, np.linalg.inv(located.covariance[0] + scatter), miss)
    weight = np.exp(log_weight - log_weight.max())
    values = np.column_stack([d, force])
    mean = weight @ values / weight.sum()
    return mean, np.sqrt(weight @ (values - mean) ** 2 / weight.sum())


@pytest.mark.parametrize(("d_mm", "force_N", "sd"), [(14.0, 1.0, [0.02, 2e-4, 1.0]), (11.0, 0.4, [0.1, 4e-4, 1.0]),
                                                     (17.0, 1.8, [0.3, 1e-2, 1.0])])
def test_the_posterior_equals_brute_force(learned: ForwardMap, d_mm: float, force_N: float, sd: list[float]) -> None:
    located = measured(learned, d_mm, force_N, np.array(sd))
    found = diameter_force_posterior.posterior(learned, diameter_force_posterior.make_table(learned), located)
    mean, covariance = diameter_force_posterior.moments(found, found.table.touch[:, 2:])
    wanted_mean, wanted_sd = brute_force(learned, located)
    assert np.allclose(mean[0], wanted_mean, atol=0.05 * wanted_sd)
    assert np.allclose(np.sqrt(np.diagonal(covariance[0])), wanted_sd, rtol=0.06)
    assert found.weight.sum() == pytest.approx(1.0)
    assert diameter_force_posterior.resolved(found)[0]


def test_a_sharp_posterior_is_left_to_its_peak(learned: ForwardMap) -> None:
    located = measured(learned, 14.0, 1.0, np.array([1e-4, 1e-6, 1e-8]))
    found = diameter_force_posterior.posterior(learned, diameter_force_posterior.make_table(learned), located)
    assert not diameter_force_posterior.resolved(found)[0]
    start = diameter_force_posterior.starts(found, 4)[0]
    assert np.abs(start[:, 0] - 14).min() < 0.2


def test_strengths_are_located_within_their_covariance(learned: ForwardMap, synthetic: Synthetic) -> None:
    """Where the series stands alone; further out what the rim adds counts as strength."""
    touch, signal = synthetic(200, 1, (), 100 * INTERIOR)
    noise = 2e-5
    found = locate(learned, signal + noise * np.random.default_rng(0).normal(size=signal.shape), np.full(200, noise))
    truth = log_strengths(learned, to_unknown(touch, learned.p0))
    z = (found.strengths - truth)[:, :2] / np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))[:, :2]
    assert np.all(np.abs(np.mean(z**2, axis=0) - 1) < 0.3)
    assert np.sqrt(np.mean((found.place_mm - touch[:, :2]) ** 2)) < 0.1


def test_many_problems_are_minimised_at_once() -> None:
    """Rosenbrock's valley with a different floor each."""
    floor = np.linspace(0.5, 2.0, 7)

    def residuals(state: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        x, y, a = state[:, 0], state[:, 1], floor[which]
        jacobian = np.zeros((len(state), 2, 2))
        jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 1, 0] = -20 * x, 10, -1
        return np.column_stack([10 * (y - x**2), a - x]), jacobian

    found = levenberg_marquardt.minimise(residuals, np.tile([-1.2, 1.0], (7, 1)), 200)
    assert np.allclose(found.state, np.column_stack([floor, floor**2]), atol=1e-3)
    assert np.allclose(levenberg_marquardt.inverse(found.normal) @ found.normal, np.eye(2), atol=1e-8)
