"""Layers on soft bases: two laws by element, and their limits of one material and of a rigid plate."""

import numpy as np
import pytest

import eitsim
import matcal
from eitsim.mechanics.axisymmetric.indentation import indentation_problem
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid import axisymmetric_assembly
from eitsim.mechanics.solid.bonded_laws import Bonded
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.choices import Kind
from eitsim.scene.curved.curved_scene import curved_scene
from eitsim.scene.edges.disc import Disc
from eitsim.scene.pressing import Punch
from eitsim.scene.scene import Body, scene_from, scene_tables
from eitsim.scene.scene_files import with_files
from eitsim.sweeps.run.folder import without_folders
from matcal.card import cards_identity
from matcal.laws.law import scaled
from matcal.laws.neo_hooke import NeoHooke

RUBBER, FOAM = NeoHooke(1e5, 0.4995), matcal.Hyperfoam([3e4], [4.0], [0.2])
PUNCH = Punch(diameter_m=0.008, depth_m=9e-4, profile="sphere")


def force(law, body: Body, coarser: float = 4) -> float:
    return solve_touch(law, body, PUNCH, element_m=coarser * default_element_m(body, PUNCH)).force_N


def test_gradient_of_two_laws_is_the_derivative_of_their_energy():
    body = Body(Disc(0.02), 0.006, 0.004)
    model = indentation_problem(Bonded(RUBBER, FOAM), body, PUNCH, 20 * default_element_m(body, PUNCH), 1.0)
    assert set(model.grid.lines[1]) >= {-1.0, 0.0}
    assert np.isclose(model.grid.lines[1], -1 / 3).any()
    rng, step = np.random.default_rng(7), 1e-7
    u, direction = rng.normal(0, 1e-4, model.grid.unknowns), rng.normal(size=model.grid.unknowns)
    gradient = axisymmetric_assembly.residual_and_tangent(model.law, model.grid, u)[0]
    up, down = (axisymmetric_assembly.energy(model.law, model.grid, u + side * step * direction) for side in (1, -1))
    assert (up - down) / (2 * step) == pytest.approx(gradient @ direction, rel=1e-5)


@pytest.mark.thorough
@pytest.mark.parametrize("law", [RUBBER, FOAM])
def test_a_base_of_the_same_law_is_a_thicker_body_and_a_stiff_one_a_plate(law):
    on_base = Body(Disc(0.04), 0.007, 0.0042)
    assert force(Bonded(law, law), on_base) == pytest.approx(force(law, Body(Disc(0.04), 0.007), 2), rel=2e-3)
    plate = force(law, Body(Disc(0.04), 0.0028))
    assert force(Bonded(law, scaled(law, 1e4)), on_base) == pytest.approx(plate, rel=1e-3)


def test_a_touch_keeps_the_inside_of_its_layer_alone():
    body = Body(Disc(0.04), 0.013, 0.010)
    touch = solve_touch(Bonded(RUBBER, FOAM), body, PUNCH, element_m=4 * default_element_m(body, PUNCH))
    section = touch.section
    assert section.nodes_m[:, 1].min() == pytest.approx(-0.003)
    assert section.law is RUBBER
    assert section.elements.max() + 1 == len(section.nodes_m)
    assert len(section.log_volume) == len(section.elements)
    lowest = section.displacement_m[np.isclose(section.nodes_m[:, 1], -0.003)]
    assert lowest[0, 1] < -0.3 * touch.depth_m  # the layer bends into its base under the ball
    assert 0.3 < touch.force_N / force(Bonded(RUBBER, FOAM), body, 8) < 3


def tables(folder, **skin):
    matcal.write_card(matcal.MaterialCard("foam", FOAM), folder / "foam.json")
    return {"body": {"radius_mm": 40}, "punch": [{"profile": "sphere", "diameter_mm": 8, "depth_mm": 0.9}],
            "electrodes": {"soft": True}, "accuracy": {"signal": 0.05},
            "skin": {"kind": "layer", "thickness_mm": 3, "base_thickness_mm": 6,
                     "base_card": str(folder / "foam.json"), **skin}}


def test_a_scene_on_a_base_is_planned_and_comes_back_from_its_tables(tmp_path):
    scene = scene_from(tables(tmp_path))
    assert (scene.body.thickness_m, scene.body.base_m) == pytest.approx((0.009, 0.006))
    assert scene_from(scene_tables(scene)) == scene
    rubber = matcal.MaterialCard("rubber", RUBBER, conductivity=matcal.Conductivity(5.0, [-2, 2, -1], (-0.3, 1)))
    plan = eitsim.plan(scene, rubber)
    (base,) = [one for one in plan.decisions if one.kind == Kind.LAYER_BASE]
    assert not plan.refusal
    assert "6 mm" in base.decision
    assert "foam.json" in base.reason
    assert base.error_bound > 0


@pytest.mark.parametrize(("table", "key", "value", "said"), [
    ("skin", "base_card", "", "base_card in .skin. must name the card"),
    ("skin", "base_thickness_mm", 0, "base_thickness_mm in .skin. must be positive with base_card"),
    ("body", "thickness_mm", 3, "that of layer and base in .skin., 9"), ("electrodes", "soft", False, "soft in"),
    ("hold", "time_s", [1.0], "another Prony series")])
def test_what_is_not_built_on_a_base_is_refused_by_its_key(tmp_path, table, key, value, said):
    given = tables(tmp_path)
    with pytest.raises(ValueError, match=said):
        scene_from({**given, table: {**given.get(table, {}), key: value}})


def test_a_base_is_of_layers_and_of_one_touch(tmp_path):
    given = tables(tmp_path)
    with pytest.raises(ValueError, match="has no effect without kind"):
        scene_from({**given, "skin": {"base_thickness_mm": 6, "base_card": "foam.json"}})
    with pytest.raises(ValueError, match="must be one touch"):
        scene_from({**given, "punch": [{"x_mm": 20}, {"x_mm": -20}]})


def test_a_result_states_the_card_of_the_base(tmp_path):
    rubber = matcal.MaterialCard("rubber", RUBBER, conductivity=matcal.Conductivity(5.0, [-2, 2, -1], (-0.3, 1)))
    scene = scene_from(tables(tmp_path))
    before = cards_identity(rubber, scene.skin.base_card)
    softer = matcal.MaterialCard("foam", scaled(FOAM, 0.1), provenance={"synthetic": True})
    matcal.write_card(softer, tmp_path / "foam.json")
    after = cards_identity(rubber, scene.skin.base_card)
    assert before["sha256"] != after["sha256"] != cards_identity(rubber)["sha256"]
    assert (before["synthetic"], after["synthetic"], after["base"]["name"]) == (False, True, "foam")


def test_the_card_of_a_base_is_one_file_that_is_there(tmp_path):
    for name, said in (("none.json", "there is no file none.json"), ({"choice": ["a", "b"]}, "the name of one card")):
        with pytest.raises(ValueError, match=said):
            with_files({"skin": {"kind": "layer", "base_card": name}}, tmp_path)


def test_curved_bodies_take_no_layer_whatever_else_it_has(tmp_path):
    given = {"body": {"surface": "cylinder", "radius_mm": 45, "length_mm": 120, "thickness_mm": 5},
             "punch": {"force_N": 0.2}}
    with pytest.raises(ValueError, match=r"kind in .skin. is not built on curved bodies"):
        curved_scene({**given, "skin": tables(tmp_path)["skin"]}, tmp_path)
    with pytest.raises(ValueError, match="skin"):
        curved_scene({**given, "skin": 3}, tmp_path)


def test_a_base_without_a_card_is_refused():
    with pytest.raises(ValueError, match=r"Give a soft base in Skin, with its card"):
        eitsim.Scene(Body(Disc(0.04), 0.009, 0.006))


def test_a_sweep_knows_the_card_of_a_base_by_content():
    """A moved folder is the same design."""
    tables_in = {"skin": {"kind": "layer", "base_card": "/a/foam.json"}, "body": {}}
    moved = {"skin": {"kind": "layer", "base_card": "/b/foam.json"}, "body": {}}
    assert without_folders({"tables": tables_in}) == without_folders({"tables": moved})
    assert without_folders({"tables": {"body": {}}, "seed": 1}) == {"tables": {"body": {}}, "seed": 1}
