"""Where a skin is strained further than its law goes: what that leaves open is stated, and refused where it is much."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import surface_metric
from eitsim.simulation.error_budget import explain_excess, numerical_errors
from eitsim.simulation.plan import make_plan
from eitsim.simulation.simulate import readings_of
from eitsim.simulation.validity import positive_limits
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity, NotPositive, conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array

FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
PUNCH = Punch(0.02, -0.01, force_N=0.5)
CUBIC = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
SCENE = Scene(punches=(PUNCH,), skin=Skin(strain="principal"))


@dataclass(frozen=True)
class Torn:
    """A touch's field with a ridge of a large stretch of a width, m, at a place."""

    touch: Touch
    width_m: float
    stretch: float = 2.3

    def metric(self, points_m: Array) -> tuple[Array, Array]:
        metric, normal = surface_metric(points_m, PUNCH, self.touch)
        away = np.linalg.norm(points_m - np.array([0.027, -0.01]), axis=-1)
        share = 1 + (self.stretch - 1) * np.exp(-((away / self.width_m) ** 2))
        return metric * share[..., None, None] ** 2, normal / share**2

    def displacement(self, points_m: Array) -> Array:
        return np.zeros((*points_m.shape[:-1], 3))


@pytest.fixture(scope="module")
def touch() -> Touch:
    return solve_touch(FOAM, Body(), PUNCH, element_m=0.2e-3)


def test_places_past_the_law_are_open_between_nothing_and_what_was_fitted(touch: Touch) -> None:
    pressed = (replace(touch, surface=Torn(touch, 1.5e-3)),)
    found = readings_of(SCENE, pressed, CUBIC, exact=False)
    assert 0.001 < found.past_law < 0.1
    limits = positive_limits(CUBIC)
    least, most = (readings_of(SCENE, pressed, replace(CUBIC, limits=limits, held=(0.0, high)), exact=False).signal_V
                   for high in (0.999, 0.4))
    assert found.signal_V == pytest.approx(least, abs=2e-3 * float(np.linalg.norm(least)))
    assert np.linalg.norm(most - least) / np.linalg.norm(least) == pytest.approx(found.past_law, rel=0.1)
    without = numerical_errors(pressed, replace(found, past_law=0.0), "principal")["signal"]
    assert numerical_errors(pressed, found, "principal")["signal"] == pytest.approx(without + found.past_law)
    plan = make_plan(SCENE, MaterialCard("foam", FOAM, conductivity=CUBIC))
    assert "no longer positive leave" in explain_excess(0.001, found.past_law, found.past_law, plan, found)


def test_a_touch_whose_signal_hangs_on_them_is_refused(touch: Touch) -> None:
    with pytest.raises(ValueError, match="strains the skin further than its law goes"):
        readings_of(SCENE, (replace(touch, surface=Torn(touch, 8e-3)),), CUBIC, exact=False)


def test_a_law_that_stays_positive_leaves_nothing_open(touch: Touch) -> None:
    falling = Conductivity(30.0, np.array([-3.0]), (0.0, 0.4), kind="exponential")
    assert positive_limits(falling)[0] == -np.inf
    assert positive_limits(falling)[1] > 2
    assert readings_of(SCENE, (replace(touch, surface=Torn(touch, 1.5e-3)),), falling, exact=False).past_law == 0


def test_a_law_is_held_at_its_limits() -> None:
    low, high = positive_limits(CUBIC)  # 1 - 2 e + 2 e^2 - e^3 = (1 - e)(1 - e + e^2)
    assert (low, high) == (-np.inf, pytest.approx(0.999, abs=2e-3))
    for end in (high, 0.4):
        held = replace(CUBIC, limits=(low, high), held=(0.0, end))
        assert conductivity(held, [5.0, 0.2, 0.99]) == pytest.approx(conductivity(CUBIC, [end, 0.2, 0.99]))
    with pytest.raises(NotPositive):
        conductivity(CUBIC, [5.0])
