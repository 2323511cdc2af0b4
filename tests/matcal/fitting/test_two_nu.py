"""nu by lateral strains against nu by stresses, or one that was given: said where they contradict each other."""

import numpy as np
import pytest

import matcal
from matcal.fitting.uncertainty.two_nu import TwoNu
from matcal.record.cautions import cautions

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
