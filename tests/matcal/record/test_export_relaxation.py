"""What Abaqus makes of the card's Prony series, by its Theory Guide, "Finite-strain viscoelasticity" (4.8.2).

The deviator of the Kirchhoff stress is convolved after it has been carried along by the distortional deformation, its
mean as a number; the card convolves the second Piola-Kirchhoff stress. One test in uniaxial loading with free faces
shows what that does, so that the exporter's warning says the truth.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from matcal.laws.deformation_modes import hereditary_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony

LAW = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "instantaneous")
SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])


def abaqus_uniaxial(time_s: np.ndarray, strain: np.ndarray) -> np.ndarray:
    """Nominal stress, Pa, along a strain history from rest; lateral faces free at every time."""
    def elastic(e: float, lateral: float) -> tuple[np.ndarray, np.ndarray, float]:
        x = np.log([1 + e, lateral, lateral])
        tau = LAW.kirchhoff(x)
        square = np.exp(2 * x - 2 / 3 * x.sum())
        return square, (tau - tau.mean()) / square, tau.mean()

    def total(e: float, lateral: float, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        z = step / SERIES.tau_s
        decay, rise = np.exp(-z), -np.expm1(-z) / z
        square, carried, mean = elastic(e, lateral)
        h = decay[:, None] * deviators + rise[:, None] * (carried - last[0])
        p = decay * means + rise * (mean - last[1])
        stress = square * (SERIES.g_infinity * carried + SERIES.g @ h)
        return stress - stress.mean() + SERIES.g_infinity * mean + SERIES.g @ p, h, p

    deviators, means, last, lateral, out = np.zeros((3, 3)), np.zeros(3), (np.zeros(3), 0.0), 1.0, [0.0]
    for e, step in zip(strain[1:], np.diff(time_s), strict=True):
        lateral = brentq(lambda v, e=e, step=step: total(e, v, step)[0][1], 0.8 * lateral, 1.25 * lateral, xtol=1e-13)
        stress, deviators, means = total(e, lateral, step)
        last = elastic(e, lateral)[1:]
        out.append(stress[0] / (1 + e))
    return np.array(out)


def histories(ramp_s: float, hold_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    t = np.concatenate([np.linspace(0, ramp_s, 200), ramp_s + np.geomspace(ramp_s / 200, hold_s, 50)])
    e = -0.8 * np.minimum(t / ramp_s, 1)
    return t, e, hereditary_stress(LAW, SERIES, "uniaxial", t, e), abaqus_uniaxial(t, e)


def test_a_hold_after_a_fast_step_agrees() -> None:
    t, _, card, abaqus = histories(1e-3, 180.0)
    assert abaqus[t > 0.01] == pytest.approx(card[t > 0.01], rel=3e-4)


def test_the_end_of_a_hold_agrees() -> None:
    _, _, card, abaqus = histories(1.0, 180.0)
    assert abaqus[-1] == pytest.approx(card[-1], rel=1e-4)


def test_a_slow_ramp_is_some_per_cent_softer() -> None:
    t, _, card, abaqus = histories(192.0, 1.0)
    end = int(np.argmin(np.abs(t - 192.0)))
    print(f"Abaqus over card at the end of the ramp: {abaqus[end] / card[end]:.4f}")
    assert 0.03 < 1 - abaqus[end] / card[end] < 0.07
