"""The relaxation fit against dense formulas: every sample, columns by convolution, least squares and profiles by numpy.
"""

import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from matcal.fitting.relaxation import relaxation_fit
from matcal.fitting.relaxation.further_term import _ordered
from matcal.fitting.relaxation.hold_table import Hold, HoldTable, hold_of, tabulate_hold
from matcal.fitting.relaxation.instantaneous_curve import bent, of_law, of_ramp, runs
from matcal.fitting.relaxation.prony_search import LEAST_RATIO, best_series, search_series, series_at, vector_of
from matcal.fitting.relaxation.relaxation_fit import SeriesRow, fit_prony, preferred
from matcal.fitting.relaxation.slowest_time import slowest_time
from matcal.laws.deformation_modes import hereditary_stress, second_piola
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, convolve
from matcal.reduction.experiment import Experiment
from matcal.statistics.residual_correlation import Errors, integrated_autocorrelation_time

LAW = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "instantaneous")
SERIES = Prony([0.2, 0.1], [0.5, 12.0])
TIME = np.r_[np.linspace(0, 1, 25), 1 + np.geomspace(0.05, 60, 60)]
BOUNDS = (0.1, 1200.0)


def record(noise_Pa: float = 0.0, seed: int = 0, deepest: float = -0.5, series: Prony = SERIES,
           **more: Any) -> Experiment:
    """A ramp of 1 s and a hold of 60 s, its noise stated as 50 Pa a sample and as less for means."""
    strain = deepest * np.minimum(TIME, 1.0)
    noise = noise_Pa * np.random.default_rng(seed).normal(size=TIME.size)
    return Experiment("relaxation", strain, hereditary_stress(LAW, series, "uniaxial", TIME, strain) + noise, TIME,
                      ("hold.txt",), 50.0, **{"samples": 1 + np.arange(TIME.size) % 3, **more})


def dense(hold: Hold, series: Prony) -> np.ndarray:
    """(n_seen, K) weighted nominal stress of the columns under a series."""
    seen = hold.precision > 0
    return (hold.precision * hold.push)[seen, None] * convolve(series, hold.fine_s, hold.instantaneous)[hold.at[seen]]


def target(hold: Hold) -> np.ndarray:
    return (hold.precision * hold.stress_Pa)[hold.precision > 0]


def miss(hold: Hold, series: Prony) -> np.ndarray:
    """Weighted residual with the sizes of the columns solved for."""
    columns = dense(hold, series)
    return columns @ np.linalg.lstsq(columns, target(hold))[0] - target(hold)


def with_table(experiment: Experiment, law: Hyperfoam | None = LAW) -> tuple[Hold, HoldTable]:
    hold = hold_of(experiment, law, 2)
    return hold, tabulate_hold(hold, BOUNDS)


def white(variance: float, count: int, effective: float) -> Errors:
    return Errors(variance * np.eye(count), np.arange(count), effective, count)


@pytest.mark.parametrize("law", [LAW, None])
def test_a_table_keeps_every_column_at_every_time(law: Hyperfoam | None) -> None:
    """Also between the times that it tabulates, and further vectors, one of them zero."""
    hold = hold_of(record(50.0), law, 2)
    more = np.random.default_rng(0).normal(size=(np.count_nonzero(hold.precision), 2)) * [1.0, 0.0]
    table = tabulate_hold(hold, BOUNDS, more)
    np.testing.assert_allclose(table.basis.T @ table.basis, np.eye(table.basis.shape[1]), atol=1e-12)
    np.testing.assert_allclose(table.basis @ table.target, target(hold), rtol=1e-9)
    np.testing.assert_allclose(table.basis @ table.more, more, atol=1e-9)
    for tau in (0.1, 0.11, 0.73, 9.1, 333.0, 1200.0):
        series = Prony([0.3], [tau])
        unit = table.unit(np.log([[tau]]), np.array([[0.3 / 0.7]]))[0]
        expected = dense(hold, series) / series.g_infinity
        np.testing.assert_allclose(table.basis @ unit, expected, atol=3e-7 * np.abs(expected).max())


def test_a_hold_weighs_by_samples_and_noise_and_refines_its_ramp() -> None:
    """No step of the strain is longer than a fiftieth of the largest; without a stated noise it is a thousandth of the
    largest stress, and without a stress one."""
    experiment = record()
    hold = hold_of(experiment, LAW, 2)
    assert experiment.samples is not None
    np.testing.assert_allclose(hold.precision, np.where(TIME >= 1 - 1e-9, np.sqrt(experiment.samples) / 50.0, 0.0))
    np.testing.assert_array_equal(hold.fine_s[hold.at], TIME)
    assert np.all(np.diff(hold.fine_s) > 0)
    steps = np.diff(np.interp(hold.fine_s, TIME, experiment.strain)) / -0.5
    assert 0.0138 < steps.max() <= 0.02 + 1e-12  # 1/24 a sample, cut into three
    peak = float(np.abs(experiment.value).max())
    for value, noise in ((experiment.value, 1e-3 * peak), (np.zeros(TIME.size), 1.0)):
        silent = hold_of(replace(experiment, noise=None, samples=None, value=value), LAW, 2)
        assert silent.precision.max() == pytest.approx(1 / noise)
    ramp = hold_of(experiment, None, 2)
    assert (ramp.shape, np.flatnonzero(ramp.precision == 0).tolist()) == ("ramp", [0])


def stairs() -> tuple[np.ndarray, np.ndarray]:
    """Strain of three ramps and holds, the last two at one level but for 1 %, and what is held."""
    strain = np.repeat([0.2, 0.4, 0.404], 20) * np.tile(np.minimum(np.arange(1, 21) / 10, 1.0), 3)
    strain[20:40], strain[40:] = np.maximum(strain[20:40], 0.2), 0.404
    strain[20:30] = np.linspace(0.22, 0.4, 10)
    held = np.zeros(60, dtype=bool)
    held[10:20], held[30:40], held[42:] = True, True, True
    return strain, held


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_law_is_cut_at_the_levels_that_are_held(sign: float) -> None:
    """The pieces add up to the law; each rises only between its own two levels."""
    strain, held = stairs()
    columns = of_law(LAW, sign * strain, held)
    np.testing.assert_allclose(columns.sum(axis=1), second_piola(LAW, "uniaxial", sign * strain)[:, 0], rtol=1e-12)
    assert columns.shape[1] == 2
    assert np.all(columns[strain <= 0.2, 1] == 0)
    assert np.ptp(columns[strain >= 0.2, 0]) == pytest.approx(0.0, abs=1e-9)
    assert [(r.start, r.stop) for r in runs(held, sign * strain)] == [(10, 20), (30, 40), (42, 60)]
    few, shaped = of_ramp(sign * strain, held, np.array([0, 15, 35, 50]))
    assert not shaped
    np.testing.assert_allclose(few.sum(axis=1), strain)
    np.testing.assert_allclose(few[strain <= 0.2, 1], 0.0, atol=1e-12)
    curved = bent(few)
    np.testing.assert_allclose(curved, np.sqrt(few * few.max(axis=0)))


@pytest.mark.parametrize(("difference", "levels"), [(0.019, 1), (0.021, 2), (0.03, 2)])
def test_holds_within_a_fiftieth_of_the_strain_are_at_one_level(difference: float, levels: int) -> None:
    """Of neighbours that are held without a ramp between them, and of holds with one."""
    strain = 0.4 * np.r_[0.0, 0.5, np.full(5, 1 - difference), np.ones(5)]
    assert len(runs(strain > 0.3, strain)) == levels
    strain = np.r_[strain[:7], 0.4 * (1 - difference / 2), strain[7:]]
    held = (strain > 0.3) & (np.arange(13) != 7)
    assert of_ramp(strain, held, np.array([1]))[0].shape[1] == levels


@pytest.mark.parametrize(("samples", "sizes"), [(40, 9), (60, 10), (13, 3)])
def test_a_ramp_of_enough_samples_shapes_a_spline_through_the_origin(samples: int, sizes: int) -> None:
    """One size for four samples on the ramp, ten at most; it follows a cubic."""
    travel = 0.5 * np.minimum(np.arange(2 * samples) / samples, 1.0)
    columns, shaped = of_ramp(-travel, travel == 0.5, np.arange(2 * samples))
    assert shaped
    assert columns.shape == (2 * samples, sizes)
    np.testing.assert_allclose(columns[0], 0.0, atol=1e-12)
    curve = travel - 3 * travel**2 + 2 * travel**3
    np.testing.assert_allclose(columns @ np.linalg.lstsq(columns, curve)[0], curve, atol=1e-12)


def test_the_criterion_is_that_of_correlated_residuals() -> None:
    """BIC = n ln(rms^2/n) + 2 M ln n, n = sum count/tau over the residuals of the best; residuals below 1e-4 of the
    stress count as such."""
    pairs = [with_table(record(50.0, 1)), with_table(record(80.0, 2, -0.3))]
    holds, tables = [h for h, _ in pairs], [t for _, t in pairs]
    tried = {1: vector_of(Prony([0.25], [2.0])), 2: vector_of(SERIES)}
    count, size = sum(target(h).size for h in holds), sum(float(target(h) @ target(h)) for h in holds)
    misses = {n: [miss(h, series_at(v)) for h in holds] for n, v in tried.items()}
    worth = sum(m.size / integrated_autocorrelation_time(m) for m in misses[2])
    for row in relaxation_fit._rows(tables, tried):
        square = sum(float(m @ m) for m in misses[row.terms])
        assert row.rms == pytest.approx(np.sqrt(square / size), rel=1e-6)
        assert row.bic == pytest.approx(worth * np.log(square / count) + 2 * row.terms * np.log(worth), rel=1e-6)
    hold, table = with_table(record())
    (exact,) = relaxation_fit._rows([table], {2: vector_of(SERIES)})
    worth, square = target(hold).size, float(target(hold) @ target(hold))
    own = integrated_autocorrelation_time(table.basis @ (relaxation_fit.residual([table], vector_of(SERIES))))
    assert exact.bic == pytest.approx(worth / own * np.log(1e-8 * square / worth) + 4 * np.log(worth / own), rel=1e-6)


def test_fewer_terms_are_preferred_up_to_a_difference_of_ten() -> None:
    for difference, chosen in ((9.9, 2), (10.1, 3)):
        rows = [SeriesRow(2, 0.1, difference), SeriesRow(3, 0.1, 0.0)]
        assert preferred(rows, lambda terms: terms < 3) == chosen


def test_the_covariance_is_the_gain_on_noise_and_doubts() -> None:
    """G E G' + G d d' G' with G the pseudo-inverse of the dense slopes in (sizes, g, tau)."""
    pairs = [with_table(record()), with_table(record(deepest=-0.3))]
    holds = [h for h, _ in pairs]
    counts = [target(h).size for h in holds]
    errors = [white(2.0, counts[0], 10.0), white(0.5, counts[1], 10.0)]
    doubts = [np.linspace(0, 1, counts[0])[:, None], np.zeros((counts[1], 0))]

    def model(at: np.ndarray) -> np.ndarray:
        return np.concatenate([c * dense(h, Prony(at[2:4], at[4:])).sum(axis=1)
                               for c, h in zip(at, holds, strict=False)])

    at = np.r_[1.0, 1.0, SERIES.g, SERIES.tau_s]
    steps = np.diag(1e-5 * at)
    gain = np.linalg.pinv(np.stack([(model(at + s) - model(at - s)) / (2 * s.sum()) for s in steps], axis=1))[2:]
    noise = np.diag(np.repeat([2.0, 0.5], counts))
    noise[:counts[0], :counts[0]] += doubts[0] @ doubts[0].T
    found = relaxation_fit._covariance([t for _, t in pairs], doubts, errors, vector_of(SERIES))
    np.testing.assert_allclose(found, gain @ noise @ gain.T, rtol=1e-3, atol=1e-6 * np.abs(found).max())


def test_doubts_are_what_one_standard_deviation_changes() -> None:
    """The contact moves every strain but zero, the drift adds its stress, and each is over the noise of its point."""
    facts = {"strain_zero_sd": 1e-3, "drift_sd_N_per_s": 2e-3, "area_mm2": 500.0}
    experiment = record(facts=facts)
    hold = hold_of(experiment, LAW, 2)
    contact, drift = relaxation_fit._doubts(experiment, hold, LAW, SERIES).T
    seen = hold.precision > 0
    np.testing.assert_allclose(drift, -(hold.precision * 2e-3 / 500e-6 * TIME)[seen], rtol=1e-6)
    strain = np.where(experiment.strain == 0, 0.0, experiment.strain + 1e-3)
    change = hereditary_stress(LAW, SERIES, "uniaxial", TIME, strain) - experiment.value
    np.testing.assert_allclose(contact, (hold.precision * change)[seen], rtol=0.01)


def test_a_ramp_without_shape_is_in_doubt_by_a_bent_one() -> None:
    """Columns e and sqrt(e e_max), each with its own size."""
    whole, kept = record(20.0), np.r_[0, 24:85]
    assert whole.samples is not None
    blind = replace(whole, strain=whole.strain[kept], value=whole.value[kept], time_s=TIME[kept],
                    samples=whole.samples[kept])
    hold = hold_of(blind, None, 2)
    travel = np.minimum(hold.fine_s, 1.0) * 0.5
    straight, curved = (replace(hold, instantaneous=c[:, None]) for c in (travel, np.sqrt(0.5 * travel)))
    assert hold.shape == "straight"
    (found,) = relaxation_fit._doubts(blind, hold, None, SERIES).T
    np.testing.assert_allclose(found, miss(curved, SERIES) - miss(straight, SERIES), rtol=1e-6, atol=1e-9)


def test_errors_are_those_stated_at_least_and_belong_to_their_own_test() -> None:
    """An exact record keeps the noise that it states; two records exchanged exchange their errors."""
    pairs = [with_table(record(60.0, 1)), with_table(record(20.0, 2, -0.3))]
    doubts = [np.column_stack([np.sin(TIME[h.precision > 0]) * size, np.ones(target(h).size)][:columns])
              for (h, _), size, columns in zip(pairs, (0.3, 2.0), (1, 2), strict=True)]
    tables = [t for _, t in pairs]
    one = relaxation_fit._errors(tables, doubts, vector_of(SERIES))
    other = relaxation_fit._errors(tables[::-1], doubts[::-1], vector_of(SERIES))
    for a, b in zip(one, other[::-1], strict=True):
        np.testing.assert_allclose(a.covariance, b.covariance, rtol=0.02, atol=1e-3 * a.covariance[0, 0])
        assert a.effective_sample_size == pytest.approx(b.effective_sample_size, rel=0.02)
    exact, table = with_table(record())
    (stated,) = relaxation_fit._errors([table], [np.zeros((target(exact).size, 0))], vector_of(SERIES))
    assert stated.covariance[0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("noise_Pa", [10.0, 400.0])
@pytest.mark.parametrize("uneven", [False, True])
def test_a_hold_falls_by_four_standard_errors_of_a_line_in_log_time(noise_Pa: float, uneven: bool) -> None:
    """The slope's error is that of the stated noise, or of the scatter about the line where that is larger."""
    plain = record(series=Prony([0.0], [1.0]))
    hold = hold_of(replace(plain, samples=plain.samples if uneven else None), LAW, 2)
    (run,) = runs(hold.held, hold.push)
    y, p = np.abs(hold.stress_Pa[run]), hold.precision[run]
    late = np.log1p(hold.time_s[run] - hold.time_s[run.start - 1])
    y = y + noise_Pa * np.random.default_rng(3).normal(size=y.size) / (50 * p)

    def score(stress: np.ndarray) -> float:
        fit, scaled = np.polyfit(late, stress, 1, w=p, cov="unscaled")
        scatter = np.sqrt(np.mean((p * (stress - np.polyval(fit, late))) ** 2))
        return float(-fit[0] / np.sqrt(scaled[0, 0]) / max(1.0, scatter))

    for wanted, falls in ((3.9, False), (4.1, True), (40.0, True), (-4.1, False)):
        slope = brentq(lambda s, wanted=wanted: score(y - s * late) - wanted, -1e5, 1e5)
        stress = hold.stress_Pa.copy()
        stress[run] = -(y - slope * late)
        assert relaxation_fit._flat([replace(hold, stress_Pa=stress)]) is not falls


@pytest.mark.parametrize(("ramp_s", "first_s", "hold_s", "shortest_s"), [
    (10.0, 0.02, 100.0, 1.0), (10.0, 3.0, 100.0, 3.0), (0.0, 0.5, 100.0, 0.5), (1000.0, 1.0, 100.0, 25.0),
    (0.1, 5.0, 100.0, 0.1)])
def test_times_are_searched_from_a_tenth_of_the_ramp_to_twenty_holds(ramp_s: float, first_s: float, hold_s: float,
                                                                     shortest_s: float) -> None:
    hold: Any = SimpleNamespace(last_ramp_s=ramp_s, hold_s=hold_s, precision=np.ones(4),
                                time_s=ramp_s + np.r_[0, first_s, 9 * first_s, hold_s])
    assert relaxation_fit._time_bounds([hold]) == (pytest.approx(shortest_s), pytest.approx(20 * hold_s))


def test_results_follow_from_the_series_that_was_found() -> None:
    found = fit_prony([record(50.0)], LAW, 2)
    hold = found.holds[0]
    left = (found.stress_Pa[0] - hold.stress_Pa)[hold.held]
    assert found.relative_rms[0] == pytest.approx(np.sqrt(np.mean(left**2) / np.mean(hold.stress_Pa[hold.held] ** 2)))
    columns = dense(hold, found.prony).sum(axis=1)
    assert found.amplitude[0] == pytest.approx(columns @ target(hold) / (columns @ columns))
    np.testing.assert_allclose((hold.precision * found.stress_Pa[0])[hold.held] - target(hold), miss(hold, found.prony))
    flat = fit_prony([record(series=Prony([0.0], [1.0]))], LAW)
    assert flat.prony.tau_s[0] ** 2 == pytest.approx(np.prod(flat.bounds_s))
    assert 0 <= flat.cpu_s + found.cpu_s < time.process_time()
    assert (found.decisions[0][:5], flat.slowest.hi_s) == ("Prony", None)


@pytest.mark.parametrize(("series", "doubted"), [(Prony([0.2], [8.0]), False), (Prony([0.2], [8.0]), True),
                                                 (SERIES, False)])
def test_the_slowest_time_ends_where_its_profile_has_risen_by_the_quantile(series: Prony, doubted: bool) -> None:
    """Twice the log likelihood, all other numbers at their best, by dense least squares on an exact record; a doubt is
    one more column with a standard normal size."""
    terms, inflation = series.g.size, 2.0 * 1.5
    hold, table = with_table(record(series=series))
    doubt = 1.5 * np.sin(0.1 * TIME[hold.held])[:, None] * np.ones((1, int(doubted)))
    vector = best_series([table], terms, BOUNDS, hold.hold_s)
    found = slowest_time([table], [doubt], vector, BOUNDS, [white(2.0, target(hold).size, target(hold).size / 1.5)])
    inner = np.linalg.inv(np.eye(target(hold).size) + doubt @ doubt.T / inflation)

    def profile(log_tau: float) -> float:
        _, here = search_series([table], vector_of(series), BOUNDS, log_tau)
        left = miss(hold, series_at(here)) / np.sqrt(inflation)
        return float(left @ inner @ left)

    best = np.log(found.tau_s)
    assert best == pytest.approx(vector[:terms].sum())
    end = profile(best) + 3.8415
    first = np.log(BOUNDS[0]) + np.log(LEAST_RATIO) * (terms - 1)
    low, high = (brentq(lambda x: profile(x) - end, a, b, xtol=1e-3)
                 for a, b in ((first, best), (best, np.log(BOUNDS[1]))))
    assert found.hi_s is not None
    assert np.log(found.lo_s) == pytest.approx(low, abs=6e-3)
    assert np.log(found.hi_s) == pytest.approx(high, abs=6e-3)


def test_slopes_are_those_of_a_cubic() -> None:
    """Central differences of x^3, y^3 and x y: exact to the square of the step."""
    found = relaxation_fit.slopes(lambda v: np.array([v[0] ** 3, v[1] ** 3, v[0] * v[1]]), np.array([2.0, -1.0]))
    np.testing.assert_allclose(found, [[12, 0], [0, 3], [-1, 2]], atol=1e-8)


def test_a_first_time_that_nothing_determines_stays_within_the_search() -> None:
    """Where a step in the vector of a series takes ln tau_1 far below it, which ended in a time of 0; others stay."""
    law = series_at(_ordered(np.array([-900.0, 895.0, 3.0, 0.2, -0.1, 0.3]), float(np.log(1e-3))))
    np.testing.assert_allclose(law.tau_s, [1e-3, np.exp(-5), np.exp(-2)])
    assert np.all(law.g >= 0)
