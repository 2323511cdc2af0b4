"""A result's signal error holds what the mechanics and what the electrics leave, in the command's answer too."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.scene.scene import STRAINS, scene_from
from eitsim.simulation.error_budget import error_budget, numerical_errors
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(100.0, np.array([-2.0, 1.0, 0.0]), (0.0, 0.5)))


@pytest.mark.thorough
@pytest.mark.parametrize("strain", STRAINS)
def test_the_signals_error_is_that_of_the_mechanics_and_that_of_the_electrics(strain: str) -> None:
    result = simulate(scene_from({"punch": {"force_N": 0.2}, "skin": {"strain": strain}}), CARD)
    touch, readings = result.touches[0], result.readings
    assert readings is not None
    assert np.all(touch.signal_errors > 0)
    assert readings.signal_error > 0
    assert result.numerical_error["signal"] == pytest.approx(
        touch.signal_errors[STRAINS.index(strain)] + readings.signal_error, rel=1e-12)
    assert result.error_estimate["signal"] >= result.numerical_error["signal"] + result.plan.error_bound
    worse = numerical_errors((touch,), replace(readings, signal_error=readings.signal_error + 0.05), strain)
    assert worse["signal"] == pytest.approx(result.numerical_error["signal"] + 0.05, rel=1e-12)
    added = error_budget(result.plan, worse)["signal"] - error_budget(result.plan, result.numerical_error)["signal"]
    assert added == pytest.approx(0.05)
