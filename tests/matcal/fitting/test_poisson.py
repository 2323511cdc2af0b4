"""nu given, shared, term by term: recovery from lateral and volumetric data, bounds told, refusals with reasons."""

from dataclasses import replace

import numpy as np
import pytest

from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.hyperfoam.hyperfoam_fit import fit, relative_rms
from matcal.fitting.uncertainty.standard_errors import standard_errors
from matcal.laws.deformation_modes import lateral_strain, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.reduction.experiment import Experiment

MIXED = Hyperfoam([9000.0, 4000.0], [2.0, 8.0], [0.3, 0.1])
SHARED = replace(MIXED, nu=np.full(2, 0.2))


def curve(mode: str, law: Hyperfoam, lateral: bool = False, noise: float = 0.0) -> Experiment:
    ends = {"uniaxial": (-0.6, 0.3), "shear": (0.02, 0.8), "volumetric": (0.4, 0.98)}[mode]
    strain, rng = np.linspace(*ends, 60), np.random.default_rng(3)
    sideways = lateral_strain(law, mode, strain) + noise * rng.normal(size=60) if lateral else None
    return Experiment(mode, strain, nominal_stress(law, mode, strain) * (1 + noise * rng.normal(size=60)),
                      source=(f"{mode}.csv",), lateral=sideways)


def test_lateral_strains_give_nu_from_one_uniaxial_test() -> None:
    found = fit(weigh([curve("uniaxial", SHARED, True, 0.005)]), 2, "fit", thorough=False)
    np.testing.assert_allclose(found.law.nu, 0.2, atol=5e-3)
    assert any("fitted to the lateral strains" in d for d in found.decisions)


def test_a_volumetric_test_gives_nu() -> None:
    found = fit(weigh([curve("uniaxial", SHARED), curve("volumetric", SHARED)]), 2, "fit", thorough=False)
    np.testing.assert_allclose(found.law.nu, 0.2, atol=1e-3)


def test_nu_term_by_term_is_recovered_from_lateral_strains() -> None:
    tests = weigh([curve("uniaxial", MIXED, True), curve("shear", MIXED)])
    found = fit(tests, 2, "fit-each", thorough=False)
    np.testing.assert_allclose(found.law.nu, MIXED.nu, atol=5e-3)
    np.testing.assert_allclose(found.law.mu_Pa, MIXED.mu_Pa, rtol=1e-2)
    assert fit(tests, 2, "fit", thorough=False).optimum.cost > 100 * found.optimum.cost


def test_a_list_of_nu_is_kept_and_fitted_through_the_free_stretch() -> None:
    found = fit(weigh([curve("uniaxial", MIXED), curve("shear", MIXED)]), poisson=(0.3, 0.1))
    assert found.law.nu.tolist() == [0.3, 0.1]
    np.testing.assert_allclose(found.law.mu_Pa, MIXED.mu_Pa, rtol=1e-6)
    assert all(np.isfinite(relative_rms(a.law, c)) for a in found.alone.values() for c in found.curves)
    errors = standard_errors(found)
    assert errors["alpha_1"]["value"] == pytest.approx(2.0, rel=1e-6)


def test_equal_values_in_a_list_are_one_nu() -> None:
    tests = weigh([curve("uniaxial", SHARED), curve("shear", SHARED)])
    one, listed = fit(tests, 2, 0.2, thorough=False), fit(tests, 2, (0.2, 0.2), thorough=False)
    np.testing.assert_array_equal(one.law.mu_Pa, listed.law.mu_Pa)


def test_a_lateral_record_that_is_not_used_is_told() -> None:
    said = fit(weigh([curve("uniaxial", SHARED, True)]), 2, 0.0, thorough=False).decisions
    assert any("say nu = 0.2; they were not used" in d for d in said)


def test_a_bound_that_is_reached_is_told() -> None:
    auxetic = replace(SHARED, nu=np.full(2, -0.5))
    said = fit(weigh([curve("uniaxial", auxetic, True)]), 2, "fit", thorough=False).decisions
    assert any("-0.4 stopped at that bound" in d for d in said)


def test_a_nu_near_one_half_is_found() -> None:
    rubber = replace(SHARED, nu=np.full(2, 0.497))
    found = fit(weigh([curve("uniaxial", rubber, True)]), 2, "fit", thorough=False)
    np.testing.assert_allclose(found.law.nu, 0.497, atol=1e-4)


@pytest.mark.parametrize(("modes", "choice", "word"), [
    (("shear",), "fit", "shear alone does not tell nu"), (("uniaxial",), "fit", "lateral strain next to"),
    (("uniaxial", "shear"), "fit-each", "uniaxial alone does not tell nu term by term"),
    (("uniaxial", "shear"), "fitted", "known: a value"), (("uniaxial",), (0.1, 0.2, 0.5), "0.5 must lie between"),
    (("uniaxial",), 0.6, "must lie between")])
def test_what_the_data_cannot_tell_is_refused(modes: tuple[str, ...], choice: str | float, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        fit(weigh([curve(mode, MIXED) for mode in modes]), poisson=choice)


def test_a_list_and_an_order_must_agree() -> None:
    with pytest.raises(ValueError, match="lists 2 values but the order is 3"):
        fit(weigh([curve("uniaxial", MIXED)]), 3, (0.1, 0.2))
