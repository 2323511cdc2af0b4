"""Instantaneous moduli and their series give back both kinds of moduli, from histories at one rate and at several."""

import numpy as np
import pytest

from matcal.card import MaterialCard, with_moduli
from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.laws.deformation_modes import hereditary_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from matcal.reduction.experiment import Experiment

SERIES = Prony([0.1505, 0.1696, 0.0604], [0.2936, 5.85, 81.672])
FAST = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "instantaneous")
# crosshead, mm/s (5 mm/min), and height of the specimens, mm
SPEED, HEIGHT = 5 / 60, 20.0


def ramp(mode: str, to: float, speed: float = SPEED, points: int = 200) -> Experiment:
    t = np.linspace(0, abs(to) * HEIGHT / speed, points)
    strain = to * t / t[-1]
    return Experiment(mode, strain, hereditary_stress(FAST, SERIES, mode, t, strain), t, (f"{mode}_{speed:g}.csv",))


def hold(to: float = -0.5, ramp_s: float = 1.0, end_s: float = 600.0) -> Experiment:
    t = np.r_[np.linspace(0, ramp_s, 101), ramp_s + np.geomspace(0.02, end_s, 200)]
    strain = to * np.minimum(t / ramp_s, 1.0)
    return Experiment("relaxation", strain, hereditary_stress(FAST, SERIES, "uniaxial", t, strain), t, ("hold.csv",),
                      held=(t > ramp_s).astype(float))


@pytest.mark.thorough
@pytest.mark.parametrize("speeds", [(SPEED,), (SPEED, 20 * SPEED, 400 * SPEED)])
def test_both_kinds_of_moduli_come_back(speeds: tuple[float, ...]) -> None:
    tests = [ramp("uniaxial", -0.8, v) for v in speeds] + [ramp("shear", 1.0, v) for v in speeds]
    found = calibrate([*tests, hold()], FitOptions(order=3))
    assert found.fit is not None
    assert found.prony is not None
    card = MaterialCard("exact", found.fit.law, found.prony.prony)
    print(f"{len(speeds)} rates: long-term {card.hyperfoam.mu_0_Pa:.1f} Pa, instantaneous "
          f"{with_moduli(card, 'instantaneous').mu_0_Pa:.1f} Pa, g {found.prony.prony.g}")
    assert found.fit.law.moduli == "longterm"
    assert found.fit.law.mu_0_Pa == pytest.approx(9530 * SERIES.g_infinity, rel=5e-3)
    assert with_moduli(card, "instantaneous").mu_0_Pa == pytest.approx(9530, rel=1e-2)
    np.testing.assert_allclose(found.prony.prony.g, SERIES.g, atol=0.01)
    assert any("convolved with the Prony series" in d for d in found.decisions)


def test_without_a_relaxation_test_rate_looks_like_scatter_and_that_is_said() -> None:
    tests = [ramp("uniaxial", -0.8, v) for v in (SPEED, 400 * SPEED)]
    found = calibrate(tests, FitOptions(order=3))
    assert found.fit is not None
    slow, fast = (c.factor for c in found.fit.curves)
    assert fast / slow > 1.2
    assert any("no relaxation file was given" in d for d in found.decisions)
    assert any("differ by a factor of 400" in d and "may be rate" in d for d in found.decisions)
