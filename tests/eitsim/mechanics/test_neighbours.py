"""Several touches in one scene, end to end: what neighbours may cost, lists, the case of one, designs."""

from itertools import pairwise

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.rim.interaction import expected, gap_effect, gap_for, interaction
from eitsim.scene.scene import Body, Punch, scene_from
from eitsim.simulation.plan import make_plan
from eitsim.simulation.result_json import as_json
from eitsim.simulation.simulate import simulate
from eitsim.sweeps.design.design import read_design, scene_at
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0])
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))
LEFT, RIGHT = {"x_mm": -30, "y_mm": 10, "force_N": 0.5}, {"x_mm": 25, "diameter_mm": 10, "force_N": 0.2}
# Depths of pairs of equal punches (14 mm, 1 N) solved together, relative to one alone, by gap in mm: a patch of the
# foam whose end is the plane of symmetry between them
TOGETHER = {30: 3.7e-4, 20: 1.75e-3, 15: 3.2e-3, 10: 2.1e-3, 6: 1.11e-2}


def test_the_bound_holds_what_pairs_solved_together_change_in_depth():
    touch = solve_touch(FOAM, Body(), Punch())
    bounds = []
    for gap, change in TOGETHER.items():
        half = (14 + gap) / 2e3
        bounds.append(interaction(((Punch(-half), touch), (Punch(half), touch)))["depth"])
        assert change < bounds[-1]
    print(bounds)
    assert bounds[0] < 20 * TOGETHER[30]
    assert all(a < b for a, b in pairwise(bounds))


def test_the_expected_cost_falls_with_the_gap_and_adds_up():
    effects = [gap_effect(g, 0.01) for g in np.linspace(0, 0.08, 60)]
    assert all(a >= b for a, b in pairwise(effects))
    for effect in (0.1, 5e-3, 1e-4):
        assert gap_effect(gap_for(effect, 0.01), 0.01) == pytest.approx(effect)
    row = [Punch(x) for x in (-0.04, 0.0, 0.04)]
    assert expected(Body(), row) == pytest.approx(2 * gap_effect(0.026, 0.01))
    assert expected(Body(), row[:1]) == 0


def test_a_bound_falls_with_the_strain_of_the_neighbour():
    touch = solve_touch(FOAM, Body(), Punch(diameter_m=0.01, force_N=0.2))
    far, near = (interaction(((Punch(-x), touch), (Punch(x), touch))) for x in (0.04, 0.02))
    assert 0 < far["signal"] < near["signal"] / 20


def test_two_touches_give_lists_in_their_order_and_one_set_of_readings():
    rough = {"signal": 0.1}  # at which none is solved again on finer elements
    scene, swapped = (scene_from({"punch": each, "accuracy": rough}) for each in ([LEFT, RIGHT], [RIGHT, LEFT]))
    result, other = simulate(scene, CARD), simulate(swapped, CARD)
    assert result.outcome == "ok"
    document, mirrored = as_json(result, scene, CARD), as_json(other, swapped, CARD)
    for key in ("force_N", "delta_max_mm", "sigma_max_kPa", "A_c_mm2"):
        assert document[key] == mirrored[key][::-1]
    assert document["force_N"] == pytest.approx([0.5, 0.2])
    assert len(document["profile"]) == 2
    np.testing.assert_allclose(document["readings_V"], mirrored["readings_V"], rtol=1e-10, atol=1e-15)
    for raw, depth in zip((LEFT, RIGHT), document["delta_max_mm"], strict=True):
        assert simulate(scene_from({"punch": raw, "accuracy": rough}), CARD).touches[0].depth_m * 1e3 == depth
    assert document["error_estimate"]["signal"] > document["interaction"]["signal"]


def test_one_touch_in_a_list_is_the_touch_itself():
    plain, listed = (simulate(scene_from({"punch": raw}), CARD) for raw in (LEFT, [LEFT]))
    np.testing.assert_array_equal(plain.readings.impedance_Ohm, listed.readings.impedance_Ohm)
    assert plain.error_estimate == listed.error_estimate
    assert "interaction" not in as_json(listed, scene_from({"punch": [LEFT]}), CARD)


@pytest.mark.slow
def test_any_touch_that_bottoms_out_makes_the_outcome():
    deep = {"x_mm": 40, "diameter_mm": 10, "depth_mm": 9.6}
    result = simulate(scene_from({"punch": [LEFT, deep], "skin": {"strain": "normal"}}), CARD)
    assert result.outcome == "bottomed_out"
    assert result.readings is not None


def test_the_plan_tells_what_being_alone_costs():
    plan = make_plan(scene_from({"punch": [LEFT, RIGHT]}), CARD)
    (decision,) = [d for d in plan.decisions if "as if it were alone" in d.decision]
    assert decision.decision.startswith("2 touches")
    assert 0 < decision.error_bound < 0.005
    assert not plan.refusal
    closer = [{"x_mm": 0}, {"x_mm": 30}]
    sticking = [punch | {"friction": "stick"} for punch in closer]
    assert {"general", "friction"} <= {d.kind for d in make_plan(scene_from({"punch": sticking}), CARD).decisions}
    assert not make_plan(scene_from({"punch": closer, "accuracy": {"signal": 0.15}}), CARD).refusal


def test_no_touch_at_all_is_a_mistake():
    with pytest.raises(ValueError, match="empty list"):
        scene_from({"punch": []})


def test_a_design_holds_several_touches(tmp_path):
    (tmp_path / "two.toml").write_text("scenes = 2\n[[punch]]\nx_mm = -30\n[[punch]]\nx_mm = 30\n")
    assert [punch.x_m for punch in scene_at(read_design(tmp_path / "two.toml"), 1).punches] == [-0.03, 0.03]
