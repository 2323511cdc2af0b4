from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import forward_map, rim_zone
from surrogate.forward_map.forward_map import ForwardMap, strength_covariance, strengths
from surrogate.forward_map.inversion import diameter_force_posterior, outside_diameters
from surrogate.forward_map.inversion.multipole_location import Located, locate
from surrogate.forward_map.inversion.reading_covariance import no_drift
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.statistics import levenberg_marquardt
from touchcal.arrays import Array

Synthetic = Callable[..., tuple[Array, Array]]


@pytest.fixture(scope="module")
def learned(ring: Ring, synthetic: Synthetic) -> ForwardMap:
    return forward_map.fit(ring, *synthetic(140, 0))


def measured(learned: ForwardMap, d_mm: float, force_N: float, sd: Array) -> Located:
    """Exact strengths of one punch at the table's radius: that of the dipole said to be known to sd[0] of itself, the
    ratios of the next ones to it to sd[1] and sd[2], and nothing said of higher ones."""
    place = np.array([[np.hypot(*learned.sd[:2]), 0.0]])
    unknown = to_unknown(np.column_stack([place, [[d_mm, force_N]]]), learned.p0)
    exact = strengths(learned, unknown)
    ratio = exact[0, 1:3] / exact[0, 0]
    by_strength = np.zeros((3, exact.shape[1]))
    by_strength[:, 0], by_strength[[1, 2], [1, 2]] = np.r_[1, -ratio] / exact[0, 0], 1 / exact[0, 0]
    return Located(place, exact, (by_strength.T @ np.diag(sd**-2.0) @ by_strength)[None])


def brute_force(learned: ForwardMap, located: Located, points: int = 240) -> tuple[Array, Array]:
    """(points^2, 2) d and F on a fine grid, and their likelihoods over the largest."""
    (_, d_lo, f_lo), (_, d_hi, f_hi) = learned.bounds
    d, force = (g.ravel() for g in np.meshgrid(np.linspace(d_lo, d_hi, points), np.linspace(f_lo, f_hi, points)))
    unknown = to_unknown(np.column_stack([np.repeat(located.place_mm, len(d), axis=0), d, force]), learned.p0)
    miss, error = strengths(learned, unknown) - located.strengths, strength_covariance(learned, unknown)
    both = np.eye(error.shape[1]) + located.precision @ error
    log_weight = -0.5 * np.einsum("np,npq,nq->n", miss, np.linalg.solve(both, located.precision + 0 * both), miss)
    log_weight -= 0.5 * np.linalg.slogdet(both)[1]
    return np.column_stack([d, force]), np.exp(log_weight - log_weight.max())


@pytest.mark.thorough
@pytest.mark.parametrize(("d_mm", "force_N", "sd"), [(14.0, 1.0, [0.02, 2e-4, 1.0]), (11.0, 0.4, [0.1, 4e-4, 1.0]),
                                                     (17.0, 1.8, [0.3, 1e-2, 1.0])])
def test_the_posterior_equals_brute_force(learned: ForwardMap, d_mm: float, force_N: float, sd: list[float]) -> None:
    located = measured(learned, d_mm, force_N, np.array(sd))
    found = diameter_force_posterior.posterior(diameter_force_posterior.make_table(learned), located)
    punches = diameter_force_posterior.drawn(found, found.table.touch[None])
    mean, covariance = diameter_force_posterior.moments(punches)
    values, likelihood = brute_force(learned, located)
    weight = likelihood / likelihood.sum()
    expected_mean = weight @ values
    expected_sd = np.sqrt(weight @ (values - expected_mean) ** 2)
    assert np.allclose(mean[0], expected_mean, atol=0.05 * expected_sd)
    assert np.allclose(np.sqrt(np.diagonal(covariance[0])), expected_sd, rtol=0.06)
    assert np.exp(found.log_weight).sum() == pytest.approx(1.0)
    assert diameter_force_posterior.resolved(found)[0]
    below, above = 1.6449 * diameter_force_posterior.one_sided(found, found.table.touch[None], mean)[:, 0]
    likely = values[likelihood > np.exp(-0.5 * 1.6449**2)]
    ends = [mean[0] - below, mean[0] + above]
    assert np.allclose(ends, [likely.min(axis=0), likely.max(axis=0)],
                       atol=[np.diff(found.table.d_mm[:2])[0], 0.15 * expected_sd[1]])


def test_strengths_of_which_nothing_is_known_leave_the_prior(learned: ForwardMap) -> None:
    """As the noise of some volts leaves them, but for one combination, of which next to nothing is known."""
    axis = np.array([[1.1, 1e2, -1.8, 0.0, 3.0]])
    located = replace(measured(learned, 14.0, 1.0, np.ones(3)), precision=1e-9 * (axis.T @ axis)[None])
    found = diameter_force_posterior.posterior(diameter_force_posterior.make_table(learned), located)
    mean, covariance = diameter_force_posterior.moments(diameter_force_posterior.drawn(found, found.table.touch[None]))
    low, high = learned.bounds[:, 1:]
    assert np.allclose(mean[0], (low + high) / 2, rtol=0.05)
    assert np.allclose(np.sqrt(np.diagonal(covariance[0])), (high - low) / np.sqrt(12), rtol=0.1)


def test_known_punches_keep_every_branch(learned: ForwardMap) -> None:
    """The signal of a 10 mm punch grows with F and falls again: both answers stay in the interval, and no diameter in
    between known ones is taken."""
    known = replace(learned, known_mm=np.array([10.0, 12, 14, 16, 18]))
    located = measured(known, 10.0, 1.6, np.array([3e-3, 1e-2, 1.0]))
    found = diameter_force_posterior.posterior(diameter_force_posterior.make_table(known), located)
    punches = diameter_force_posterior.drawn(found, found.table.touch[None])
    mean = punches.mean(axis=1)
    below, above = 1.6449 * diameter_force_posterior.one_sided(found, found.table.touch[None], mean)[:, 0, 1]
    assert mean[0, 1] - below < 1.6 < mean[0, 1] + above
    assert np.exp(found.log_weight)[0, :5].sum() > 0.9
    assert diameter_force_posterior.resolved(found)[0]


@pytest.mark.parametrize("d_mm", [10.0, 14.0, 18.0])
def test_intervals_hold_the_smallest_and_the_largest_punch_as_often_as_others(learned: ForwardMap, d_mm: float) -> None:
    """All of five punches explain the signal, each by another force; a part of the posterior that is cut off is always
    that of the smallest or the largest."""
    known, frames, sd = replace(learned, known_mm=np.array([10.0, 12, 14, 16, 18])), 400, np.array([3e-2, 2e-3, 1.0])
    exact = measured(known, d_mm, 0.3, sd)
    error = sd * np.random.default_rng(3).normal(size=(frames, 3))
    drawn = np.repeat(exact.strengths, frames, 0)
    drawn[:, 1:3] += error[:, 1:] * drawn[:, :1]
    drawn *= 1 + error[:, :1]
    located = Located(np.repeat(exact.place_mm, frames, 0), drawn, np.repeat(exact.precision, frames, 0))
    found = diameter_force_posterior.posterior(diameter_force_posterior.make_table(known), located)
    nodes = found.table.touch[None]
    force = diameter_force_posterior.drawn(found, nodes).mean(axis=1)
    below, above = 1.6449 * diameter_force_posterior.one_sided(found, nodes, force)[..., 1]
    assert np.mean((force[:, 1] - below <= 0.3) & (force[:, 1] + above >= 0.3)) > 0.85


def test_strengths_of_no_punch_of_the_table_are_left_to_the_peak(learned: ForwardMap) -> None:
    known = replace(learned, known_mm=np.array([10.0, 12, 14, 16, 18]))
    located = measured(known, 10.9, 1.0, np.array([1e-4, 1e-6, 1e-6]))
    found = diameter_force_posterior.posterior(diameter_force_posterior.make_table(known), located)
    assert not diameter_force_posterior.resolved(found)[0]


def test_a_sharp_posterior_is_left_to_its_peak(learned: ForwardMap) -> None:
    located = measured(learned, 14.0, 1.0, np.array([1e-4, 1e-6, 1e-8]))
    found = diameter_force_posterior.posterior(diameter_force_posterior.make_table(learned), located)
    assert not diameter_force_posterior.resolved(found)[0]
    start = diameter_force_posterior.starts(found, 4)[0]
    assert np.abs(start[:, 0] - 14).min() < 0.2


def test_bands_of_loads_that_are_ruled_out_begin_where_the_best_one_does(learned: ForwardMap) -> None:
    table = diameter_force_posterior.make_table(learned)
    sharp, wide = (diameter_force_posterior.starts(diameter_force_posterior.posterior(table, measured(
        learned, 14.0, 1.0, np.array(sd))), 5)[0] for sd in ([0.02, 2e-4, 1.0], [3.0, 3.0, 3.0]))
    assert len(np.unique(sharp, axis=0)) < 5
    assert np.abs(sharp[:, 0] - 14.0).min() < 0.5
    assert len(np.unique(wide[:, 1])) == 5


@pytest.mark.parametrize("noise", [2e-5, 1e-3])
def test_strengths_are_located_within_their_covariance(learned: ForwardMap, synthetic: Synthetic, noise: float) -> None:
    """Where the series stands alone; further out what the rim adds counts as strength. In much noise, too, of which the
    training touches leave less of the ratios than the signals do."""
    touch, signal = synthetic(200, 1, (), 100 * rim_zone.DISC.learned[1])
    found = locate(learned, signal + noise * np.random.default_rng(0).normal(size=signal.shape), np.full(200, noise),
                   no_drift(signal.shape[1]))
    truth = strengths(learned, to_unknown(touch, learned.p0))
    sd = np.sqrt(np.diagonal(np.linalg.pinv(found.precision, hermitian=True), axis1=1, axis2=2))
    z = (found.strengths - truth)[:, :2] / sd[:, :2]
    assert np.all(np.abs(np.mean(z**2, axis=0) - 1) < 0.3)
    assert np.sqrt(np.mean((found.place_mm - touch[:, :2]) ** 2)) < 5e3 * noise


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


def drawn(learned: ForwardMap, d_mm: float, sd: Array, frames: int = 200) -> Located:
    """Located touches of one punch under noise of these standard deviations, as `measured` says them."""
    exact = measured(learned, d_mm, 0.5, sd)
    error = sd * np.random.default_rng(5).normal(size=(frames, 3))
    strengths = np.repeat(exact.strengths, frames, 0)
    strengths[:, 1:3] += error[:, 1:] * strengths[:, :1]
    strengths[:, :1] *= 1 + error[:, :1]
    return Located(np.repeat(exact.place_mm, frames, 0), strengths, np.repeat(exact.precision, frames, 0))


def asked(learned: ForwardMap, located: Located) -> float:
    inner = diameter_force_posterior.posterior(diameter_force_posterior.make_table(learned), located)
    outer = outside_diameters.outside(learned, located, inner)
    assert outer is not None
    return float(np.mean(outside_diameters.asked_for(inner, outer)))


@pytest.mark.thorough
@pytest.mark.parametrize(("d_mm", "least", "most"), [(10.0, 0.0, 0.07), (14.0, 0.0, 0.01),
                                                     (18.0, 0.0, 0.07), (22.0, 0.5, 1.0), (26.0, 0.95, 1.0)])
def test_a_punch_larger_than_the_trained_ones_is_asked_for_where_the_signal_tells(
        learned: ForwardMap, d_mm: float, least: float, most: float) -> None:
    """At an end of the range in one of twenty frames, as the likelihood ratio at a bound has it."""
    share = asked(learned, drawn(learned, d_mm, np.array([0.02, 1e-3, 1e-2])))
    print(d_mm, "mm, asked for another:", share)
    assert least <= share <= most


def test_punches_outside_the_range_count_as_far_as_the_signal_allows_them(learned: ForwardMap) -> None:
    """Without a word of the signal up to where the prior alone is at the interval's end; with a sharp signal none."""
    table, past = diameter_force_posterior.make_table(learned), []
    for sd in ([0.02, 1e3, 1e3], [0.02, 3e-4, 1.0]):
        located = measured(learned, 14.0, 0.5, np.array(sd))
        inner = diameter_force_posterior.posterior(table, located)
        outer = outside_diameters.outside(learned, located, inner)
        assert outer is not None
        past.append(14.0 + 1.6449 * diameter_force_posterior.one_sided(
            outer, outer.table.touch[None], np.array([[14.0, 0.5]]))[1, 0, 0])
    end = learned.bounds[1, 1] * np.exp(1.6449**2 / 2 * outside_diameters.SOFT)
    assert past[0] == pytest.approx(end, rel=1.5 * outside_diameters.REACH / outside_diameters.STEPS)
    assert past[1] == 14.0


@pytest.mark.parametrize("bend", [0.0, 2.0])
@pytest.mark.parametrize("left", [0.0, 0.5, 2.0])
def test_forces_of_smaller_punches_go_on_as_those_of_the_trained_ones(
        learned: ForwardMap, bend: float, left: float) -> None:
    """Along the tangent and the parabola of log F over log d, as far as the prior alone reaches from a smallest trained
    punch that the signal has ruled out by so much."""
    table = diameter_force_posterior.make_table(learned)
    inner = diameter_force_posterior.posterior(table, measured(learned, 14.0, 0.5, np.array([0.02, 1e-3, 1e-2])))
    log_d = np.log(table.d_mm / table.d_mm[0])
    profile, profile_N = np.r_[left, np.zeros(len(log_d) - 1)][None], np.exp(0.4 * log_d + bend * log_d**2)[None]
    found = outside_diameters.smallest(learned, replace(inner, profile=profile, profile_N=profile_N))
    assert found is not None
    off = -0.5 * outside_diameters.SOFT * (1.6449**2 - left)
    assert found[0, :, 0] == pytest.approx(table.d_mm[0] * np.exp(off), rel=1e-4)
    assert found[0, :, 1] == pytest.approx(np.exp([0.4 * off, 0.4 * off + bend * off**2]), rel=1e-4)


def test_a_smallest_trained_punch_that_is_ruled_out_rules_out_smaller_ones(learned: ForwardMap) -> None:
    table = diameter_force_posterior.make_table(learned)
    inner = diameter_force_posterior.posterior(table, measured(learned, 14.0, 0.5, np.array([0.02, 3e-4, 1.0])))
    found = outside_diameters.smallest(learned, inner)
    assert found is not None
    assert np.all(np.isnan(found))


def test_known_punches_leave_no_room_outside(learned: ForwardMap) -> None:
    known = replace(learned, known_mm=np.array([10.0, 14.0, 18.0]))
    assert outside_diameters.outside_table(known) is None
    table = diameter_force_posterior.make_table(learned)
    inner = diameter_force_posterior.posterior(table, measured(learned, 14.0, 0.5, np.array([0.02, 1e-3, 1e-2])))
    assert outside_diameters.smallest(known, inner) is None
