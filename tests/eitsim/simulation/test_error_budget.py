"""A result's signal error holds what the mechanics and what the electrics leave, in the command's answer too."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.scene.scene import STRAINS, scene_from
from eitsim.simulation.error_budget import error_budget, numerical_errors, signal_overlaps
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


def test_touches_count_by_their_parts_of_the_signal() -> None:
    """Two at right angles add as squares, two of one pattern add, and two that cancel count more than the worst one."""
    one, other = np.array([[3.0, 0.0]]), np.array([[0.0, 4.0]])
    assert signal_overlaps(one + other, [one, other]) == pytest.approx(np.diag([9 / 25, 16 / 25]))
    errors = np.array([0.02, 0.01])
    for parts, expected in (([one, other], np.hypot(0.06, 0.04) / 5), ([one, 4 * one], (0.06 + 0.12) / 15),
                            ([3 * one, -2 * one], (0.18 + 0.06) / 3)):
        of = signal_overlaps(np.sum(parts, axis=0), parts)
        assert np.sqrt(errors @ of @ errors) == pytest.approx(expected)


@pytest.mark.thorough
def test_a_light_touch_that_misses_the_request_counts_by_its_share() -> None:
    punch, body = [{"x_mm": -60.0, "force_N": 1.0}, {"x_mm": 60.0, "force_N": 0.05}], {"radius_mm": 120.0}
    both = simulate(scene_from({"body": body, "punch": punch, "accuracy": {"signal": 1e-3}}), CARD)
    assert both.readings is not None
    assert (of := both.readings.parts) is not None
    each = [simulate(scene_from({"body": body, "punch": one}), CARD).readings for one in punch]
    sizes = [float(np.linalg.norm(one.signal_V / np.linalg.norm(both.readings.signal_V))) for one in each if one]
    assert np.sqrt(np.diag(of.overlaps)) == pytest.approx(sizes, rel=0.02)
    assert sizes[1] < 0.1
