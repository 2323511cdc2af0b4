"""nu by lateral strains against nu by stresses, or one that was given: said where they contradict each other."""

import numpy as np
import pytest

import matcal
from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.uncertainty.two_nu import TwoNu, _by_lateral
from matcal.record.cautions import cautions
from matcal.reduction.experiment import Experiment

STRAIN, VOLUME = np.linspace(-0.6, -0.02, 30), np.linspace(0.98, 0.6, 30)


def two(by_stress: float, by_lateral: float, seed: int = 1, noise: float = 0.01, **choices) -> matcal.MaterialCard:
    """The card of compression and volume by one nu, with lateral strains of another."""
    law, random = matcal.Hyperfoam([60e3, 8e3], [8.0, -4.0], [by_stress] * 2), np.random.default_rng(seed)
    stress, pressure = (matcal.nominal_stress(law, kind, at) * (1 + noise * random.normal(size=30))
                        for kind, at in (("uniaxial", STRAIN), ("volumetric", VOLUME)))
    lateral = (1 + STRAIN) ** -by_lateral - 1 + 0.3 * noise * random.normal(size=30)
    return matcal.fit([{"uniaxial": {"strain": STRAIN, "stress_Pa": stress, "lateral": lateral}},
                       {"volumetric": (VOLUME, pressure)}], **choices).card


def said(card: matcal.MaterialCard) -> list[str]:
    return [one for one in cautions(card) if one.startswith("The lateral strains say")]


def test_intervals_that_share_a_value_agree() -> None:
    assert not TwoNu((0.1, 0.3), (0.29, 0.4)).contradict
    assert TwoNu((0.1, 0.2), (0.3, 0.4)).contradict


def test_lateral_strains_that_contradict_a_given_nu_are_to_be_minded() -> None:
    assert "nu = 0 was assumed" in said(two(0.3, 0.3, order=2))[0]
    assert not said(two(0.3, 0.3, order=2, poisson=0.3))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_lateral_strains_that_contradict_the_volume_are_to_be_minded(seed: int) -> None:
    for by_stress, by_lateral in ((0.1, 0.3), (0.3, 0.1)):
        card = two(by_stress, by_lateral, seed, poisson="fit", order=2)
        assert len(said(card)) == 1
        low, high = card.fit["nu"]["by_lateral_strain"]
        assert low < by_lateral < high
        low, high = card.fit["nu"]["without"]
        assert low - 0.01 < by_stress < high + 0.01
    assert not said(two(0.25, 0.25, seed, poisson="fit", order=2))


def test_the_interval_of_lateral_strains_is_two_standard_deviations_of_one_common_error() -> None:
    """Readings off by d along +1, -1, ... leave nu; its sd is |d| over the norm of the slopes by nu, and one factor of
    all readings cancels."""
    nu, off = 0.2, 0.004 * np.resize([1.0, -1.0], STRAIN.size)
    slope = -(1 + STRAIN) ** -nu * np.log1p(STRAIN)
    off -= slope * (slope @ off) / (slope @ slope)
    test = Experiment("uniaxial", STRAIN, 1e4 * STRAIN, lateral=(1 + STRAIN) ** -nu - 1 + off)
    low, high = _by_lateral(weigh([test]))
    assert (low + high) / 2 == pytest.approx(nu, abs=2e-4)
    assert (high - low) / 4 == pytest.approx(np.linalg.norm(off) / np.linalg.norm(slope), rel=2e-3)
