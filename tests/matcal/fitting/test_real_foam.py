"""A real running-shoe foam: combined fits in every mode, stability named, tension predicted and its error stated."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from matcal.fitting.calibrate import FittedLaws, calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.hyperfoam.cross_prediction import unstable_within
from matcal.fitting.hyperfoam.hyperfoam_fit import relative_rms
from matcal.reduction.reduce import reduce_tests

FOLDER = Path(__file__).parents[4] / "shared" / "rawsamples" / "foam_leap"
pytestmark = pytest.mark.skipif(not FOLDER.exists(), reason="third-party files are not here")
KIND = {"UC": "uniaxial", "UT": "uniaxial", "SS": "shear"}


def calibrated(fitted: str, kept_out: str = "", **choices: Any) -> FittedLaws:
    def tests(names: str) -> list:
        return reduce_tests([(KIND[n], (FOLDER / f"foam_leap_{n}.csv",)) for n in names.split()])

    return calibrate(tests(fitted), FitOptions(**choices), tests(kept_out))


@pytest.mark.parametrize("order", ["auto", 2])
def test_compression_and_shear_are_fitted_under_4_percent_each(order: int | str) -> None:
    found = calibrated("UC SS", "UT", order=order)
    assert found.fit is not None
    shares = [relative_rms(found.fit.law, c) for c in found.fit.curves]
    tension = found.predicted[0].relative_rms
    print(f"order {found.fit.law.alpha.size}: UC, SS {shares}, UT predicted {dict(tension)}")
    assert max(shares) < 0.04
    assert found.fit.alone["uniaxial"].relative_rms["shear"] > 0.3
    assert np.abs(found.fit.law.alpha).max() <= 25
    lost = unstable_within(found.fit.law, found.fit.curves)
    assert lost or any("Drucker stable and strongly elliptic along all fitted tests" in d for d in found.decisions)
    assert tension["combined"] > 0.5
    assert set(tension) == {"combined", "uniaxial alone", "shear alone"}
    assert any("foam_leap_UT.csv" in d and "by the combined law" in d for d in found.decisions)


@pytest.mark.thorough
def test_tension_among_the_data_costs_compression_and_nu_ends_at_its_bound() -> None:
    without, fitted = (calibrated("UC SS UT", order=3, poisson=nu).fit for nu in (0.0, "fit"))
    assert without is not None
    assert fitted is not None
    print("nu = 0", [relative_rms(without.law, c) for c in without.curves],
          "nu", fitted.law.nu[0], [relative_rms(fitted.law, c) for c in fitted.curves])
    assert 0.05 < np.sqrt(without.optimum.cost) < 0.12
    assert fitted.optimum.cost < without.optimum.cost
    assert any("stopped at that bound" in d for d in fitted.decisions)


def test_the_toe_of_compression_leaves_a_positive_modulus() -> None:
    found = calibrated("UC", order=4).fit
    assert found is not None
    assert found.law.mu_0_Pa > 0
    assert any("mu_0 is not positive" in d or "single moduli exceed" in d for d in found.decisions)
    assert any("no cross prediction is possible" in d for d in found.decisions)


def test_stability_held_is_stated_with_its_cost() -> None:
    found = calibrated("UC SS", order=2, stable="elliptic", stable_range=(0.4, 1.3))
    assert found.fit is not None
    assert found.fit.free is not None
    assert any("held elliptic stable at every combination of principal stretches from 0.4 to 1.3" in d
               for d in found.decisions)
