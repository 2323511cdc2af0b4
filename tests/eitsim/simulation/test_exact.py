"""Exact runs: what the plan turns off, what it says stays, and that the shortcuts cost no more than was told."""

import numpy as np
import pytest

from eitsim.scene.scene import scene_from
from eitsim.simulation.plan import make_plan
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

CARD = MaterialCard("Table 1", Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0]), None,
                    Conductivity(100.0, [-2.0, 1.0, 0.0], (0.0, 0.5)))
PUNCH = {"x_mm": 20, "force_N": 0.2}


@pytest.mark.thorough
@pytest.mark.parametrize("change", [{}, pytest.param({"profile": "cone"}, marks=pytest.mark.slow)])
def test_shortcuts_cost_no_more_than_was_told(change):
    scene = scene_from({"punch": PUNCH | change})
    quick, exact = simulate(scene, CARD), simulate(scene, CARD, exact=True)
    assert (quick.readings.method, exact.readings.method) == ("multipole", "mesh")
    assert exact.touches[0].depth_error <= quick.touches[0].depth_error
    depths = quick.touches[0].depth_m, exact.touches[0].depth_m
    assert 0 < abs(depths[0] / depths[1] - 1) < quick.error_estimate["depth"]
    missed = np.linalg.norm(quick.readings.signal_V - exact.readings.signal_V)
    told = quick.error_estimate["signal"] + exact.readings.signal_error
    print("shortcuts cost", missed / np.linalg.norm(exact.readings.signal_V), "told", told)
    assert 0 < missed < told * np.linalg.norm(exact.readings.signal_V)


def test_an_exact_plan_says_what_stays():
    scene = scene_from({"punch": PUNCH})
    usual, exact = make_plan(scene, CARD), make_plan(scene, CARD, exact=True)
    assert "scatter" in " ".join(d.decision for d in usual.decisions)
    assert "scatter" not in " ".join(d.decision for d in exact.decisions)
    assert exact.decisions[0].decision == "exact: a finer mesh of the layer"
    for decision in exact.decisions:
        stays = decision.error_bound > 0 or decision.unbounded
        assert ("exact does not change it" in decision.reason) == stays
    assert sum(d.unbounded for d in exact.decisions) == 6
    assert any("three dimensions on the whole disc" in d.decision for d in exact.decisions)
    assert exact.error_bound < usual.error_bound


def test_an_exact_plan_with_a_conductor_takes_the_mesh():
    plan = make_plan(scene_from({"punch": PUNCH | {"conductor": True}}), CARD, exact=True)
    assert "scatter" not in " ".join(d.decision for d in plan.decisions)
