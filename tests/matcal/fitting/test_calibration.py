"""The synthetic machine files give back the truth that they were made from, within the errors that are stated."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from matcal.fitting.calibrate import FittedLaws, calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.hyperfoam.hyperfoam_fit import relative_rms
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.reduction.reduce import reduce_tests

DATA = Path(__file__).parents[3] / "data_raw"
TRUTH = json.loads((DATA / "truth.json").read_text())
MU_0_PA = 1e3 * TRUTH["longterm"]["mu_0_kPa"]


@pytest.fixture(scope="module")
def machine() -> FittedLaws:
    inputs = [(None, (DATA / f"mts_{kind}.txt",)) for kind in ("uniaxial", "shear", "relaxation")]
    skin = ("conductivity", (DATA / "mts_stretch.txt", DATA / "nova_stretch.txt"))
    found = calibrate(reduce_tests([*inputs, skin], DATA / "specimen.toml"))
    print(f"calibration: CPU {found.cpu_s}")
    return found


@pytest.fixture(scope="module")
def plain() -> FittedLaws:
    return calibrate(reduce_tests([(None, (DATA / "uniaxial.csv",)), (None, (DATA / "shear.csv",))]))


@pytest.mark.thorough
def test_mu_0_is_within_5_percent_and_inside_its_own_interval(machine: FittedLaws, plain: FittedLaws) -> None:
    for found in (machine, plain):
        interval = found.uncertainty.derived["mu_0_Pa"]
        assert interval.value == pytest.approx(MU_0_PA, rel=0.05)
        assert interval.lo < MU_0_PA < interval.hi
        assert interval.hi - interval.lo < 0.05 * MU_0_PA


def test_the_combined_fit_is_under_4_percent_in_both_modes(machine: FittedLaws) -> None:
    assert [c.experiment.kind for c in machine.fit.curves] == ["uniaxial", "shear"]
    assert all(relative_rms(machine.fit.law, c) < 0.04 for c in machine.fit.curves)


def test_the_longterm_curves_are_recovered(machine: FittedLaws) -> None:
    law = machine.fit.law
    assert law.moduli == "longterm"
    for mode, key in (("uniaxial", "strain"), ("shear", "gamma")):
        truth = TRUTH["longterm"][mode]
        stress = nominal_stress(law, mode, truth[key])
        error = stress - 1e3 * np.array(truth["stress_kPa"])
        assert np.sqrt(np.mean(error**2) / np.mean(stress**2)) < 0.015


def test_leaving_out_the_rate_correction_is_said_and_costs_stiffness(machine: FittedLaws) -> None:
    without = calibrate([e for e in machine.experiments if e.kind in ("uniaxial", "shear")], FitOptions(order=3))
    assert without.fit.law.mu_0_Pa > 1.08 * MU_0_PA
    assert any("not corrected for" in d for d in without.decisions)
    assert any("convolved with the Prony series" in d for d in machine.decisions)


def test_the_series_is_recovered(machine: FittedLaws) -> None:
    prony = machine.prony.prony
    np.testing.assert_allclose(prony.g, TRUTH["prony"]["g"], rtol=0.1)
    np.testing.assert_allclose(prony.tau_s[:2], TRUTH["prony"]["tau_s"][:2], rtol=0.15)
    error = np.r_[prony.g, prony.tau_s] - np.r_[TRUTH["prony"]["g"], TRUTH["prony"]["tau_s"]]
    assert np.all(np.abs(error) < 3 * np.sqrt(np.diag(machine.prony.covariance)))


def test_the_skin_is_recovered(machine: FittedLaws) -> None:
    skin = machine.conductivity
    assert skin.chi_square < chi2.ppf(0.99, skin.freedom)
    e = np.vander(np.linspace(*skin.law.strain_range, 60), 4, increasing=True)
    truth = TRUTH["conductivity"]["c0_S_per_m"] * np.r_[1.0, TRUTH["conductivity"]["a"]]
    found = skin.law.c0_S_per_m * np.r_[1.0, skin.law.a]
    sd = np.sqrt(np.einsum("ni,ij,nj->n", e, skin.covariance, e))
    assert np.all(np.abs(e @ (found - truth)) < 3 * sd)


def test_relaxation_alone_and_conductivity_alone_are_calibrated(machine: FittedLaws) -> None:
    alone = calibrate([e for e in machine.experiments if e.kind in ("relaxation", "conductivity")])
    assert alone.fit is None
    assert any("recorded on the ramp itself shapes" in d for d in alone.decisions)
    error = alone.prony.prony.g - TRUTH["prony"]["g"]
    assert np.all(np.abs(error) < 3 * np.sqrt(np.diag(alone.prony.covariance))[:3])
    assert alone.conductivity.law.c0_S_per_m == machine.conductivity.law.c0_S_per_m


def test_table_1_is_what_the_truth_was_made_from() -> None:
    law = Hyperfoam(1e3 * np.array(TRUTH["longterm"]["mu_kPa"]), TRUTH["longterm"]["alpha"], np.zeros(6))
    np.testing.assert_allclose(nominal_stress(law, "uniaxial", TRUTH["longterm"]["uniaxial"]["strain"]),
                               1e3 * np.array(TRUTH["longterm"]["uniaxial"]["stress_kPa"]), rtol=1e-5, atol=1e-3)
