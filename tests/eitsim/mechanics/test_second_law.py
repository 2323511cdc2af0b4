"""Touches of a law other than hyperfoam: neo-Hooke at nu = 0 is the hyperfoam with one term alpha = 2."""

import json

import numpy as np
import pytest

import eitsim
import matcal
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.load_paths.table import parts_of, shape_of
from eitsim.scene.scene import Body, Punch
from eitsim.simulation.near_edges import solve_near_rim
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.neo_hooke import NeoHooke

ONE, OTHER = NeoHooke(9530.0, 0.0), Hyperfoam([9530.0], [2.0], [0.0])


@pytest.mark.thorough
@pytest.mark.parametrize(("solve", "punch"), [(solve_touch, Punch(force_N=0.3)),
                                              (solve_near_rim, Punch(x_m=0.085, force_N=0.3))], ids=["inside", "rim"])
def test_one_material_by_two_laws_is_touched_in_the_same_way(solve, punch) -> None:
    one, other = (solve(law, Body(), punch) for law in (ONE, OTHER))
    assert one.depth_m == pytest.approx(other.depth_m, rel=1e-9)
    np.testing.assert_allclose(one.u_z_m, other.u_z_m, rtol=0, atol=1e-9 * other.depth_m)


def test_a_scene_is_solved_with_a_card_of_the_second_law(tmp_path) -> None:
    skin = matcal.Conductivity(30.0, [-2, 2, -1], (-0.4, 0.4))
    matcal.write_card(matcal.MaterialCard("gel", NeoHooke(9530.0, 0.3), conductivity=skin), tmp_path / "gel.json")
    card = matcal.read_card(tmp_path / "gel.json")
    scene = eitsim.Scene(punches=[Punch(force_N=0.3)], accuracy=eitsim.Accuracy(0.05))
    found = eitsim.simulate(scene, card)
    assert found.outcome == "ok"
    assert json.loads((tmp_path / "gel.json").read_text())["hyperelastic"]["parameters"] == {"mu_Pa": 9530.0, "nu": 0.3}


def test_a_shape_of_load_paths_knows_its_law() -> None:
    law, body, punch = NeoHooke(2e3, 0.2), Body(), Punch(force_N=0.3)
    shape = shape_of(law, body, punch)
    assert shape != shape_of(Hyperfoam([2e3], [2.0], [0.2]), body, punch)
    assert parts_of(shape, shape.base)[0] == NeoHooke(1.0, 0.2)
