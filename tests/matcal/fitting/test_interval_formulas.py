"""Intervals against their formulas, worked out here: one term, slopes by differences of the stress, no package sums."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm, t

from matcal.fitting.hyperfoam.curves import Curve, weigh, weighted_model, with_history
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, allowed_exponents, fit
from matcal.fitting.hyperfoam.poisson import NU_BOUNDS
from matcal.fitting.hyperfoam.shared_poisson import Profile, profile
from matcal.fitting.uncertainty import nu_ridge
from matcal.fitting.uncertainty.intervals import (
    Uncertainty,
    _nu_effects,
    derived_quantities,
    intervals,
    linearised,
    measured_quantities,
    plateau_reached,
)
from matcal.fitting.uncertainty.linear_response import effective_variance, errors_of, prior_precision
from matcal.fitting.uncertainty.nu_ridge import RESOLVED, Node, Ridge, _direction, mixed
from matcal.fitting.uncertainty.nuisance import (
    moved_sentences,
    nuisance,
    refined_records,
    settled_records,
    surprise,
    with_drift,
)
from matcal.fitting.uncertainty.standard_errors import standard_errors
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.reduction.experiment import Experiment
from matcal.statistics.residual_correlation import Errors

MU, ALPHA, NOISE_Pa = 12e3, 3.0, 50.0


def _stress(mode: str, strain: np.ndarray, mu: float = MU, alpha: float = ALPHA) -> np.ndarray:
    return nominal_stress(Hyperfoam([mu], [alpha], [0.0]), mode, strain)


def _plateau(mu: float, alpha: float) -> float:
    """-P at lambda = 0.6: P = 2 mu/alpha (lambda^(alpha - 1) - 1/lambda)."""
    return -2 * mu / alpha * (0.6 ** (alpha - 1) - 1 / 0.6)


def _gradients(mu: float, alpha: float) -> dict[str, np.ndarray]:
    """Slopes of mu_0, E_0 = 2 mu_0 (nu = 0) and the plateau stress in (mu, alpha)."""
    bend = -_plateau(mu, alpha) / alpha - 2 * mu / alpha * 0.6 ** (alpha - 1) * np.log(0.6)
    return {"mu_0_Pa": np.array([1.0, 0.0]), "E_0_Pa": np.array([2.0, 0.0]),
            "plateau_Pa": np.array([_plateau(1.0, alpha), bend])}


def _fitted(slow: bool, points: int = 100) -> Fit:
    """Compression and shear with noise, that of compression white or a moving mean of thirty."""
    rng, tests = np.random.default_rng(1), []
    for mode, strain in (("uniaxial", np.linspace(-0.6, -0.01, points)), ("shear", np.linspace(0.02, 0.8, points))):
        noise = rng.normal(size=points + 29)
        noise = np.convolve(noise, np.ones(30) / 30**0.5, "valid") if slow and mode == "uniaxial" else noise[:points]
        tests.append(Experiment(mode, strain, _stress(mode, strain) + NOISE_Pa * noise, noise=NOISE_Pa))
    return fit(weigh(tests), 1, starts=1, thorough=False)


@pytest.fixture(scope="module")
def white() -> Fit:
    return _fitted(False)


@pytest.fixture(scope="module")
def slow() -> Fit:
    return _fitted(True)


def _slopes_and_cost(found: Fit) -> tuple[np.ndarray, float]:
    """d(weighted stress)/d(mu, alpha) (n, 2), and the sum of squares of the weighted residual."""
    def at(mu: float, alpha: float) -> np.ndarray:
        return np.concatenate([_stress(c.experiment.kind, c.experiment.strain, mu, alpha) / c.scale_Pa
                               for c in found.curves])

    mu, alpha = float(found.law.mu_Pa[0]), float(found.law.alpha[0])
    slopes = np.column_stack([at(1.0, alpha), (at(mu, alpha + 1e-5) - at(mu, alpha - 1e-5)) / 2e-5])
    left = at(mu, alpha) - np.concatenate([c.experiment.value / c.scale_Pa for c in found.curves])
    return slopes, float(left @ left)


def test_effective_points_are_those_of_the_quantity_that_suffers_most(slow: Fit) -> None:
    """n_q = cost g (X'X)^-1 g / (g C g) of mu_0, E_0 and the plateau; the fewest count."""
    told = linearised(slow)
    slopes, cost = _slopes_and_cost(slow)
    independent = cost * np.linalg.inv(slopes.T @ slopes)
    points = [g @ independent @ g / (g @ told.covariance @ g)
              for g in _gradients(float(slow.law.mu_Pa[0]), float(slow.law.alpha[0])).values()]
    assert max(points) > 1.5 * min(points)
    assert min(points) > 6
    assert told.effective_points == pytest.approx(min(points), rel=1e-5)


def test_effective_points_are_at_least_those_of_students_law() -> None:
    """Twelve points count as 2 N + 4 where slow errors leave fewer; five points never as more than five."""
    for points, order, waves, least in ((12, 1, 8, 6), (12, 2, 20, 8), (5, 1, 8, 5)):
        strain = np.linspace(-0.5, -0.02, points)
        bent = Experiment("uniaxial", strain, _stress("uniaxial", strain) + 300 * np.cos(waves * strain))
        found = linearised(fit(weigh([bent]), order, thorough=False))
        assert found.effective_points == pytest.approx(least, abs=1e-9)


def test_covariance_of_white_noise_is_the_least_squares_one(white: Fit) -> None:
    """C = s^2 (X'X)^-1 where both curves have one noise over their scale, wider by what correlation cannot rule out."""
    slopes, cost = _slopes_and_cost(white)
    classical = cost / (len(slopes) - 2) * np.linalg.inv(slopes.T @ slopes)
    ratio = np.sqrt(np.diag(linearised(white).covariance) / np.diag(classical))
    assert np.all(ratio > 0.95)
    assert np.all(ratio < 1.6)


def test_classical_standard_errors_are_the_least_squares_ones(white: Fit) -> None:
    slopes, cost = _slopes_and_cost(white)
    sd = np.sqrt(np.diag(cost / (len(slopes) - 2) * np.linalg.inv(slopes.T @ slopes)))
    found = standard_errors(white)
    assert {name: entry["stderr"] for name, entry in found.items()} == pytest.approx(
        {"mu_1_Pa": sd[0], "alpha_1": sd[1], "mu_0_Pa": sd[0]}, rel=1e-4)
    assert found["alpha_1"]["value"] == white.law.alpha[0]


@pytest.mark.parametrize(("exponents", "together"), [((2.0, 4.0), False), ((4.0 + 3.0j, 4.0 - 3.0j), True)])
def test_standard_errors_of_two_terms_are_the_least_squares_ones(exponents: tuple[complex, complex],
                                                                 together: bool) -> None:
    """Exponents at their least distance, as those that would be conjugate, move together; others by themselves."""
    strain = np.linspace(-0.6, 0.5, 120)
    stress = sum(np.real(8e3 / a * ((1 + strain) ** (a - 1) - 1 / (1 + strain))) for a in exponents)
    found = fit(weigh([Experiment("uniaxial", strain, stress + 2 * np.random.default_rng(3).normal(size=120))]), 2,
                thorough=False)
    (curve,), law = found.curves, found.law
    assert (np.diff(law.alpha)[0] < 1.001 * allowed_exponents(found.curves).gap) == together

    def at(move: np.ndarray) -> np.ndarray:
        moved = Hyperfoam(law.mu_Pa + move[:2], law.alpha + move[2:], law.nu)
        return nominal_stress(moved, "uniaxial", strain) / curve.scale_Pa

    unit = np.array([law.mu_0_Pa, law.mu_0_Pa, 1.0, 1.0])
    ways = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]]) if together else np.eye(4)
    slopes = np.column_stack([(at(1e-5 * w * unit) - at(-1e-5 * w * unit)) / 2e-5 for w in ways])
    left = at(np.zeros(4)) - curve.experiment.value / curve.scale_Pa
    variance = left @ left / (120 - len(ways)) * np.linalg.inv(slopes.T @ slopes)
    sd = unit * np.sqrt(np.diag(ways.T @ variance @ ways))
    names = ("mu_1_Pa", "mu_2_Pa", "alpha_1", "alpha_2")
    assert [standard_errors(found)[name]["stderr"] for name in names] == pytest.approx(sd.tolist(), rel=1e-3)


def test_intervals_hold_95_percent(white: Fit) -> None:
    """The probability between the ends, of a normal variable with many points left and of Student's with few."""
    told = linearised(white)
    for one in told.derived.values():
        assert (one.hi - one.value) / one.sd == pytest.approx(told.reach, rel=1e-12)
        assert (one.value - one.lo) / one.sd == pytest.approx(told.reach, rel=1e-9)
    assert norm.cdf(told.reach) - norm.cdf(-told.reach) == pytest.approx(0.95, abs=0.004)
    strain = np.linspace(-0.5, -0.02, 6)
    for points, order, spare in ((6, 1, 4), (3, 1, 1), (5, 2, 1)):
        some = strain[:points]
        stress = _stress("uniaxial", some) * (1 + 0.01 * np.cos(9 * some))
        few = linearised(fit(weigh([Experiment("uniaxial", some, stress)]), order, thorough=False))
        assert t.cdf(few.reach, spare) - t.cdf(-few.reach, spare) == pytest.approx(0.95, abs=1e-9)


def test_an_interval_adds_covariance_and_hidden_order() -> None:
    """sd^2 = g' C g + (wider - law)^2, ends at the reach."""
    covariance = np.array([[400.0, -0.6], [-0.6, 0.0025]])
    law, wider = Hyperfoam([MU], [ALPHA], [0.0]), Hyperfoam([MU + 30], [ALPHA + 0.01], [0.0])
    about = Uncertainty({}, covariance, 50.0, law, (wider,), 2.5, {}, ())
    found = intervals(about, derived_quantities)
    for name, gradient in _gradients(MU, ALPHA).items():
        value, other = derived_quantities(law)[name], derived_quantities(wider)[name]
        sd = np.sqrt(gradient @ covariance @ gradient + (other - value) ** 2)
        assert (found[name].value, found[name].form) == (value, pytest.approx(abs(other - value)))
        assert found[name].sd == pytest.approx(sd, rel=1e-6)
        assert (found[name].lo, found[name].hi) == pytest.approx((value - 2.5 * sd, value + 2.5 * sd), rel=1e-7)
    assert intervals(replace(about, neighbours=()), derived_quantities)["mu_0_Pa"].sd == pytest.approx(20.0)


def test_stated_scatter_widens_mu_0_as_a_factor_of_the_whole_curve(white: Fit) -> None:
    """A tenth of every stress in one of two curves: ln mu_0 moves by 0.1 times that curve's part of the gain, in
    quadrature, and what both curves state adds up to 0.1 sqrt(part^2 + rest^2)."""
    bare = linearised(white)

    def variance(states: tuple[bool, bool]) -> tuple[float, dict[str, float]]:
        stated = [0.1 * np.abs(c.experiment.value) if s else None for c, s in zip(white.curves, states, strict=True)]
        told = linearised(replace(white, curves=tuple(
            replace(c, experiment=replace(c.experiment, deviation=d))
            for c, d in zip(white.curves, stated, strict=True))))
        return told.covariance[0, 0] - bare.covariance[0, 0], dict(told.shares)

    slopes, _ = _slopes_and_cost(white)
    gain = np.linalg.solve(slopes.T @ slopes, slopes.T)[0]
    value = np.concatenate([c.experiment.value / c.scale_Pa for c in white.curves])
    parts = [0.1 * gain[rows] @ value[rows] for rows in (slice(0, 100), slice(100, 200))]
    assert sum(parts) == pytest.approx(0.1 * white.law.mu_0_Pa, rel=1e-3)
    assert variance((True, False))[0] == pytest.approx(parts[0] ** 2, rel=1e-2)
    both, shares = variance((True, True))
    assert both == pytest.approx(parts[0] ** 2 + parts[1] ** 2, rel=1e-2)
    whole = bare.covariance[0, 0] + bare.derived["mu_0_Pa"].form ** 2 + both
    assert shares["scatter between specimens"] == pytest.approx(both / whole, rel=1e-6)


def test_the_plateau_is_told_where_compression_reaches_it() -> None:
    assert derived_quantities(Hyperfoam([MU], [ALPHA], [0.0]))["plateau_Pa"] == pytest.approx(_plateau(MU, ALPHA))
    assert plateau_reached({"uniaxial": (-0.4, 0.0)})
    assert not plateau_reached({"uniaxial": (-0.39, 0.5)})
    assert not plateau_reached({"shear": (0.0, 1.0)})
    reached, short = (Hyperfoam([MU], [ALPHA], [0.0], strain_range={"uniaxial": (low, 0.0)}) for low in (-0.5, -0.3))
    assert set(measured_quantities(reached)) - set(measured_quantities(short)) == {"plateau_Pa"}


def _uncertain() -> Fit:
    """Compression with an uncertain contact, load zero and drift."""
    strain, time = np.linspace(-0.6, -0.01, 60)[::-1], np.linspace(0.5, 30.0, 60)
    stress = _stress("uniaxial", strain) + 0.5 * np.random.default_rng(2).normal(size=60)
    facts = {"area_mm2": 500.0, "strain_zero_sd": 1e-3, "zero_sd_Pa": 40.0, "drift_sd_N_per_s": 1e-3}
    return fit(weigh([Experiment("uniaxial", strain, stress, time, ("a",), 0.5, facts=facts)]), 1, thorough=False)


def test_zero_and_drift_of_the_load_move_the_stress_by_one_standard_deviation() -> None:
    """z_j = 1 lowers what the load says, so that the law has to rise: 0.02 N/500 mm2, 1 mN/s t/500 mm2."""
    found = _uncertain()
    known, curve = nuisance(found), found.curves[0]
    assert [name.split(" of ")[0] for name in known.names] == ["the contact point", "the load zero",
                                                               "the assumed load drift"]
    assert curve.experiment.time_s is not None
    assert known.effect[:, 1] * curve.scale_Pa == pytest.approx(np.full(60, 0.02 / 500e-6), rel=1e-9)
    assert known.effect[:, 2] * curve.scale_Pa == pytest.approx(1e-3 * curve.experiment.time_s / 500e-6, rel=1e-9)
    assert known.mean.tolist() == [0.0, 0.0, 0.0]
    shares = linearised(found).shares
    assert sum(shares.values()) == pytest.approx(1.0)
    assert min(shares.values()) >= 0


def test_a_load_zero_that_is_off_is_found_under_its_prior_and_taken_off() -> None:
    """The record stands 80 Pa too high, two standard deviations; the prior holds part of it back."""
    found = _uncertain()
    test = found.curves[0].experiment
    facts = {"zero_sd_Pa": 40.0}
    off = replace(test, value=test.value + 80, facts=facts)
    curves, _ = refined_records(fit(weigh([off]), 1, thorough=False))
    moved = curves[0].experiment
    assert 40 < moved.facts["zero_moved_Pa"] < 80
    assert moved.value == pytest.approx(off.value - moved.facts["zero_moved_Pa"], rel=1e-12)
    assert f"load zero moved by {moved.facts['zero_moved_Pa']:+.2g} Pa" in moved_sentences(curves)[0]
    assert surprise(curves) == pytest.approx((moved.facts["zero_moved_Pa"] / 40) ** 2)
    again = fit(curves, 1, thorough=False)
    assert abs(again.law.mu_0_Pa - MU) < 0.5 * abs(fit(weigh([off]), 1, thorough=False).law.mu_0_Pa - MU)
    assert nuisance(again).mean == pytest.approx([-moved.facts["zero_moved_Pa"] / 40])


def test_an_unknown_drift_pools_those_measured_with_one_that_adds_up_to_the_noise() -> None:
    """sqrt((3^2 + 4^2)/2) mN/s of a measured 3 mN/s and of 0.08 N of noise over 20 s."""
    strain, time = np.linspace(-0.5, 0.0, 5)[::-1], np.linspace(0.0, 20.0, 5)
    one = Experiment("uniaxial", strain, 1e4 * strain, time, ("a",), facts={
        "area_mm2": 100.0, "drift_N_per_s": 3e-3, "drift_sd_N_per_s": 1e-5})
    other = Experiment("uniaxial", strain, 1e4 * strain, time, ("b",), facts={"area_mm2": 100.0, "load_noise_N": 0.08})
    both, said = with_drift([one, other])
    assert both[0].facts["drift_sd_N_per_s"] == 1e-5
    assert both[1].facts["drift_sd_N_per_s"] == pytest.approx(np.sqrt((3**2 + 4**2) / 2) * 1e-3)
    assert "0 ± 3.5 mN/s" in said[0]
    assert "other tests (1) and 4 mN/s" in said[0]


def test_shares_are_the_parts_of_the_variance() -> None:
    """A load zero that is known a million times better has no share; the order's share is form^2/sd^2."""
    found = _uncertain()
    test = found.curves[0].experiment
    facts = {"area_mm2": 500.0, "strain_zero_sd": 1e-3, "zero_sd_Pa": 4e-5}
    sure = fit(weigh([replace(test, facts=facts)]), 1, starts=1)
    told = linearised(sure)
    shares = {name.split(" of ")[0]: share for name, share in told.shares.items()}
    assert shares["the load zero"] < 1e-6
    assert shares["the contact point"] > shares["the load zero"]
    mu_0 = told.derived["mu_0_Pa"]
    assert told.shares["the order of the law"] == pytest.approx((mu_0.form / mu_0.sd) ** 2, rel=1e-6)
    assert f"{max(told.shares.values()):.0%}" in told.decisions[0]


def test_a_series_moves_the_stress_as_its_covariance_says() -> None:
    """Over its directions the effects add up to J C J', J the slopes of the rate-corrected stress in (g, tau)."""
    series, time = Prony([0.2, 0.1], [0.5, 20.0]), np.linspace(0.0, 30.0, 60)
    strain = np.linspace(0.0, -0.6, 60)
    record = Experiment("uniaxial", strain, _stress("uniaxial", strain), time, ("a",), 5.0)
    found = fit([with_history(curve, series) for curve in weigh([record])], 1, thorough=False)
    covariance = np.diag([1e-4, 4e-4, 1e-3, 1.0])
    covariance[0, 1] = covariance[1, 0] = -1e-4
    covariance[1, 3] = covariance[3, 1] = 0.016
    prony = SimpleNamespace(prony=series, covariance=covariance, further=None)
    known = nuisance(found, prony)  # pyright: ignore[reportArgumentType]

    def stress(g: np.ndarray, tau: np.ndarray) -> np.ndarray:
        curve = with_history(found.curves[0], Prony(g, tau))
        return curve.model(found.law) / curve.scale_Pa

    steps = 1e-6 * np.eye(4)
    slopes = np.column_stack([(stress(series.g + s[:2], series.tau_s + s[2:])
                               - stress(series.g - s[:2], series.tau_s - s[2:])) / 2e-6 for s in steps])
    expected = slopes @ covariance @ slopes.T
    assert known.effect.shape == (60, 4)
    assert known.effect @ known.effect.T == pytest.approx(expected, abs=0.02 * float(expected.max()))
    assert known.series is not None
    assert known.series @ known.series.T == pytest.approx(covariance, abs=1e-9)


@pytest.mark.parametrize(("mode", "strain", "stress", "end"), [
    ("shear", np.linspace(0.02, 0.8, 40), lambda e: np.expm1(60 * e), "high"),
    ("uniaxial", np.linspace(-0.6, -0.02, 40), lambda e: -np.expm1(-90 * e), "low")])
def test_an_exponent_at_its_bound_has_no_standard_error(mode, strain, stress, end) -> None:
    steep = fit(weigh([Experiment(mode, strain, stress(strain))]), 1, thorough=False)
    assert steep.law.alpha[0] == pytest.approx(getattr(allowed_exponents(steep.curves), end), abs=1e-3)
    found = standard_errors(steep)
    assert found["alpha_1"]["stderr"] is None
    assert found["mu_1_Pa"]["stderr"] is not None


def test_the_interval_of_a_stress_whose_slopes_overflow_when_squared_is_finite() -> None:
    law = Hyperfoam([10000.0, 20.0], [2.0, 25.0], [0.49, 0.49])
    about = Uncertainty({}, np.diag([100.0, 1.0, 1e-4, 1e-4]) ** 2, 50.0, law, (), 2.0, {}, ())
    found = intervals(about, lambda law: {"stress": float(nominal_stress(law, "volumetric", np.array([0.35]))[0])})
    assert 1e160 < found["stress"].sd < np.inf


def test_the_wide_prior_is_ten_exponents_a_hundred_moduli_and_a_uniform_nu(white: Fit) -> None:
    found = prior_precision(replace(white, nu_how="fit"))
    mu_0, width = float(white.law.mu_Pa.sum()), NU_BOUNDS[1] - NU_BOUNDS[0]
    assert found == pytest.approx(np.diag([(100 * mu_0) ** -2, 0.01, 12 / width**2]), rel=1e-12)
    assert prior_precision(white) == pytest.approx(found[:2, :2])
    two = replace(white, law=Hyperfoam([8e3, 4e3], [-2.0, 6.0], [0.1, 0.1]), nu_how="fit")
    along = [(100 * 12e3) ** -2] * 2 + [0.02, 0.01]  # the first exponent takes the second along
    assert np.diag(prior_precision(two)) == pytest.approx([*along, 12 / width**2], rel=1e-12)
    assert np.diag(prior_precision(replace(two, nu_how="fit-each"))) == pytest.approx([*along, *[12 / width**2] * 2])


@pytest.mark.parametrize("noise", [0.2, 1e-9])
def test_the_cost_of_one_standard_deviation_is_that_of_the_parameter_next_to_the_others(noise: float) -> None:
    """Var(x) |what no other slope follows|^2 with white errors, nuisances of unit prior; at least RESOLVED^2/n."""
    rng, n = np.random.default_rng(3), 40
    own, slopes, effect = rng.normal(size=n), rng.normal(size=(n, 2)), rng.normal(size=(n, 3))
    errors = [Errors(noise**2 * np.eye(n), np.arange(n), float(n), n)]
    cost = _direction(own, slopes, effect, errors, noise**2)
    every = np.column_stack([own, slopes, effect])
    prior = noise**2 * np.diag(np.r_[np.zeros(3), np.ones(3)])
    variance = noise**2 * np.linalg.inv(every.T @ every + prior)[0, 0]
    alone = own - slopes @ np.linalg.lstsq(slopes, own, rcond=None)[0]
    along, doubt, spread, unit = cost
    assert along @ along + doubt @ doubt == pytest.approx(1.0)
    assert spread == pytest.approx(noise**2, rel=1e-9)
    assert unit == pytest.approx(max(variance * alone @ alone, RESOLVED**2 / n), rel=1e-9)
    settled = _direction(own, slopes, effect, errors, noise**2, 3)[3]  # of a profile in which all nuisances are free
    assert settled == pytest.approx(max(noise**2, RESOLVED**2 / n), rel=1e-9)


def test_a_quantity_of_one_node_spreads_about_the_law_that_is_stated() -> None:
    """q = 3 mu, Student's law of scale 3 sd(mu) about the value of the stated law, not of the free fit."""
    free, about = (Hyperfoam([mu], [2.0], [0.1]) for mu in (1e4, 1.2e4))
    ridge = Ridge(free, (Node(free, np.diag([50.0**2, 0.0]), np.zeros(2), 0.0),), 1.0)
    found = mixed([ridge], about, 9.0, lambda law: ({"q": 3 * law.mu_Pa[0]}, {"q": np.array([3.0, 0.0])}))["q"]
    half = 150 * t.ppf(0.975, 9)
    assert (found.lo, found.hi) == (pytest.approx(3.6e4 - half, rel=1e-6), pytest.approx(3.6e4 + half, rel=1e-6))
    assert (found.sd, found.form) == (pytest.approx(150 * (9 / 7) ** 0.5), 0.0)


def test_nodes_on_both_sides_of_the_best_nu_are_moved_to_either_side(white: Fit, monkeypatch: pytest.MonkeyPatch
                                                                     ) -> None:
    """By the root of the cost over its unit, negative below; ln density as Student's of that root."""
    pull = np.array([2.0, -1.0])
    monkeypatch.setattr(nu_ridge, "_given", lambda *_: nu_ridge._Given(np.diag([9.0, 4.0]), pull, 0.5))
    laws = tuple(Hyperfoam([MU], [ALPHA], [nu]) for nu in (0.0, 0.1, 0.2))
    found = nu_ridge._nodes(white, Profile(np.array([0.0, 0.1, 0.2]), np.array([3.0, 1.0, 1.5]), laws,
                                           (white.curves,) * 3), np.zeros((1, 0)), [], 1.0, 0.5, 4.0)
    for node, root in zip(found, (-2.0, 0.0, 1.0), strict=True):
        assert node.shift == pytest.approx(root * pull)
        assert node.log_density == pytest.approx(-2.5 * np.log1p(root**2 / 4))
        assert node.covariance == pytest.approx(np.array([[5.0, 2.0], [2.0, 3.0]]))


def test_each_nu_of_a_profile_has_zeros_of_its_own() -> None:
    """They settle where the residual and their prior want them, which costs no more than zeros that are held."""
    law, sd = Hyperfoam([MU], [ALPHA], [0.2]), 3e-3
    tests = [Experiment(mode, strain, nominal_stress(law, mode, strain + sd) + NOISE_Pa * rng.normal(size=strain.size),
                        None, ("a",), facts={"strain_zero_sd": sd})
             for mode, strain, rng in (("uniaxial", np.linspace(-0.01, -0.5, 40), np.random.default_rng(1)),
                                       ("shear", np.linspace(0.01, 0.6, 40), np.random.default_rng(2)))]
    found = fit(weigh(tests), 1, "fit", thorough=False)
    variance = effective_variance(errors_of(found, nuisance(found).effect))

    def settle(records: tuple[Curve, ...], own: Hyperfoam) -> tuple[tuple[Curve, ...], float]:
        return settled_records(replace(found, law=own, curves=records, nu_how="given"), variance)

    free = profile(found.curves, found.law, variance, settle, lambda records: variance * surprise(records))
    held = profile(found.curves, found.law, variance, lambda records, _: (records, 0.0), lambda _: 0.0)
    both = [(free.cost[k], held.cost[held.nu == nu][0]) for k, nu in enumerate(free.nu) if nu in held.nu]
    assert len(both) >= 9
    assert all(own <= fixed * (1 + 1e-6) for own, fixed in both)
    moved = [records[0].experiment.facts["strain_zero_moved"] for records in free.records]
    assert moved[0] != pytest.approx(moved[-1], abs=0.5 * sd)
    counts = np.flatnonzero(free.cost < free.cost.min() + 16 * variance)  # four standard deviations of nu
    assert counts.size >= 5
    assert max(settle(free.records[k], free.laws[k])[1] for k in counts) < 0.1


def test_a_nu_of_a_term_counts_by_what_its_uniform_standard_deviation_changes(white: Fit) -> None:
    """Between its bounds, width / sqrt(12), by differences of the weighted stress."""
    law, sd, h = Hyperfoam([8e3, 4e3], [-2.0, 6.0], [0.1, 0.2]), (NU_BOUNDS[1] - NU_BOUNDS[0]) / 12**0.5, 1e-4
    found = _nu_effects(replace(white, law=law, nu_how="fit-each"))
    for k in range(2):
        high, low = (weighted_model(white.curves, replace(law, nu=law.nu + step * np.eye(2)[k])) for step in (h, -h))
        assert found[:, k] == pytest.approx(sd * (high - low) / (2 * h), rel=1e-4, abs=1e-7)
    assert _nu_effects(replace(white, law=law, nu_how="fit")).shape[1] == 0
