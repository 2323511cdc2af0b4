"""Resistance over cycles: its course is found again with honest errors, and one that is no exponential is named."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.stats import chi2

from matcal.reduction.electric.clock_alignment import Shift, shift_with_backlash, with_backlash
from matcal.reduction.electric.cyclic_resistance import (
    Turns,
    cycle_table,
    fit_history,
    settling_facts,
    settling_sentences,
    turning_points,
)


def _course(rng: np.random.Generator, sd: float, constant: float = 2.0, cycles: int = 10) -> Turns:
    k = np.arange(cycles + 1.0)
    return Turns(k, 1800 * (1 + 0.3 * np.exp(-k / constant)) + sd * rng.standard_normal(k.size), np.full(k.size, sd))


def test_course_and_its_errors() -> None:
    rng = np.random.default_rng(0)
    found = [fit_history(_course(rng, 3.0)) for _ in range(100)]
    z = np.array([[(c.first_Ohm - 2340) / c.sd[0], (c.settled_Ohm - 1800) / c.sd[1], (c.cycles - 2) / c.sd[2]]
                  for c in found if c is not None])
    spread = np.sqrt(np.mean(z**2, axis=0))
    print(f"rms z of R_0, R_inf, k_c: {spread.round(2)}")
    assert z.shape == (100, 3)
    assert np.all((spread > 0.7) & (spread < 1.25))


@pytest.mark.parametrize(("noise", "constant", "cycles"), [(12.0, 2.0, 10), (0.6, 1.3, 6), (40.0, 5.0, 25)])
def test_errors_are_those_of_least_squares(noise: float, constant: float, cycles: int) -> None:
    """By SciPy: of scatter where readings scatter more than is stated, else of what is stated."""
    stated = 3.0
    turns = replace(_course(np.random.default_rng(cycles), noise, constant, cycles), sd_Ohm=np.full(cycles + 1, stated))

    def course(k: np.ndarray, first: float, settled: float, scale: float) -> np.ndarray:
        return settled + (first - settled) * np.exp(-k / scale)

    p, covariance = curve_fit(course, turns.cycle, turns.resistance_Ohm, (2340, 1800, constant), turns.sd_Ohm,
                              absolute_sigma=noise < stated)
    found = fit_history(turns)
    assert found is not None
    assert (found.first_Ohm, found.settled_Ohm, found.cycles) == pytest.approx(tuple(p), rel=1e-4)
    assert found.sd == pytest.approx(tuple(np.sqrt(np.diag(covariance))), rel=1e-3)
    misfit = np.sum((course(turns.cycle, *p) - turns.resistance_Ohm) ** 2) / stated**2
    assert found.likely == pytest.approx(chi2.sf(misfit, cycles + 1 - 3), rel=1e-3, abs=1e-12)


def test_a_course_that_is_no_exponential_is_named() -> None:
    k = np.arange(11.0)
    wavy = Turns(k, 1800 + 100 * np.cos(k), np.full(11, 3.0))
    straight = Turns(k, 2000 - 10 * k, np.full(11, 3.0))
    peak = Turns(k[:-1] + 0.5, np.full(10, 2100.0), np.full(10, 3.0))
    assert any("no single exponential" in s for s in settling_sentences(settling_facts(wavy, peak)))
    assert any("has not settled" in s for s in settling_sentences(settling_facts(straight, peak)))
    few = Turns(k[:3], wavy.resistance_Ohm[:3], wavy.sd_Ohm[:3])
    assert any("Too few cycles" in s for s in settling_sentences(settling_facts(few, peak)))


def test_turning_points_are_read_where_the_strain_turns() -> None:
    phase = np.linspace(0, 5, 1001)
    strain = 0.05 * (1 - np.abs(1 - 2 * (phase % 1)))
    rest, peak = turning_points(strain, 1000 * (1 + 3 * strain))
    np.testing.assert_allclose(rest.resistance_Ohm, 1000, rtol=1e-9)
    np.testing.assert_allclose(peak.resistance_Ohm, 1150, rtol=1e-9)
    np.testing.assert_allclose(peak.cycle, np.arange(5) + 0.5)
    table = cycle_table(rest, peak)
    assert {v.size for v in table.values()} == {5}
    assert all(np.all(np.isfinite(v)) for v in table.values())
    with pytest.raises(ValueError, match="no whole cycle"):
        turning_points(np.linspace(0, 1, 100), np.ones(100))


def test_backlash_holds_the_strip_still_after_each_reversal() -> None:
    travel = np.array([0.0, 1.0, 2.0, 1.5, 1.0, 0.0, 0.3, 1.0])
    np.testing.assert_allclose(with_backlash(travel, 0.6), [0.0, 1.0, 2.0, 2.0, 1.6, 0.6, 0.6, 1.0])
    np.testing.assert_allclose(with_backlash(travel, 0.0), travel)


@pytest.mark.parametrize("slack", [0.0, 0.2e-3])
def test_shift_and_backlash_lie_within_their_errors(slack: float) -> None:
    time, shift, rng = np.arange(0, 1000, 0.2), 321.4, np.random.default_rng(4)
    travel = np.interp(time, np.arange(12) * 90.0 + 5, 4e-3 * (np.arange(12) % 2))
    pot = np.arange(1.03, 990, 0.5) + shift
    e = np.interp(pot - shift, time, with_backlash(travel, slack)) / 75e-3
    conductance = 5e-4 * (1 - 2 * e) / (1 + e) / (1 + 0.3 * np.exp(-(pot - shift) / 360))
    seen = conductance + 1.5e-6 * rng.standard_normal(pot.size)
    found, size, sd = shift_with_backlash(time, travel, 75e-3, pot, seen, Shift(shift + 0.4, 0.05, "a first guess"))
    print(f"slack {size * 1e3:.3f} +- {sd * 1e3:.3f} mm, shift off {found.seconds - shift:.3f} +- {found.sd_s:.3f} s")
    assert abs(size - slack) < 3 * sd < 0.3e-3
    assert abs(found.seconds - shift) < 3 * found.sd_s
