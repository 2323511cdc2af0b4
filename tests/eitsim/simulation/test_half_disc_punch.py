"""A punch that covers half the area of the disc."""

import math

import numpy as np
import pytest

from eitsim.scene.scene import scene_from
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

CARD = MaterialCard("foam", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0]), None,
                    Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4)))


@pytest.mark.slow
def test_a_punch_over_half_the_disc_is_solved_and_turns_with_the_ring() -> None:
    """1 mm deep in the middle: 16 patterns that are one another turned, contact on half the disc, its error told."""
    diameter_mm = 200 / math.sqrt(2)
    punch = {"diameter_mm": diameter_mm, "depth_mm": 1.0}
    result = simulate(scene_from({"punch": punch, "skin": {"strain": "normal"}}), CARD)
    assert result.outcome == "ok"
    assert result.readings is not None
    assert result.touches[0].contact_area_m2 == pytest.approx(math.pi * 0.1**2 / 2, rel=0.02)
    signal = result.readings.signal_V
    assert np.abs(signal - signal.mean(axis=0)).max() < 1e-3 * np.abs(signal).max()
    assert result.numerical_error["signal"] < 0.01
