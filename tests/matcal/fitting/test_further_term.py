"""The number of Prony terms is in the intervals: what a slower term would change, which a short hold cannot exclude."""

import numpy as np
import pytest

from matcal.fitting.relaxation.relaxation_fit import PronyFit, fit_prony
from matcal.laws.deformation_modes import hereditary_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.reduction.experiment import Experiment

FAST = Hyperfoam(np.array([18e3, 2e3]), np.array([8.0, -1.8]), np.zeros(2), "instantaneous")
THREE = Prony(np.array([0.1505, 0.1696, 0.0604]), np.array([0.29, 5.85, 81.7]))
TWO = Prony(np.array([0.2, 0.1]), np.array([1.0, 20.0]))


def _found(series: Prony, hold_s: float, noise: float, seed: int) -> PronyFit:
    """A ramp of 1 s to -0.5, held, with noise over the rms stress."""
    time = np.r_[np.linspace(0, 1, 60), 1 + np.geomspace(0.01, hold_s, 120)]
    strain = -0.5 * np.minimum(time, 1.0)
    stress = hereditary_stress(FAST, series, "uniaxial", time, strain)
    sd = noise * float(np.sqrt(np.mean(stress**2)))
    stress = stress + sd * np.random.default_rng(seed).normal(size=time.size)
    return fit_prony([Experiment("relaxation", strain, stress, time, noise=sd)], FAST, "auto")


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.002, 0.005])
def test_a_hold_too_short_for_its_slowest_term_says_so_and_its_interval_holds(noise: float) -> None:
    found = [_found(THREE, 30.0, noise, seed) for seed in range(20, 36)]
    scores = np.array([(f.prony.g_infinity - THREE.g_infinity) / f.g_infinity_sd for f in found])
    print(f"30 s, noise {noise}: z {scores.round(1)}, terms {[f.prony.g.size for f in found]}")
    assert np.count_nonzero(np.abs(scores) < 1.96) >= 15
    assert all(f.slowest.hi_s is None for f in found)


@pytest.mark.slow
@pytest.mark.parametrize(("series", "hold_s"), [(THREE, 200.0), (TWO, 200.0)])
def test_a_hold_long_enough_keeps_its_interval_without_a_caution(series: Prony, hold_s: float) -> None:
    found = [_found(series, hold_s, 0.002, seed) for seed in range(20, 32)]
    scores = np.array([(f.prony.g_infinity - series.g_infinity) / f.g_infinity_sd for f in found])
    assert np.count_nonzero(np.abs(scores) < 1.96) >= 10
    assert all(f.slowest.hi_s is not None for f in found)
    assert max(f.g_infinity_sd for f in found) < 0.025


@pytest.mark.thorough
def test_a_further_term_is_asked_about_where_the_hold_leaves_room_for_it() -> None:
    short, long = _found(THREE, 30.0, 0.002, 2), _found(THREE, 200.0, 0.002, 2)
    assert short.further is not None
    assert short.further.g_infinity < THREE.g_infinity + 0.01 < short.prony.g_infinity
    assert long.further is None
