"""Laws: stress and tangent are derivatives of the energy, limits are exact, histories are convolved exactly."""

import numpy as np
import pytest

from matcal.laws.conductivity import Conductivity, conductivity, outside, strip_conductivity
from matcal.laws.hyperfoam import Hyperfoam, exp_remainder
from matcal.laws.prony import Prony, convolve, relaxation

TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])
MIXED = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, -4.249, 0.741], [0.0, 0.2, 0.3])
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])


@pytest.mark.parametrize("law", [TABLE_1, MIXED])
def test_stress_and_tangent_are_derivatives_of_the_energy(law: Hyperfoam) -> None:
    x = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    h = 1e-5 * np.eye(3)
    slope = np.stack([(law.energy(x + d) - law.energy(x - d)) / 2e-5 for d in h], -1)
    np.testing.assert_allclose(law.kirchhoff(x), slope, rtol=1e-7, atol=1e-3)
    tangent = np.stack([(law.kirchhoff(x + d) - law.kirchhoff(x - d)) / 2e-5 for d in h], -1)
    np.testing.assert_allclose(law.tangent(x), tangent, rtol=1e-7, atol=1e-3)


def test_beta_zero_is_the_limit_and_exact() -> None:
    x = np.random.default_rng(1).uniform(-1, 1, (5, 3))
    exact = TABLE_1.kirchhoff(x)
    for nu in (1e-6, 1e-9):
        near = Hyperfoam(TABLE_1.mu_Pa, TABLE_1.alpha, np.full(3, nu))
        np.testing.assert_allclose(near.kirchhoff(x), exact, atol=3e5 * nu)
        np.testing.assert_allclose(near.energy(x), TABLE_1.energy(x), atol=3e5 * nu)


def test_no_cancellation_near_rest() -> None:
    x = np.array([1e-9, -2e-9, 1e-9])
    assert TABLE_1.energy(x) == pytest.approx(9530 * float(np.sum(x**2)), rel=1e-6)
    assert exp_remainder(1e-12) == pytest.approx(5e-25, rel=1e-9)


def test_initial_moduli() -> None:
    assert TABLE_1.mu_0_Pa == pytest.approx(9530)
    assert pytest.approx(19060) == TABLE_1.E_0_Pa


def ramp_relaxation(law: Prony, time_s: np.ndarray, ramp_s: float) -> np.ndarray:
    """Stress over G_0 x final strain after a linear ramp of length ramp_s (s), at times t >= ramp_s from its start."""
    z = ramp_s / law.tau_s
    left = -np.expm1(-z) / z * np.exp(-(time_s[..., None] - ramp_s) / law.tau_s)
    return law.g_infinity + np.sum(law.g * left, axis=-1)


def test_ramp_and_hold_agree_with_the_convolution() -> None:
    t = np.arange(0, 60, 0.01)
    history = convolve(SERIES, t, np.minimum(t, 1.0))
    np.testing.assert_allclose(history[t >= 1], ramp_relaxation(SERIES, t[t >= 1], 1.0), rtol=1e-10)
    step = convolve(SERIES, t, np.ones_like(t))
    np.testing.assert_allclose(step, relaxation(SERIES, t), rtol=1e-12)


def test_prony_times_far_apart_stay_finite() -> None:
    law = Prony([0.2, 0.2], [1e-4, 1e6])
    assert ramp_relaxation(law, np.array([1.0, 180.0]), 1.0) == pytest.approx([0.8 + 2e-5, 0.8], abs=1e-3)
    assert np.all(np.isfinite(convolve(law, np.array([0.0, 1.0, 1.0, 1e7]), np.array([0.0, 1.0, 2.0, 2.0]))))


def test_conductivity_refuses_a_negative_value_and_names_the_strain() -> None:
    law = Conductivity(30.0, [2.0, 0.0, 0.0], (0.0, 0.4))
    with pytest.raises(ValueError, match=r"c\(-0.6\)"):
        conductivity(law, [-0.1, -0.6])
    assert outside(law, [-0.1, 0.0, 0.4, 0.5]).tolist() == [True, False, False, True]


def test_strip_reduction_inverts_the_resistance() -> None:
    law = Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4))
    e = np.linspace(0, 0.4, 9)
    resistance = 0.075 * (1 + e) / (conductivity(law, e) * 1.4e-6)
    np.testing.assert_allclose(strip_conductivity(resistance, e, 0.075, 1.4e-6), conductivity(law, e), rtol=1e-14)


@pytest.mark.parametrize(("given", "named"), [
    (([1.0], [0.0], [0.0]), "alpha"), (([1.0], [2.0], [0.5]), "nu"), (([-1.0], [2.0], [0.0]), "mu_0"),
    (([np.nan], [2.0], [0.0]), "finite")])
def test_impossible_parameters_are_refused(given: tuple, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        Hyperfoam(*given)
