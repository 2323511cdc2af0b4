"""The stated error of a conducting punch holds where skin and conductor nearly cancel, and says so."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import ConductorPart, Plan, Readings
from eitsim.scene.scene import scene_from
from eitsim.simulation.contact_end import variants, with_conductors
from eitsim.simulation.error_budget import error_budget, explain_excess
from eitsim.simulation.plan import make_plan
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4)))


def distance(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


@pytest.mark.thorough
@pytest.mark.parametrize(("punch", "strain"), [
    ({"profile": "sphere", "diameter_mm": 10.2, "force_N": 1.03, "x_mm": 45}, "areal"),
    ({"diameter_mm": 10.5, "force_N": 0.477, "x_mm": 46}, "principal")])
def test_the_stated_error_holds_where_skin_and_conductor_nearly_cancel(punch: dict, strain: str) -> None:
    """Against elements of half the size: changes of 0.4 and 0.5 %, once 4 and 7, where 2 % was stated."""
    scene = scene_from({"punch": {**punch, "conductor": True, "contact_impedance_Ohm_m2": 1e-8},
                        "skin": {"strain": strain}})
    result, (given,) = simulate(scene, CARD), scene.punches
    assert result.readings is not None
    assert result.readings.conductors is not None
    assert result.readings.conductors.grown > 2
    fine = solve_touch(FOAM, scene.body, given, element_m=default_element_m(scene.body, given) / 2)
    assert CARD.conductivity is not None
    solved = solve(scene.body, scene.skin, scene.electrodes, scene.drive, ((given, fine),), CARD.conductivity)
    error = distance(result.readings.signal_V, solved.signal_V)
    print(punch, strain, error, result.error_estimate["signal"])
    assert 0.001 < error < result.numerical_error["signal"]
    assert "nearly cancel" in result.message


def test_the_parts_of_skin_and_conductor_are_those_of_two_solutions() -> None:
    """dV = skin - conductor a^2: with a contact of radius 1 both parts and the slope by the radius are known."""
    touch = simulate(scene_from({"punch": {"force_N": 0.1}}), CARD).touches[0]
    touch = replace(touch, contact_radius_m=1.0, contact_end_error=0.01)
    (punch,) = scene_from({"punch": {"conductor": True}}).punches

    def solved(touches: tuple) -> Readings:
        (one, pressed), = touches
        signal = np.array([[5.0 - 4.0 * one.conductor * pressed.contact_radius_m ** 2]])
        return Readings(signal, signal, signal, signal, 0.0, 0.0, 0, 0.0)

    pressed = ((punch, touch),)
    part = with_conductors(solved(pressed), pressed, [solved(one) for one in variants(pressed)]).conductors
    assert part is not None
    assert (part.insulated, part.own, part.grown) == pytest.approx((5, 4, 5))
    assert part.end_error == pytest.approx(4 * 2 * 0.01, rel=0.01)
    assert variants(((replace(punch, conductor=False), touch),)) == []


def test_what_the_plan_left_out_counts_as_much_more_as_the_parts_are_larger() -> None:
    scene = scene_from({"punch": {"conductor": True}})
    made = make_plan(scene, CARD)
    (floats,) = [d for d in made.decisions if "floats on the whole" in d.decision]
    assert "counts in the result's own error" in floats.reason
    assert not floats.unbounded
    one_V = np.ones((1, 1))
    readings = Readings(one_V, one_V, one_V, one_V, 0.0, 0.0, 0, 0.0, conductors=ConductorPart(6.0, 5.0, 0.0))
    plain, grown = (error_budget(made, {"signal": 0.0, "depth": 0.0}, readings=one)
                    for one in (replace(readings, conductors=None), readings))
    assert grown["signal"] == pytest.approx(6 * plain["signal"])
    assert grown["depth"] == plain["depth"]
    assert "6 times as large" in explain_excess(0.01, 0.5, 0.1, Plan(made.decisions), readings)
    assert "may as well be 0" not in explain_excess(0.01, 0.5, 0.1, Plan(made.decisions), readings)
    assert "may as well be 0" in explain_excess(0.01, 19.6, 19.5, Plan(made.decisions), readings)
