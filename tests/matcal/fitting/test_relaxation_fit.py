"""Prony fit: the ramp is modelled, the shape of the curve matters, its covariance covers, bad tests are refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from matcal.card import MaterialCard
from matcal.fitting.relaxation.hold_table import hold_of
from matcal.fitting.relaxation.record_thinning import thinned
from matcal.fitting.relaxation.relaxation_fit import SeriesRow, _allowed, fit_prony, preferred
from matcal.fitting.relaxation.slowest_time import _CHI_SQUARE
from matcal.laws.deformation_modes import hereditary_stress, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.posterior.prony_posterior import log_series, series_part, start_series
from matcal.record.cautions import cautions
from matcal.reduction.experiment import Experiment
from touchcal.number_words import with_error, within

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])
TIME = np.r_[np.linspace(0, 1, 101), 1 + np.geomspace(0.01, 180, 110)]


def hold(noise_Pa: float = 0.0, seed: int = 0, scale: float = 1.0, deepest: float = -0.8) -> Experiment:
    law = replace(TABLE_1, mu_Pa=scale * TABLE_1.mu_Pa, moduli="instantaneous")
    strain = deepest * np.minimum(TIME, 1.0)
    samples = np.maximum(1, np.gradient(TIME) / 0.01)
    noise = noise_Pa * np.random.default_rng(seed).normal(size=TIME.size) / np.sqrt(samples)
    return Experiment("relaxation", strain, hereditary_stress(law, SERIES, "uniaxial", TIME, strain) + noise, TIME,
                      ("relaxation.txt",), noise_Pa or 1.0, samples)


def test_exact_hold_gives_back_the_series_and_the_stiffness() -> None:
    found = fit_prony([hold(scale=1.3)], TABLE_1)
    np.testing.assert_allclose(found.prony.g, SERIES.g, rtol=1e-4)
    np.testing.assert_allclose(found.prony.tau_s, SERIES.tau_s, rtol=1e-4)
    assert found.amplitude[0] == pytest.approx(1.3, rel=1e-4)
    assert found.relative_rms[0] < 1e-6


def test_errors_of_noisy_holds_follow_their_covariance() -> None:
    truth = np.r_[SERIES.g, SERIES.tau_s]
    found = [fit_prony([hold(130.0, seed)], TABLE_1) for seed in range(12)]
    scores = np.array([(np.r_[f.prony.g, f.prony.tau_s] - truth) / np.sqrt(np.diag(f.covariance)) for f in found])
    assert np.abs(scores).max() < 4
    assert 0.6 < np.sqrt(np.mean(scores**2)) < 1.5


def test_without_a_law_the_recorded_ramp_shapes_the_curve() -> None:
    truth = np.r_[SERIES.g, SERIES.tau_s]
    found = [fit_prony([hold(60.0, seed)], None) for seed in range(4)]
    scores = np.array([(np.r_[f.prony.g, f.prony.tau_s] - truth) / np.sqrt(np.diag(f.covariance)) for f in found])
    assert np.abs(scores).max() < 3
    assert all(abs(f.prony.g[0] - SERIES.g[0]) < 0.02 for f in found)
    assert "recorded on the ramp itself shapes" in found[0].decisions[0]


def test_a_ramp_without_samples_leaves_the_fast_term_uncertain() -> None:
    whole = hold(60.0)
    kept = np.r_[0, 100:211]
    blind = replace(whole, strain=whole.strain[kept], value=whole.value[kept], time_s=TIME[kept],
                    samples=whole.samples[kept])
    found, known = fit_prony([blind], None), fit_prony([blind], TABLE_1)
    sd = np.sqrt(np.diag(found.covariance))
    assert abs(found.prony.g[0] - SERIES.g[0]) < 3 * sd[0]
    assert sd[0] > 5 * np.sqrt(known.covariance[0, 0])
    assert "what a bent curve would change is in the errors" in found.decisions[0]


def test_replicates_share_one_series() -> None:
    one, two = fit_prony([hold(130.0, 1)], TABLE_1), fit_prony([hold(130.0, 1), hold(130.0, 2, 1.2, -0.6)], TABLE_1)
    assert len(two.amplitude) == 2
    assert two.amplitude[1] == pytest.approx(1.2, rel=0.02)
    assert np.all(np.diag(two.covariance) < np.diag(one.covariance))


def test_uncertain_contact_and_drift_widen_the_covariance() -> None:
    plain = hold(130.0)
    doubted = replace(plain, facts={"strain_zero_sd": 0.005, "drift_sd_N_per_s": 1e-3, "area_mm2": 1963.0})
    sure, unsure = fit_prony([plain], TABLE_1), fit_prony([doubted], TABLE_1)
    assert unsure.covariance[2, 2] > 2 * sure.covariance[2, 2]
    np.testing.assert_allclose(unsure.prony.g, sure.prony.g)


@pytest.mark.parametrize(("change", "word"), [(dict(time_s=None), "time column"), (dict(strain=np.zeros(211)), "hold")])
def test_tests_without_clock_or_hold_are_refused(change: dict, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        fit_prony([replace(hold(), **change)], TABLE_1)


def history(series: Prony, time_s: np.ndarray, strain: np.ndarray, noise_Pa: float, **more: np.ndarray) -> Experiment:
    law = replace(TABLE_1, moduli="instantaneous")
    stress = hereditary_stress(law, series, "uniaxial", time_s, strain)
    return Experiment("relaxation", strain, stress + noise_Pa * np.random.default_rng(0).normal(size=time_s.size),
                      time_s, ("history.txt",), noise_Pa, **more)


def test_terms_are_chosen_by_the_information_criterion() -> None:
    found = fit_prony([hold(60.0)], TABLE_1, "auto")
    assert found.prony.g.size == 3
    assert [r.terms for r in found.orders] == [1, 2, 3, 4, 5]
    assert "by BIC" in found.decisions[0]
    with pytest.raises(ValueError, match="known: auto, 1 to 30"):
        fit_prony([hold(60.0)], TABLE_1, 31)


def test_ten_decades_of_times_in_one_series() -> None:
    truth = Prony([0.1] * 6, [1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6])
    time_s = np.r_[0, np.linspace(1e-5, 1e-4, 11), 1e-4 + np.geomspace(1e-5, 3e6, 400)]
    found = fit_prony([history(truth, time_s, -0.5 * np.minimum(time_s / 1e-4, 1), 0.5)], TABLE_1, "auto")
    np.testing.assert_allclose(found.prony.g, truth.g, rtol=0.02)
    np.testing.assert_allclose(found.prony.tau_s, truth.tau_s, rtol=0.02)


def stairs(law_of_ramp: bool = True) -> Experiment:
    """Three holds one after the other, with samples on the ramps or without."""
    rise = np.linspace(0.1, 2, 20) if law_of_ramp else np.array([2.0])
    time_s = np.concatenate([[0.0], *[100 * k + np.r_[rise, 2 + np.geomspace(0.05, 97, 60)] for k in range(3)]])
    strain = np.interp(time_s, [0, 2, 100, 102, 200, 202, 300], [0, -0.3, -0.3, -0.5, -0.5, -0.7, -0.7])
    held = ((time_s % 100 >= 2) & (time_s > 0)).astype(float)
    return history(SERIES, time_s, strain, 2.0, held=held)


def test_several_holds_in_one_history() -> None:
    found = fit_prony([stairs()], TABLE_1, 3)
    np.testing.assert_allclose(found.prony.g, SERIES.g, rtol=0.05)
    np.testing.assert_allclose(found.prony.tau_s, SERIES.tau_s, rtol=0.08)


def test_several_holds_without_a_law() -> None:
    found = fit_prony([stairs()], None, "auto")
    np.testing.assert_allclose(found.prony.g[1:], SERIES.g[1:], rtol=0.05)
    assert found.relative_rms[0] < 0.01
    few = fit_prony([stairs(law_of_ramp=False)], None, "auto")
    assert few.prony.g[-1] == pytest.approx(SERIES.g[-1], rel=0.2)
    assert few.relative_rms[0] < 0.01


def test_levels_that_the_law_misses_are_no_slow_relaxation() -> None:
    """Each hold has its own size: a law 5 % off between the levels leaves the times alone."""
    bent = replace(TABLE_1, mu_Pa=TABLE_1.mu_Pa * [1.0, 1.05, 1.0])
    found = fit_prony([stairs()], bent, "auto")
    assert found.slowest.hi_s is not None
    assert found.prony.g_infinity == pytest.approx(SERIES.g_infinity, rel=0.05)


def test_an_unbounded_term_gives_way_where_fewer_fit_nearly_as_well() -> None:
    rows = [SeriesRow(1, 0.01, 120.0), SeriesRow(2, 0.001, 14.0), SeriesRow(3, 0.001, 10.0)]
    assert preferred(rows, lambda terms: terms < 3) == 2
    assert preferred(rows, lambda terms: True) == 3
    assert preferred([rows[0], rows[2]], lambda terms: terms < 3) == 3


def test_a_short_hold_bounds_the_slowest_time_only_from_below() -> None:
    time_s = np.r_[np.linspace(0, 1, 101), 1 + np.geomspace(0.01, 20, 80)]
    short = fit_prony([history(SERIES, time_s, -0.8 * np.minimum(time_s, 1), 20.0)], TABLE_1)
    assert short.slowest.hi_s is None
    assert short.slowest.lo_s < SERIES.tau_s[-1]
    assert any("too short for the slowest time" in s for s in short.decisions)
    long = fit_prony([hold(60.0)], TABLE_1)
    assert long.slowest.hi_s is not None
    assert long.slowest.lo_s < SERIES.tau_s[-1] < long.slowest.hi_s < 3 * SERIES.tau_s[-1]


def test_a_hold_begins_where_the_ramp_ends() -> None:
    """One second of ramp, 180 s of hold after it."""
    found = hold_of(hold(), TABLE_1, 3)
    assert (found.ramp_s, found.hold_s) == (pytest.approx(1.0), pytest.approx(180.0))


def test_the_profile_ends_where_twice_the_log_likelihood_falls_by_the_95_percent_quantile() -> None:
    assert chi2.cdf(_CHI_SQUARE, 1) == pytest.approx(0.95, abs=2e-4)


def test_a_stress_that_does_not_relax_has_no_series() -> None:
    flat = fit_prony([history(Prony([0.0], [1.0]), TIME, -0.8 * np.minimum(TIME, 1), 20.0)], TABLE_1, "auto")
    assert flat.prony.g.tolist() == [0.0]
    assert "no relaxation was found" in flat.decisions[0]


@pytest.mark.parametrize("sign", [1, -1])
def test_noise_above_the_one_stated_is_no_relaxation(sign: int) -> None:
    """Twenty times the noise that the file states, and its mirror image: one of them falls by chance."""
    exact = history(Prony([0.0], [1.0]), TIME, -0.8 * np.minimum(TIME, 1), 0.0)
    noise = sign * 20 * np.random.default_rng(0).normal(size=TIME.size)
    assert fit_prony([replace(exact, value=exact.value + noise, noise=1.0)], TABLE_1, "auto").prony.g.tolist() == [0.0]


def test_few_points_carry_few_terms() -> None:
    time_s = np.r_[0, 1, 1 + np.geomspace(0.5, 100, 7)]
    few = history(SERIES, time_s, -0.5 * np.minimum(time_s, 1), 5.0)
    assert fit_prony([few], TABLE_1, "auto").prony.g.size <= 2
    with pytest.raises(ValueError, match="3 terms need 9"):
        fit_prony([few], TABLE_1, 3)
    enough = np.r_[time_s, 150.0]
    assert fit_prony([history(SERIES, enough, -0.5 * np.minimum(enough, 1), 5.0)], TABLE_1, 3).prony.g.size == 3


def test_a_long_record_is_thinned_to_means_that_keep_its_sums() -> None:
    """Two ramps of 500 samples become 60 means each, holds of 2,000 at most 120; each mean stands for its samples."""
    time_s = np.arange(5001) * 0.1
    strain = np.interp(time_s, [0, 50, 250, 300, 500], [0, -0.3, -0.3, -0.6, -0.6])
    held = ((time_s >= 50) & (time_s < 250) | (time_s >= 300)).astype(float)
    record = history(SERIES, time_s, strain, 5.0, held=held)
    few = thinned(record)
    assert few.held is not None
    assert few.samples is not None
    ramps = np.diff(np.flatnonzero(np.diff(np.r_[1.0, few.held, 1.0])))[::2]
    assert ramps.tolist() == [61, 60]
    assert few.samples.sum() == time_s.size
    assert few.samples @ few.value == pytest.approx(record.value.sum(), rel=1e-9)
    assert few.samples @ few.held == held.sum()
    assert 2 * 60 < few.held.sum() <= 2 * 120
    short = replace(record, strain=strain[:400], value=record.value[:400], time_s=time_s[:400], held=held[:400])
    assert thinned(short) is short


def test_a_curve_is_thinned_only_where_it_is_long() -> None:
    """Ten thousand points become about a thousand means with the same sums; three thousand stay."""
    strain = np.linspace(0, -0.5, 10_000)
    whole = Experiment("uniaxial", strain, nominal_stress(TABLE_1, "uniaxial", strain), np.linspace(0, 9, 10_000))
    few, kept = thinned(whole), replace(whole, strain=strain[:3000], value=whole.value[:3000], time_s=None)
    assert few.samples is not None
    assert 900 < few.value.size < 1200
    assert few.samples @ few.value == pytest.approx(whole.value.sum(), rel=1e-9)
    assert (few.strain[0], few.samples[0]) == (0.0, 1.0)
    assert thinned(kept) is kept


def test_terms_that_are_tried_have_points_and_room() -> None:
    """n terms need 2 n + 3 points of the shortest hold, and 2^n within the bounds of their times."""
    many, few = (SimpleNamespace(held=np.arange(200) < count) for count in (100, 8))
    for holds, bounds, most in (([many], (1.0, 2.0**3.5), 3), ([many], (0.1, 0.1 * 2.0**2.5), 2),
                                ([many, few], (1.0, 1e6), 2)):
        assert _allowed("auto", holds, bounds) == tuple(range(1, most + 1))  # pyright: ignore[reportArgumentType]
    assert _allowed(4, [few], (1.0, 2.0)) == (4,)  # pyright: ignore[reportArgumentType]


def test_an_unbounded_slow_term_is_the_first_caution_on_the_moduli() -> None:
    prony = {"tau_sd_s": [0.1, 900.0], "slowest_s": {"value": 800.0, "lo": 90.0, "hi": None}}
    card = MaterialCard("a", None, Prony([0.2, 0.1], [1.0, 800.0]), None, fit={"prony": prony}, stability={},
                        provenance={}, data="a.d", posterior={})
    assert cautions(card)[0].startswith("The long-term moduli are not determined by this record")
    prony["slowest_s"]["hi"] = 2000.0
    assert not any("not determined by this record" in s for s in cautions(card))


def test_a_value_keeps_two_digits_however_large_its_error() -> None:
    assert with_error(20790.0, 630000.0) == ("21000", "630000")
    assert within(10395.0, -616000.0, 637000.0)[0] == "10000"
    assert with_error(0.3, 8.0) == ("0.30", "8.0")
    assert with_error(1.2345, 0.012) == ("1.234", "0.012")


@pytest.mark.parametrize("share", [0.01, 1.0])
def test_free_sizes_do_not_let_the_noise_grow_without_end(share: float) -> None:
    found = fit_prony([hold(60.0)], None)
    part = series_part(found)
    start = start_series(part, found)
    louder = start + np.r_[np.zeros(start.size - 1), 1.0] * np.array([[0.0], [6.0], [9.0], [12.0]])
    assert np.all(np.diff(log_series(part, louder, share)) < 0)
