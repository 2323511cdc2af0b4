"""Scenes take whatever law of conduction the card holds: an exponential one is the limit of its Taylor polynomials."""

import numpy as np
import pandas as pd
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.scene import scene_from
from eitsim.simulation.simulate import readings_of
from eitsim.simulation.validity import positive_from
from eitsim.sweeps.design.card_draws import Cards, columns, recorded
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity, conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.posterior.draws import Draws
from surrogate.data.material_states import SKIN, answers

K, FOAM = -2.3, Hyperfoam([12e3], [2.0], [0.0])
EXPONENTIAL = Conductivity(30.0, [K], (0.0, 0.4), "exponential")
CUBIC, LINEAR = (Conductivity(30.0, a, (0.0, 0.4)) for a in ([K, K**2 / 2, K**3 / 6], [K, 0.0, 0.0]))


@pytest.mark.parametrize("skin", [{}, {"strain": "normal"}])
def test_an_exponential_skin_is_the_limit_of_its_taylor_polynomials(skin: dict[str, str]) -> None:
    """What is left of a line falls with the strain, and of a cubic with its third power."""
    off = []
    for depth_mm in (0.25, 1.0):
        scene = scene_from({"punch": {"x_mm": 20, "depth_mm": depth_mm}, "skin": skin})
        touch = solve_touch(FOAM, scene.body, scene.punches[0],
                            element_m=4 * default_element_m(scene.body, scene.punches[0]))
        exact, cubic, line = (readings_of(scene, (touch,), law, exact=False).signal_V
                              for law in (EXPONENTIAL, CUBIC, LINEAR))
        off.append([np.linalg.norm(other - exact) / np.linalg.norm(exact) for other in (cubic, line)])
    print(skin, off)
    (cubic, line), (deep_cubic, deep_line) = off
    assert cubic < 0.1 * deep_cubic
    assert 0.1 < line / deep_line < 0.7
    assert deep_cubic < 0.3 * deep_line


def test_an_exponential_skin_is_positive_wherever_a_touch_takes_it() -> None:
    assert positive_from(EXPONENTIAL) is None


def test_drawn_cards_of_a_sweep_and_the_states_of_a_reader_have_the_law() -> None:
    drawn = Draws({}, conductivity_S_per_m=30 * np.array([[1.0, K], [1.1, 1.1 * K]]))
    cards = Cards(MaterialCard("foam", FOAM, conductivity=EXPONENTIAL), drawn, np.array([4, 9]))
    assert columns(cards) == ["c0_S_per_m", "a_1"]
    rows = pd.DataFrame([recorded(cards, number) for number in range(2)])
    found = answers(rows, False, {"law": "hyperfoam", "conductivity": "exponential"})
    for row, answer in zip(rows.itertuples(), found, strict=True):
        own = Conductivity(float(row.c0_S_per_m), [float(row.a_1)], kind="exponential")
        np.testing.assert_array_equal(answer, conductivity(own, SKIN))
