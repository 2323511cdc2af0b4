"""Conductivity fit: recovery within errors, positivity over compression, draws that keep it, weights by noise."""

import emcee
import numpy as np
import pytest

from matcal.fitting.conductivity_fit import FLOOR, LOWEST_STRAIN, ConductivityFit, fit_conductivity
from matcal.laws.conduction_laws import CUBIC, LAWS
from matcal.laws.conductivity import conductivity
from matcal.posterior.conductivity_posterior import _log_density, conductivity_draws, skin_chains, skin_checks
from matcal.record.fit_summary import _skin_part
from matcal.reduction.experiment import Experiment

TRUTH = 30 * np.array([1.0, -2.0, 2.0, -1.0])
FALLING = 30 * np.array([1.0, 2.5, 1.0, 1.0])
powers = LAWS[CUBIC].basis


def fit_cubic(tests: list[Experiment]) -> ConductivityFit:
    return fit_conductivity(tests, CUBIC)


def stretch(truth: np.ndarray = TRUTH, noise: float = 0.05, seed: int = 0, highest: float = 0.4) -> Experiment:
    e = np.linspace(0, highest, 100)
    value = powers(e) @ truth + noise * np.random.default_rng(seed).normal(size=e.size)
    return Experiment("conductivity", e, value, noise=noise, source=("stretch.txt",))


def test_errors_follow_the_covariance() -> None:
    fits = [fit_cubic([stretch(seed=s)]) for s in range(30)]
    scores = np.array([(f.centre - TRUTH) / np.sqrt(np.diag(f.covariance)) for f in fits])
    assert 0.7 < np.sqrt(np.mean(scores**2)) < 1.2
    assert 0.8 < np.mean([f.chi_square / f.freedom for f in fits]) < 1.2


def test_a_cubic_that_would_turn_negative_under_compression_is_held() -> None:
    found = fit_cubic([stretch(FALLING)])
    e = np.linspace(LOWEST_STRAIN, 0.4, 400)
    assert np.min(powers(e) @ found.centre) < 0
    assert conductivity(found.law, e).min() >= 0.99 * FLOOR * np.median(stretch(FALLING).value)
    assert any("bound holds the fit" in d for d in found.decisions)
    assert found.chi_square > found.freedom


def test_draws_have_the_fits_mean_and_spread_and_stay_positive() -> None:
    free = fit_cubic([stretch()])
    draws = conductivity_draws(free, 1500, np.random.default_rng(1))
    sd = np.sqrt(np.diag(free.covariance))
    np.testing.assert_allclose((draws.mean(axis=0) - free.centre) / sd, 0, atol=0.12)
    np.testing.assert_allclose(draws.std(axis=0) / sd, 1, atol=0.1)
    held = fit_cubic([stretch(30 * np.array([1.0, 1.2, 0.3, 0.2]), noise=1.0)])
    kept = conductivity_draws(held, 400, np.random.default_rng(2)) @ held.positive[0]
    assert kept.min() >= held.positive[1] * (1 - 1e-6)


def test_noisier_tests_count_less() -> None:
    shifted = 1.02 * TRUTH
    near = fit_cubic([stretch(), stretch(shifted, noise=1.0, seed=1)]).law.c0_S_per_m
    assert abs(near - 30.0) < 0.05


def slow_errors(count: int, correlation: float, rng: np.random.Generator) -> np.ndarray:
    """Errors of unit size that are correlated from point to point."""
    fresh = rng.normal(size=count)
    out = fresh.copy()
    for k in range(1, count):
        out[k] = correlation * out[k - 1] + np.sqrt(1 - correlation**2) * fresh[k]
    return out


@pytest.mark.slow
@pytest.mark.parametrize(("correlation", "proportional", "count"), [(0.0, False, 100), (0.5, False, 100),
                                                                    (0.9, False, 100), (0.0, True, 100),
                                                                    (0.0, False, 12)])
def test_intervals_of_the_cubic_cover(correlation: float, proportional: bool, count: int) -> None:
    """At most 7 of 60 miss by chance in 98 of 100 such tests; c_0 and each a_i, by the fit and by draws."""
    truth, e = np.r_[30.0, -2.0, 2.0, -1.0], np.linspace(0, 0.4, count)
    missed, drawn = np.zeros(4), np.zeros(4)
    for seed in range(60):
        rng = np.random.default_rng([9, seed])
        value = powers(e) @ TRUTH
        errors = 0.03 * slow_errors(count, correlation, rng) * (value / 20 if proportional else 1)
        found = fit_cubic([Experiment("conductivity", e, value + errors)])
        part = _skin_part(found)
        ends = np.vstack([part["c0_interval_S_per_m"], part["a_interval"]])
        missed += (ends[:, 0] > truth) | (ends[:, 1] < truth)
        if seed < 20:
            b = conductivity_draws(found, 400, rng)
            low, high = np.quantile(np.column_stack([b[:, 0], b[:, 1:] / b[:, :1]]), [0.025, 0.975], axis=0)
            drawn += (low > truth) | (high < truth)
    print(correlation, proportional, count, missed, drawn)
    assert missed.max() <= 7
    assert drawn.max() <= 4


def test_a_cubic_held_by_its_bound_says_what_the_bound_moved() -> None:
    found = fit_cubic([stretch(FALLING, noise=0.01)])
    part = _skin_part(found)
    assert part["c0_interval_S_per_m"][0] < found.centre[0] < part["c0_interval_S_per_m"][1]


def test_uncertain_strain_zero_widens_the_band() -> None:
    plain = stretch()
    doubted = Experiment("conductivity", plain.strain, plain.value, noise=0.05, facts={"strain_zero_sd": 1e-3})
    assert fit_cubic([doubted]).covariance[0, 0] > 3 * fit_cubic([plain]).covariance[0, 0]


def test_too_little_data_is_refused() -> None:
    with pytest.raises(ValueError, match="five positive"):
        fit_conductivity([Experiment("conductivity", np.linspace(0, 0.1, 4), np.ones(4))])


def log_skin(fit: ConductivityFit, points: np.ndarray) -> np.ndarray:
    """(W,) log density at (b, ln v) (W, 5), the law that `skin_chains` draws from."""
    b, ln_v = points[:, :4], points[:, 4]
    inside = np.all(b @ fit.positive[0] >= fit.positive[1], axis=1) & (np.abs(ln_v) < 30)
    out = np.full(points.shape[0], -np.inf)
    if inside.any():
        noise = fit.covariance - fit.zero_covariance
        out[inside] = _log_density(fit, b[inside], ln_v[inside], noise, fit.zero_covariance)
    return out


@pytest.mark.thorough
@pytest.mark.parametrize("truth", [TRUTH, FALLING])
def test_draws_agree_with_emcee_on_the_same_density(truth: np.ndarray) -> None:
    found = fit_cubic([stretch(truth, noise=1.0)])
    at = powers(np.array([LOWEST_STRAIN, -0.4, 0.0, 0.4])).T
    own = conductivity_draws(found, 4000, np.random.default_rng(0)) @ at
    rng, inside = np.random.default_rng(1), conductivity_draws(found, 40, np.random.default_rng(2))
    sampler = emcee.EnsembleSampler(40, 5, lambda x: log_skin(found, x), vectorize=True, moves=emcee.moves.DEMove())
    state = emcee.State(np.column_stack([inside, 0.05 * rng.normal(size=40)]),
                        random_state=np.random.RandomState(3).get_state())
    sampler.run_mcmc(state, 1500)  # 60,000 points, 17 to 20 steps to a new one
    other = sampler.get_chain(discard=300, flat=True)[:, :4] @ at
    np.testing.assert_allclose((own - other.mean(axis=0)).mean(axis=0) / other.std(axis=0), 0, atol=0.1)
    np.testing.assert_allclose(own.std(axis=0), other.std(axis=0), rtol=0.1)


def test_few_points_leave_the_noise_and_so_the_band_open() -> None:
    e = np.array([0.0, 0.1, 0.2, 0.25, 0.3, 0.4])
    noise = 0.1 * np.random.default_rng(4).normal(size=e.size)
    few = fit_cubic([Experiment("conductivity", e, powers(e) @ TRUTH + noise)])
    spread = conductivity_draws(few, 4000, np.random.default_rng(0))[:, 0]
    middle = np.diff(np.quantile(spread, [0.16, 0.84]))[0]
    assert np.diff(np.quantile(spread, [0.005, 0.995]))[0] > 4 * middle


def test_chains_of_the_skin_mix() -> None:
    found = fit_cubic([stretch(FALLING)])
    checks = skin_checks(found, skin_chains(found, 2000, np.random.default_rng(0)))
    assert checks["rhat"] < 1.01
    assert checks["ess"] > 1000
