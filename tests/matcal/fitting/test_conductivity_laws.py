"""Laws of conductivity next to the cubic: the band outside the tests holds hidden ones; worse ones do not count."""

from __future__ import annotations

import numpy as np
import pytest

from matcal.fitting.calibrate import calibrate
from matcal.fitting.conductivity_fit import fit_conductivity
from matcal.fitting.conductivity_laws import OTHERS
from matcal.record.bands import conductivity_at, conductivity_band
from matcal.record.cautions import cautions
from matcal.record.predict import predict
from matcal.record.write import make_card
from matcal.reduction.experiment import Experiment


def measured(law: str, k: float, ends: tuple[float, float], seed: int, noise: float = 0.01) -> Experiment:
    strain = np.linspace(*ends, 40)
    value = 2e-3 * np.exp(k * OTHERS[law](strain))
    return Experiment("conductivity", strain, value * (1 + noise * np.random.default_rng(seed).standard_normal(40)))


@pytest.mark.parametrize("law", OTHERS)
@pytest.mark.parametrize("ends", [(0.0, 0.4), (-0.4, 0.0)])
def test_the_band_outside_the_tests_holds_the_hidden_law(law: str, ends: tuple[float, float]) -> None:
    """At -0.5 and -0.6, ten seeds, steep and flat: nine of ten with the other laws."""
    held = []
    for seed in range(10):
        k = -np.random.default_rng(100 + seed).uniform(1, 4)
        found = fit_conductivity([measured(law, k, ends, seed)])
        band = conductivity_band(found, None)
        for strain in (-0.5, -0.6):
            _, low, high = conductivity_at(band, strain)
            held.append(low * 0.95 <= 2e-3 * np.exp(k * OTHERS[law](np.array(strain))) <= high * 1.05)
    assert np.mean(held) >= 0.9


@pytest.mark.parametrize("seed", range(3))
def test_a_law_that_predicts_better_is_named_and_predicted(seed: int) -> None:
    """A steep power law in compression, which a cubic follows where it was fitted and nowhere else."""
    found = calibrate([measured("power", -3.0, (-0.6, 0.0), seed, 0.003)])
    card = make_card(found, [], 0)
    columns = predict(card, "conductivity", [-0.8])
    assert columns["lowest_of_laws_S_per_m"][0] <= columns["conductivity_S_per_m"][0]
    assert columns["highest_of_laws_S_per_m"][0] == pytest.approx(2e-3 * 0.2**-3.0, rel=0.05)
    assert any("power law predicts" in sentence for sentence in cautions(card))


def test_too_few_points_leave_the_cubic_alone() -> None:
    test = measured("exponential", -2.0, (0.0, 0.4), 0)
    few = Experiment("conductivity", test.strain[::8], test.value[::8])
    assert fit_conductivity([few]).others == ()
