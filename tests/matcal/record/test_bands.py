"""Bands outside the tests, where a nu that was assumed decides what a law says."""

from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.fitting.hyperfoam.poisson import PRIOR_NU
from matcal.fitting.uncertainty.intervals import Uncertainty
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.draws import foam_draws, write_draws
from matcal.record.bands import band_in, stress_bands, with_other_nu
from matcal.reduction.experiment import Experiment


def foam(nu: float) -> Hyperfoam:
    return Hyperfoam(np.array([1.5e4, 5e3]), np.array([9.0, -2.0]), np.array([nu, nu]))


def known_of(tests: list[Experiment], poisson: float | None = None) -> Uncertainty:
    found = matcal.fit(tests, poisson=poisson).laws.uncertainty
    assert found is not None
    return found


def uniaxial(nu: float, seed: int) -> list[Experiment]:
    """Compression and tension of a synthetic foam, 1 % noise."""
    law, rng = foam(nu), np.random.default_rng(seed)
    strain = [np.linspace(0.0, end, 60)[1:] for end in (-0.6, 0.3)]
    return [Experiment("uniaxial", e, matcal.nominal_stress(law, "uniaxial", e) * (1 + 0.01 * rng.normal(size=e.size)))
            for e in strain]


@pytest.mark.thorough
def test_shear_that_was_not_tested_lies_in_the_band_whatever_nu_is() -> None:
    gamma = np.linspace(0.02, 0.3, 30)
    for seed, nu in enumerate((-0.2, 0.0, 0.2, 0.4)):
        known = known_of(uniaxial(nu, seed))
        truth = matcal.nominal_stress(foam(nu), "shear", gamma)
        _, low, high, outer = band_in(known.law, "shear", gamma, known, known)
        assert outer.all()
        assert np.all((low < truth) & (truth < high)), nu
        if nu:
            _, low, high, _ = band_in(known.law, "shear", gamma, known)
            assert not np.any((low < truth) & (truth < high)), nu


def test_tested_strains_and_a_given_nu_keep_their_band() -> None:
    known = known_of(uniaxial(0.3, 1))
    wide, own = (stress_bands(known.law, known, about) for about in (known, None))
    inside = ~wide["extrapolated"]
    np.testing.assert_array_equal(wide["stress_hi_Pa"][inside], own["stress_hi_Pa"][inside])
    assert np.all(wide["stress_lo_Pa"] <= own["stress_lo_Pa"])
    assert known_of(uniaxial(0.3, 1), poisson=0.0).other_nu is None


def test_outside_the_tests_a_band_is_of_ln_stress_away_from_zero() -> None:
    stress, other = np.array([-10.0, 10.0, 10.0]), np.array([-5.0, 15.0, 20.0])
    low, high = with_other_nu(stress, (stress, stress), other, 2.0, np.array([True, True, False]))
    np.testing.assert_allclose(low, [-10 * 1.5**2, 0.0, 10.0])
    np.testing.assert_allclose(high, [0.0, 10 * 1.5**2, 10.0])


def test_a_cards_draws_are_widened_alike(tmp_path: Path) -> None:
    found = matcal.fit(uniaxial(0.3, 2), order=2)
    found.save(tmp_path / "card.json")
    law, rng = found.card.hyperfoam, np.random.default_rng(0)
    assert law is not None
    draws = foam_draws(law.mu_Pa * (1 + 0.01 * rng.normal(size=(50, 1))), np.tile(law.alpha, (50, 1)), 0.0)
    write_draws(draws, tmp_path / "card.d" / "posterior.nc", {})
    card = matcal.read_card(tmp_path / "card.json")
    assert card.fit["other_nu"]["parameters"][2] == pytest.approx([PRIOR_NU, PRIOR_NU])
    drawn = matcal.MaterialCard("foam", card.law, fit=card.fit, posterior={"file": "card.d/posterior.nc"},
                                file=tmp_path / "card.json")
    said = matcal.predict(drawn, "shear", [0.2])
    _, low, high, _ = band_in(law, "shear", np.array([0.2]), draws, found.laws.uncertainty)
    np.testing.assert_allclose([said["stress_lo_Pa"], said["stress_hi_Pa"]], [low, high], rtol=1e-9)
    tested = matcal.predict(drawn, "uniaxial", [-0.3])
    assert tested["stress_hi_Pa"] - tested["stress_lo_Pa"] < 0.06 * abs(tested["stress_Pa"])
