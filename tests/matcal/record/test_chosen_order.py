"""The order that is chosen: readable where one fits well enough, few terms for few points, and errors of the record
told from terms of the law."""

from dataclasses import replace

import numpy as np
import pytest

from matcal.card import MaterialCard
from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.hyperfoam.hyperfoam_fit import NEARLY, fit
from matcal.fitting.hyperfoam.order_selection import (
    ACCURATE,
    GOOD_ENOUGH,
    OrderRow,
    chosen_order,
    criterion,
    order_sentences,
)
from matcal.fitting.uncertainty.intervals import derived_quantities
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.record.cautions import cautions
from matcal.record.fit_summary import summary
from matcal.reduction.experiment import Experiment

TWO_TERMS = Hyperfoam([12000.0, 8000.0], [4.0, -1.5], [0.0, 0.0])


def curve(mode: str, strain: np.ndarray, noise: float = 0.0, seed: int = 0) -> Experiment:
    stress = nominal_stress(TWO_TERMS, mode, strain)
    scatter = noise * np.random.default_rng(seed).normal(size=strain.size)
    return Experiment(mode, strain, stress * (1 + scatter), source=(f"{mode}.csv",))


def row(order: int, rms: float, bic: float, collinearity: str = "", worst: float | None = None) -> OrderRow:
    return OrderRow(order, rms, rms if worst is None else worst, bic, collinearity)


def test_a_readable_order_that_fits_well_enough_is_taken_before_one_that_merges() -> None:
    good, merged = row(2, 0.034, -2000, worst=0.036), row(4, 0.012, -2600, "single moduli reach 50 times their sum")
    assert chosen_order([row(1, 0.051, -1800), good, merged]) is good
    said = order_sentences("auto", (good, merged), good, fit(weigh([curve("uniaxial", np.linspace(-0.6, 0, 40))]), 1,
                                                              thorough=False).optimum, 300)
    passed = next(s for s in said if "passed over" in s)
    assert "would fit to 1.20% instead of 3.40%" in passed
    assert "--order 4" in passed


def test_a_readable_order_that_misses_a_curve_is_not_taken() -> None:
    poor, merged = row(2, 0.04, -2000, worst=1.01 * GOOD_ENOUGH), row(3, 0.012, -2600, "exponents merge")
    assert chosen_order([poor, merged]) is merged
    assert chosen_order([row(2, 0.0125, -2000, worst=0.2), merged]).order == 2


def test_a_stable_order_that_fits_within_accuracy_is_taken_before_one_that_loses_stability_inside_the_tests() -> None:
    stable, lost = row(3, 0.0005, -4000), OrderRow(5, 0.0002, 0.0002, -5000, "", unstable=True)
    assert chosen_order([row(2, 0.02, -2000), stable, lost]) is stable
    poor = row(3, 0.0005, -4000, worst=1.01 * ACCURATE)
    assert chosen_order([poor, lost]) is lost
    said = order_sentences("auto", (stable, lost), stable, fit(weigh([curve("uniaxial", np.linspace(-0.6, 0, 40))]), 1,
                                                              thorough=False).optimum, 300)
    assert any("Order 5 was passed over" in s and "not Drucker stable inside the tests" in s for s in said)


def test_intervals_count_the_order_below_where_it_fits_nearly_as_well() -> None:
    """A smooth misfit of 1 % that order 3 halves no further than NEARLY: mu_0 of order 2 lies in order 3's interval."""
    e, g = np.linspace(-0.6, 0, 61), np.linspace(0, 0.8, 41)
    tests = [replace(test, value=test.value * (1 + 0.02 * np.sin(25 * test.strain)))
             for test in (curve("uniaxial", e), curve("shear", g))]
    found, below = (calibrate(tests, FitOptions(order=n)) for n in (3, 2))
    assert found.fit is not None
    assert below.fit is not None
    assert found.uncertainty is not None
    assert below.fit.optimum.cost < NEARLY**2 * found.fit.optimum.cost
    assert [law.alpha.size for law in found.fit.neighbours] == [4, 2]
    mu_0 = found.uncertainty.derived["mu_0_Pa"]
    assert mu_0.form >= abs(below.fit.law.mu_0_Pa - mu_0.value) * (1 - 1e-3)
    assert mu_0.lo < below.fit.law.mu_0_Pa < mu_0.hi
    assert "of this law" in summary(found)["intervals"]


def test_the_criterion_is_bic_for_many_points_and_dear_for_few() -> None:
    assert criterion(1e-4, 4, 10**5, 10**5) == pytest.approx(1e5 * np.log(1e-4) + 4 * np.log(1e5), rel=1e-6)
    assert criterion(1e-4, 6, 10, 10) - criterion(1e-4, 4, 10, 10) > 5 * 2 * np.log(10)


@pytest.mark.thorough
def test_five_points_a_curve_choose_two_terms_and_intervals_hold_the_truth() -> None:
    held = 0
    for seed in range(5):
        found = calibrate([curve("uniaxial", np.linspace(-0.7, -0.1, 5), 0.003, 2 * seed),
                           curve("shear", np.linspace(0.2, 1.0, 5), 0.003, 2 * seed + 1)])
        assert found.fit is not None
        assert found.uncertainty is not None
        assert found.fit.law.alpha.size <= 2
        assert any("10 different strains are few for" in s for s in found.decisions)
        mu_0 = found.uncertainty.derived["mu_0_Pa"]
        held += mu_0.lo < TWO_TERMS.mu_0_Pa < mu_0.hi
    assert held >= 4


def test_a_load_zero_from_one_reading_is_no_term_of_the_law() -> None:
    strain, area, sd = np.linspace(-0.6, -0.005, 150), 1963.0, 0.05
    rng = np.random.default_rng(3)
    value = nominal_stress(TWO_TERMS, "uniaxial", strain) + 25.0 + 15 * rng.normal(size=strain.size)
    test = Experiment("uniaxial", strain, value, source=("zero.csv",), noise=15.0)
    known = replace(test, facts={"zero_sd_Pa": sd / (area * 1e-6), "area_mm2": area, "load_noise_N": sd})
    aware = calibrate([known])
    assert aware.fit is not None
    assert aware.uncertainty is not None
    assert aware.fit.law.alpha.size == 2
    for name, truth in derived_quantities(TWO_TERMS).items():
        interval = aware.uncertainty.derived[name]
        assert interval.lo < truth < interval.hi
    moved = aware.fit.curves[0].experiment.facts["zero_moved_Pa"]
    assert moved == pytest.approx(25.0, abs=10)
    assert any("load zero moved by" in s for s in aware.decisions)


def test_a_plateau_that_no_test_reached_is_left_out_and_said() -> None:
    found = calibrate([curve("uniaxial", np.linspace(-0.2, -0.005, 60), 0.002)], FitOptions(order=1))
    assert found.uncertainty is not None
    assert set(found.uncertainty.derived) == {"mu_0_Pa", "E_0_Pa"}
    assert any("plateau_Pa is left out" in s for s in found.decisions)


@pytest.mark.thorough
def test_moduli_on_their_bound_are_warned_of_with_the_safer_command() -> None:
    strain = np.linspace(-0.6, -0.005, 60)
    toe = Experiment("uniaxial", strain, -1e5 * strain**2 * (1 + 10 * strain**2), source=("toe.csv",))
    found = calibrate([toe])
    assert found.fit is not None
    assert found.fit.optimum.unbounded is not None
    assert any("where no linearisation holds" in s for s in found.decisions)
    card = MaterialCard("toe", found.fit.law, None, None, fit=summary(found), stability={}, provenance={}, data="",
                        posterior={})
    warned = " ".join(cautions(card))
    assert "Outside the tests --order" in warned


def test_scatter_between_specimens_is_not_misfit() -> None:
    strain = np.linspace(-0.7, -0.01, 80)
    tests = [replace(e := curve("uniaxial", strain, 0.002, k), value=factor * e.value)
             for k, factor in enumerate((0.9, 1.0, 1.1))]
    found = calibrate(tests)
    assert found.fit is not None
    assert found.uncertainty is not None
    assert found.fit.law.alpha.size == 2
    np.testing.assert_allclose([c.factor for c in found.fit.curves],
                               np.array([0.9, 1.0, 1.1]) / np.cbrt(0.99), rtol=2e-3)
    mu_0, shares = found.uncertainty.derived["mu_0_Pa"], found.uncertainty.shares
    assert mu_0.value == pytest.approx(TWO_TERMS.mu_0_Pa * np.cbrt(0.99), rel=0.02)
    assert 0.12 < (mu_0.hi - mu_0.lo) / 2 / mu_0.value < 0.25
    assert shares["scatter between specimens"] > 0.8
    row = summary(found)["uniaxial_1"]
    assert row["relative_rms"] > 0.08
    assert row["relative_rms_of_specimen"] < 0.004


def test_more_specimens_pin_the_mean_foam_better() -> None:
    strain, widths = np.linspace(-0.7, -0.01, 40), []
    for factors in ((0.95, 1.05), (0.93, 0.97, 1.0, 1.03, 1.07)):
        found = calibrate([replace(e := curve("uniaxial", strain, 0.002, k), value=factor * e.value)
                           for k, factor in enumerate(factors)], FitOptions(order=2))
        assert found.uncertainty is not None
        mu_0 = found.uncertainty.derived["mu_0_Pa"]
        widths.append((mu_0.hi - mu_0.lo) / mu_0.value)
    assert widths[1] < 0.7 * widths[0]


def test_no_term_follows_the_rounding_of_an_exact_record() -> None:
    strain = np.linspace(-0.7, 0, 60)
    stress = nominal_stress(Hyperfoam([8000.0, 3000.0], [8.0, -1.0], [0.0, 0.0]), "uniaxial", strain)
    found = calibrate([Experiment("uniaxial", strain, stress)])
    assert found.fit is not None
    assert found.fit.law.mu_Pa.size == 2
