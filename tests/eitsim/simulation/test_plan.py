"""Plans: what is left out is said with its cost, what is not built is refused with the mend."""

import itertools
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.scene import STRAINS, Body, Punch, Skin, scene_from
from eitsim.sheet.sheet_conductance import dipole, principal_conductances, stretches, untouched_conductance
from eitsim.simulation.edge_effects import rim_effect
from eitsim.simulation.plan import make_plan
from eitsim.simulation.words import DIPOLE, DIPOLE_FORCES_N
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "instantaneous")
CARD = MaterialCard("Table 1", FOAM, Prony([0.15, 0.17, 0.06], [0.3, 5.8, 82.0]))


def test_an_interior_touch_is_axisymmetric_and_costs_little() -> None:
    plan = make_plan(scene_from({"punch": {"x_mm": 20, "y_mm": -10}}), CARD)
    assert plan.refusal == ""
    assert "axisymmetric" in plan.decisions[0].decision
    assert plan.error_bound < 0.01
    assert all(d.reason for d in plan.decisions)


def test_the_rim_effect_fades_with_distance() -> None:
    effects = [rim_effect(g, 0.01, "normal") for g in np.linspace(0, 0.06, 50)]
    assert all(a >= b for a, b in itertools.pairwise(effects))
    assert rim_effect(0.05, 0.01, "normal") < 0.003
    assert rim_effect(0.0270, 0.01, "normal") == pytest.approx(rim_effect(0.0135, 0.005, "normal"))


def test_a_conducting_punch_near_the_rim_costs_as_the_strain_in_use() -> None:
    """The rim's effect of areal strain is larger at a gap of 5 mm, and so is a share of it."""
    cost = {strain: next(d.error_bound for d in make_plan(scene_from({
        "punch": {"x_mm": 88, "conductor": True}, "skin": {"strain": strain}}), CARD, bodies=False).decisions
        if "without the rim" in d.decision) for strain in STRAINS}
    ratio = rim_effect(5e-3, 0.01, "areal") / rim_effect(5e-3, 0.01, "normal")
    assert ratio > 1.5
    assert cost["areal"] == pytest.approx(ratio * cost["normal"])


def test_soft_electrodes_leave_the_rim_as_it_is() -> None:
    punch = {"punch": {"x_mm": 88}}
    soft = scene_from(punch | {"electrodes": {"soft": True}})
    stiff, free = (make_plan(scene, CARD, bodies=False) for scene in (scene_from(punch), soft))
    named = [next((d for d in found.decisions if d.decision == "electrodes do not stiffen the layer"), None)
             for found in (stiff, free, make_plan(scene_from(punch), CARD))]
    assert named[0] is not None
    assert named[1] is named[2] is None
    assert stiff.error_bound - free.error_bound == pytest.approx(named[0].error_bound)


def test_the_rim_effect_bounds_every_measured_one() -> None:
    measured = pd.read_csv(Path(__file__).parents[3] / "benchmarks/results/rim.csv")
    measured = measured[measured["what"].isin(["effect", "hand-over"])]
    for strain in STRAINS:
        bound = [rim_effect(gap * 1e-3, 0.01, strain) for gap in measured["gap_mm"]]
        assert np.all(measured[["depth", f"{strain}_L2", f"dV_{strain}"]].max(axis=1) <= bound), strain


@pytest.mark.thorough
@pytest.mark.parametrize("strain", STRAINS)
def test_the_plan_says_what_the_choice_of_strain_does_to_the_signal(strain: str) -> None:
    """The dipole moments that it states are those of solved touches."""
    skin, law, found = Skin(strain=strain), Conductivity(30.0, (-2.0, 2.0, -1.05)), []
    for force in DIPOLE_FORCES_N:
        punch = Punch(force_N=force)
        touch = solve_touch(CARD.hyperfoam, Body(), punch)
        radius = (touch.radius_m[1:] + touch.radius_m[:-1]) / 2
        sheets = (sheet / untouched_conductance(law, skin)
                  for sheet in principal_conductances(law, skin, *stretches(touch, radius)))
        found.append(dipole(radius, *sheets) / (punch.diameter_m / 2) ** 2)
    assert found == pytest.approx(DIPOLE[strain], abs=0.01)
    (decision,) = [d for d in make_plan(scene_from({"skin": {"strain": strain}}), CARD).decisions
                   if "conductivity follows" in d.decision]
    assert all(f"{moment:.2f}" in decision.reason for moments in DIPOLE.values() for moment in moments)


def test_instantaneous_moduli_are_said_with_what_they_cost() -> None:
    (decision,) = [d for d in make_plan(scene_from({}), CARD).decisions if d.decision == "no viscoelasticity"]
    assert "instantaneous" in decision.reason
    assert "0.62" in decision.reason


@pytest.mark.parametrize(("raw", "named"), [
    ({"punch": {"x_mm": 98}}, "outside the rim"),
    ({"punch": [{"x_mm": 8.1}, {"x_mm": -6.1}]}, "0.2 mm lie between the edges of touches 1 and 2"),
    ({"punch": [{"x_mm": 6}, {"x_mm": -6}]}, "overlap by 2.0 mm"),
    ({"punch": [{"x_mm": 30}, {"x_mm": 98}]}, "touch 2: the punch's edge lies 5.0 mm outside the rim")])
def test_what_is_not_built_is_refused(raw: dict, named: str) -> None:
    assert named in make_plan(scene_from(raw), CARD).refusal


@pytest.mark.parametrize(("raw", "names"), [
    ({"punch": {"x_mm": 80, "conductor": True}}, ["floats", "three dimensions about the touch", "stiff bodies"]),
    ({"electrodes": {"kind": "patch"}, "punch": {"conductor": True}}, ["floats", "on a mesh"]),
    ({"punch": [{"x_mm": 12, "conductor": True}, {"x_mm": -12}]}, ["solved together", "stiff", "no conduction"])])
def test_a_conducting_punch_is_planned_with_what_it_leaves_out(raw: dict, names: list[str]) -> None:
    plan = make_plan(scene_from(raw), CARD)
    assert plan.refusal == ""
    for name in names:
        assert any(name in d.decision for d in plan.decisions), name


def test_only_a_sweep_leaves_a_conducting_punch_its_lone_contact_next_to_another() -> None:
    """What another punch changes of where it ends is known in three dimensions, where one scene is solved."""
    scene = scene_from({"punch": [{"x_mm": 12, "conductor": True}, {"x_mm": -12}]})
    alone = [any("touches where it would alone" in d.decision for d in make_plan(scene, CARD, bodies=bodies).decisions)
             for bodies in (True, False)]
    assert alone == [False, True]


def test_touches_at_patches_are_planned_with_those_under_a_punch_soft() -> None:
    """At 0 degrees on a patch, between two of them at half a step."""
    for angle, soft in ((0.0, True), (np.pi / 16, False)):
        place = {"x_mm": 88 * np.cos(angle), "y_mm": 88 * np.sin(angle), "diameter_mm": 8}
        plan = make_plan(scene_from({"electrodes": {"kind": "patch"}, "punch": place}), CARD)
        assert plan.refusal == ""
        assert ("electrodes do not stiffen the layer" in {d.decision for d in plan.decisions}) is soft


def test_an_edge_on_the_rim_is_refused_with_what_to_change() -> None:
    assert make_plan(scene_from({"punch": {"x_mm": 93}}), CARD).refusal == (
        "the punch's edge lies on the rim of the disc; change x_mm and y_mm so that the punch lies 0.01 mm further "
        "inwards.")
    assert make_plan(scene_from({"punch": {"x_mm": 92.99}}), CARD).refusal == ""


def test_more_accuracy_needs_more_distance() -> None:
    raw = {"punch": {"x_mm": 45}}
    assert make_plan(scene_from(raw), CARD).refusal == ""
    assert "axisymmetric about" in make_plan(scene_from(raw), CARD).decisions[0].decision
    closer = make_plan(scene_from(raw | {"accuracy": {"signal": 0.001}}), CARD)
    assert closer.refusal == ""
    assert "three dimensions" in closer.decisions[0].decision


def test_a_depth_that_squeezes_the_foam_flat_is_refused_with_the_most_that_is_not():
    refused, allowed = (make_plan(scene_from({"punch": {"depth_mm": depth}}), CARD).refusal for depth in (9.9, 9.7))
    assert "at most 9.7" in refused
    assert allowed == ""


def test_an_exact_hold_that_creeps_stays_axisymmetric_and_says_so():
    held, plain = ([d.decision for d in make_plan(scene_from(raw), CARD, exact=True).decisions]
                   for raw in ({"hold": {"time_s": [2.0]}}, {}))
    assert "mechanics axisymmetric about the punch" in held
    assert any("on the whole disc" in decision for decision in plain)


def test_lines_of_one_of_several_touches_say_of_which() -> None:
    two = make_plan(scene_from({"punch": [{"x_mm": -30}, {"x_mm": 30, "friction": "stick"}]}), CARD)
    assert [(d.touch, d.decision) for d in two.decisions if "friction" in d.decision or "stick" in d.decision] == [
        (1, "no friction"), (2, next(d.decision for d in two.decisions if d.kind == "friction"))]
    assert {d.touch for d in two.decisions} == {None, 1, 2}
    assert {d.touch for d in make_plan(scene_from({}), CARD).decisions} == {None}
