"""Load paths: a table recovers touches solved anew within its stated error, scales with the moduli, and says what it
does not hold."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.axisymmetric.solve_axisymmetric import force_unit, solve_touch, touch_of, under_force
from eitsim.mechanics.load_paths import build_table
from eitsim.mechanics.load_paths.build_table import build
from eitsim.mechanics.load_paths.load_path import ERRORS, course_of
from eitsim.mechanics.load_paths.table import carried_over, parts_of, shape_of, state, touch_from
from eitsim.scene.choices import Kind
from eitsim.scene.edges.disc import Disc
from eitsim.scene.scene import STRAINS, Body, Punch, scene_from
from eitsim.simulation.assumptions import stored_choice
from eitsim.simulation.choose import served
from eitsim.simulation.plan import make_plan
from eitsim.simulation.reuse import scene_shape
from eitsim.simulation.simulate import solve_scene
from eitsim.simulation.words import decision
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.load_path_choice import REPAYS, design_shape, repays
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from touchcal.errors import NotConverged

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
DEPTHS = (0.06, 0.07, 0.08)
LOW_M, HIGH_M = 0.013, 0.0145


@pytest.fixture(scope="module")
def table():
    """With few of the touches that it is checked by."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build_table, "_CHECKS", 6)
        return build(shape_of(FOAM, Body(), Punch(), [LOW_M, HIGH_M], spans=True), depths=DEPTHS)


def pressed(table, diameter_m: float = 0.0137, depth: float = 0.07) -> Punch:
    """A punch under the force of a depth, in thicknesses."""
    found = state(table, diameter_m / 0.01, depth=depth)
    assert found is not None
    mean_Pa = found.number["mean_pressure"] * FOAM.mu_0_Pa
    return Punch(x_m=0.02, diameter_m=diameter_m, force_N=mean_Pa * np.pi / 4 * diameter_m**2)


@pytest.fixture
def scene(table):
    found = scene_from({"accuracy": {"signal": 0.03}})
    return replace(found, punches=(pressed(table),))


@pytest.mark.thorough
def test_a_table_serves_its_own_shape_whose_moduli_are_rounded(table) -> None:
    """Moduli of 12 digits over mu_0 need not add up to 1, and over their sum end in other digits."""
    moduli = (0.830199673203, -1.62819339387, 1.79799372067)
    shape = replace(table.shape, parameters=(moduli, *table.shape.parameters[1:]))
    law, body, punch = parts_of(shape, shape.base)
    assert shape_of(law, body, punch).parameters != shape.parameters
    punch, own = replace(punch, force_N=None, depth_m=0.07), replace(table, shape=shape)
    assert touch_from(own, law, body, punch) is not None
    assert touch_from(own, replace(law, mu_Pa=law.mu_Pa * [1, 1, 1 + 1e-8]), body, punch) is None


def test_touches_are_recovered_within_the_stated_error(table) -> None:
    """Touches solved anew on the mesh of the paths. What these state of signals goes up and down with the point of
    contact that is the last one; what is stored is between the nodes', and on average as much."""
    rng, ratios = np.random.default_rng(1), []
    stated = np.exp(table.error_estimate[..., 4:4 + len(STRAINS)])
    assert ERRORS[4] == f"log_signal_error_{STRAINS[0]}"
    for diameter, depth in zip(rng.uniform(LOW_M, HIGH_M, 4), rng.uniform(0.062, 0.075, 4), strict=True):
        punch = pressed(table, diameter, depth)
        assert punch.force_N is not None
        levels = [*course_of(FOAM, Body(), punch).levels]
        states = under_force(levels, punch.force_N / force_unit(FOAM, Body()))
        stored, fresh = touch_from(table, FOAM, Body(), punch), touch_of(FOAM, Body(), levels, states, 0.0)
        assert stored is not None
        print(stored.depth_m / fresh.depth_m - 1, table.error)
        assert 0 < abs(stored.depth_m / fresh.depth_m - 1) < 2 * table.error.depth < 2e-3
        assert stored.sigma_max_Pa == pytest.approx(fresh.sigma_max_Pa, rel=0.03)
        assert stored.contact_area_m2 == pytest.approx(fresh.contact_area_m2, rel=5e-3)
        assert np.all(stored.signal_errors >= stated.min(axis=(0, 1)) * (1 - 1e-9))
        assert np.all(stored.signal_errors <= stated.max(axis=(0, 1)) * (1 + 1e-9))
        ratios.append(stored.signal_errors / fresh.signal_errors)
        assert stored.contact_area_error is not None
        assert stored.sigma_max_error is not None
        normal = np.interp(fresh.radius_m, stored.radius_m, stored.stretch_normal)
        missed = np.gradient(fresh.radius_m) * fresh.radius_m * [(normal - fresh.stretch_normal)**2,
                                                                 (fresh.stretch_normal - 1)**2]
        assert np.sqrt(missed[0].sum() / missed[1].sum()) < 2 * table.error.strain < 0.2
    print(ratios)
    assert np.all(np.abs(np.mean(np.log2(ratios), axis=0)) < 1)


def test_all_moduli_times_a_factor_are_the_same_path(table) -> None:
    punch = pressed(table)
    assert punch.force_N is not None
    soft = touch_from(table, FOAM, Body(), punch)
    stiff = touch_from(table, replace(FOAM, mu_Pa=1e3 * FOAM.mu_Pa), Body(),
                       replace(punch, force_N=1e3 * punch.force_N))
    thick = touch_from(table, FOAM, Body(Disc(0.2), 0.02),
        replace(punch, diameter_m=2 * punch.diameter_m, fillet_m=1e-3,
                                                             force_N=4 * punch.force_N))
    assert soft is not None
    assert stiff is not None
    assert thick is not None
    assert stiff.depth_m == pytest.approx(soft.depth_m, rel=1e-12)
    assert stiff.sigma_max_Pa == pytest.approx(1e3 * soft.sigma_max_Pa, rel=1e-12)
    np.testing.assert_allclose(stiff.stretch_normal, soft.stretch_normal, rtol=1e-12)
    assert thick.depth_m == pytest.approx(2 * soft.depth_m, rel=1e-12)


def test_a_depth_is_that_of_its_force(table) -> None:
    punch = pressed(table)
    forced = touch_from(table, FOAM, Body(), punch)
    assert forced is not None
    deep = touch_from(table, FOAM, Body(), replace(punch, force_N=None, depth_m=forced.depth_m))
    assert deep is not None
    assert deep.force_N == pytest.approx(punch.force_N, rel=1e-6)


@pytest.mark.parametrize("change", [{"diameter_m": 0.0146}, {"fillet_m": 6e-4}, {"force_N": 3.0}, {"force_N": 1e-4},
                                    {"profile": "sphere"}, {"friction": "stick"}])
def test_what_a_table_does_not_hold_is_none(table, change: dict) -> None:
    punch = pressed(table)
    assert touch_from(table, FOAM, Body(), punch) is not None
    assert touch_from(table, FOAM, Body(), replace(punch, **change)) is None
    assert touch_from(table, replace(FOAM, alpha=FOAM.alpha * 1.01), Body(), punch) is None
    assert touch_from(table, FOAM, Body(thickness_m=0.011), punch) is None


@pytest.mark.slow
def test_a_scene_from_a_table_says_so(table, scene) -> None:
    quick, fresh = solve_scene(scene, CARD, table=table), solve_scene(scene, CARD)
    (said,) = [d for d in quick.plan.decisions if d.kind is Kind.STORED]
    assert said.error_bound == 2 * max(table.error.depth, table.error.signal(scene.skin.strain))
    assert Kind.FROM_REST not in [d.kind for d in quick.plan.decisions]
    missed = np.linalg.norm(quick.readings.signal_V - fresh.readings.signal_V)
    assert 0 < missed < (said.error_bound + fresh.readings.signal_error) * np.linalg.norm(fresh.readings.signal_V)
    exact = solve_scene(scene, CARD, exact=True, table=table)
    assert Kind.STORED not in [d.kind for d in exact.plan.decisions]


def test_one_table_serves_every_skin_with_the_error_of_its_own_strain(table, scene) -> None:
    touches = {}
    for strain in STRAINS:
        own = replace(scene, skin=replace(scene.skin, strain=strain), accuracy=replace(scene.accuracy, signal=0.5))
        (touches[strain],) = served(table, FOAM, own)
        assert stored_choice(table, touches[strain], own).cost == 2 * max(table.error.depth, table.error.signal(strain))
    assert len({touch.depth_m for touch in touches.values()}) == 1
    normal = touches["normal"]
    fresh = solve_touch(FOAM, scene.body, scene.punches[0])
    assert normal.signal_errors == pytest.approx(fresh.signal_errors, rel=1)
    assert normal.strain_errors == pytest.approx(fresh.strain_errors, rel=1)
    assert len(set(normal.strain_errors.tolist())) == 3


def test_a_touch_near_the_rim_or_held_to_less_error_is_solved_afresh(table, scene) -> None:
    assert served(table, FOAM, scene)[0] is not None
    near = replace(scene, punches=(replace(scene.punches[0], x_m=0.085),))
    assert served(table, FOAM, near) == (None,)
    strict = replace(scene, accuracy=replace(scene.accuracy, signal=table.error.signal("normal")))
    assert served(table, FOAM, strict) == (None,)


def test_radii_are_carried_over_with_their_edges() -> None:
    shape = shape_of(FOAM, Body(), Punch(), [0.01, 0.018], spans=True)
    radius = np.array([0.0, 0.2, 0.45, 0.5, 0.6, 10.0])
    carried = carried_over(shape, radius, 1.0, 1.8)
    np.testing.assert_allclose(carried[[0, 2, 3, 5]], [0, 0.85, 0.9, 10.0], atol=1e-12)
    assert (np.diff(carried) > 0).all()
    np.testing.assert_allclose(carried_over(shape, carried, 1.8, 1.0), radius, atol=1e-12)


def test_too_few_depths_are_no_table() -> None:
    shape = shape_of(FOAM, Body(), Punch())
    with pytest.raises(NotConverged, match="load path"):
        build(shape, depths=(0.06,))


@pytest.mark.parametrize(("punch", "diameters", "spans"), [
    ({"diameter_mm": [10, 18], "force_N": [0.1, 2]}, (1.0, 1.8), True),
    ({"diameter_mm": {"choice": [18, 10, 14]}, "force_N": 1}, (1.0, 1.4, 1.8), False),
    ({"diameter_mm": 12}, (1.2,), False), ({"diameter_mm": [12, 12]}, (1.2,), False)])
def test_a_design_has_one_shape(punch: dict, diameters: tuple, spans: bool) -> None:
    shape = design_shape(design_from({"punch": punch}, 10), CARD)
    assert (shape.diameters, shape.spans) == (diameters, spans)
    assert shape == design_shape(design_from({"punch": punch, "seed": 3}, 500), CARD)


@pytest.mark.parametrize(("raw", "named"), [
    ({"punch": {"fillet_mm": [0.4, 0.6]}}, "fillet_mm"), ({"body": {"thickness_mm": [9, 11]}}, "thickness_mm"),
    ({"punch": {"diameter_mm": {"dist": "normal", "mean": 14, "sd": 0.1}}}, "without ends"),
    ({"punch": {"friction": "stick"}}, "friction"), ({"punch": {"profile": "sphere"}}, "profile = \"sphere\""),
    ({"hold": {"control": {"choice": ["force", "depth"]}}}, "control")])
def test_a_design_that_no_table_serves_says_why(raw: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        design_shape(design_from(raw, 10), CARD)


def test_punches_of_two_kinds_have_no_shape() -> None:
    with pytest.raises(ValueError, match="differ"):
        scene_shape(scene_from({"punch": [{"x_mm": 20}, {"x_mm": -20, "fillet_mm": 0.6}]}), CARD)


@pytest.mark.parametrize(("raw", "named"), [
    ({"hold": {"time_s": [60]}}, r"time_s in \[hold\].*Leave out --reuse"),
    ({"punch": {"profile": "cone"}}, r"profile = \"cone\" in \[punch\].*Leave out --reuse"),
    ({"punch": {"friction": "stick"}}, r"friction = \"stick\" in \[punch\].*Leave out --reuse")])
def test_a_scene_that_no_table_serves_says_why_and_the_mend(raw: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        scene_shape(scene_from(raw), replace(CARD, prony=Prony([0.3], [6.0])))


def test_a_table_is_made_where_it_repays_its_cost() -> None:
    raw = {"punch": {"diameter_mm": 14, "force_N": [0.1, 2]}}
    few, many = (design_from(raw, n) for n in (REPAYS - 1, REPAYS))
    shape = design_shape(few, CARD)
    assert not repays(few, shape)
    assert repays(many, shape)


def test_one_scene_has_the_path_of_its_punch() -> None:
    scene = scene_from({"punch": {"diameter_mm": 12}})
    assert scene_shape(scene, CARD) == shape_of(FOAM, Body(), scene.punches[0])
    assert Kind.FROM_REST in [d.kind for d in make_plan(scene, CARD).decisions]


def test_the_decision_names_the_measured_error(table) -> None:
    touch = touch_from(table, FOAM, Body(), pressed(table))
    assert touch is not None
    made = decision(stored_choice(table, touch, scene_from({})))
    assert "13 to 14.5 mm" in made.reason
    assert f"{table.checks} touches" in made.reason
