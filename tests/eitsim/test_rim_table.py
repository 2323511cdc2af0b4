"""What the rim changes, from a table: touches solved afresh are recovered within the stated error; where it ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from eitsim.change import signal_difference
from eitsim.design import design_from
from eitsim.near_rim import solve_near_rim
from eitsim.path import Deviation
from eitsim.results import Touch
from eitsim.reuse import decision, rim_repays, scene_shape, served
from eitsim.rim_table import RimTable, changed_diameters, near_rim_from
from eitsim.rim_tabulate import DEPTHS, GAPS, build_rim, checked, refined
from eitsim.scene import Body, Punch, scene_from
from eitsim.simulate import simulate
from eitsim.table import Table, shape_of, state, touch_from
from eitsim.tabulate import build
from matcal.card import MaterialCard
from matcal.conductivity import Conductivity
from matcal.errors import NotConverged
from matcal.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4)))


@pytest.fixture(scope="module")
def table():
    paths = build(shape_of(FOAM, Body(), Punch(), "normal"), depths=(0.055, 0.075, 0.1, 0.13))
    return replace(paths, rim=build_rim(paths, gaps=(0.5, 0.7, 1.0, 1.4), depths=(0.06, 0.08, 0.1, 0.125)))


def pressed(table, gap_m: float, depth: float) -> Punch:
    """A punch at a gap from the rim under the force of a depth far from it, in thicknesses."""
    found = state(table, 1.4, depth=depth)
    assert found is not None
    return Punch(x_m=0.093 - gap_m, force_N=found.number["mean_pressure"] * FOAM.mu_0_Pa * np.pi * 0.007**2)


def stored(table, punch: Punch) -> Touch | None:
    touch = touch_from(table, FOAM, Body(), punch, "normal")
    assert touch is not None
    return near_rim_from(table, touch, Body(), punch)


@pytest.mark.slow
def test_touches_near_the_rim_are_recovered(table) -> None:
    punch = pressed(table, 8e-3, 0.09)
    quick, fresh = stored(table, punch), solve_near_rim(FOAM, Body(), punch)
    assert quick is not None
    added = fresh.depth_m / touch_from(table, FOAM, Body(), punch, "normal").depth_m - 1
    missed = abs(quick.depth_m / fresh.depth_m - 1)
    print("the rim adds", added, "missed", missed, table.rim.error)
    assert 0 < missed < table.error.depth + table.rim.error.depth
    assert missed < added / 4
    assert signal_difference(fresh, quick.rim, fresh.rim, "normal") < 2 * table.rim.error.signal < 0.02
    assert quick.contact_area_m2 == pytest.approx(fresh.contact_area_m2, rel=0.02)


@pytest.mark.slow
def test_the_disc_may_be_turned(table) -> None:
    punch = pressed(table, 8e-3, 0.09)
    turned = replace(punch, x_m=punch.x_m * 0.6, y_m=punch.x_m * 0.8)
    straight, aslant = stored(table, punch), stored(table, turned)
    assert straight is not None
    assert aslant is not None
    assert aslant.depth_m == pytest.approx(straight.depth_m, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("gap_m", "depth"), [(4e-3, 0.09), (15e-3, 0.09), (8e-3, 0.1275)])
def test_beyond_the_table_is_none(table, gap_m: float, depth: float) -> None:
    assert stored(table, pressed(table, gap_m, depth)) is None


@pytest.mark.slow
def test_a_scene_near_the_rim_says_what_it_may_cost(table) -> None:
    punch = pressed(table, 8e-3, 0.09)
    scene = replace(scene_from({"accuracy": {"signal": 0.05}}), punches=(punch,))
    (touch,) = served(table, FOAM, scene)
    assert touch is not None
    assert "what the rim changes" in decision(table, touch, 0.01).reason
    assert served(replace(table, rim=None), FOAM, scene) == (None,)
    result = simulate(scene, CARD, table=table)
    assert result.outcome == "ok"
    (said,) = [d for d in result.plan.decisions if d.decision == "load path reused"]
    assert said.error_bound > max(table.error.depth, table.error.signal)


def test_a_table_of_changes_is_made_where_it_repays_its_cost() -> None:
    near = design_from({"punch": {"x_mm": [75, 85], "y_mm": 0, "force_N": [0.1, 2]}}, 300)
    far = design_from({"punch": {"x_mm": [0, 20], "y_mm": 0, "force_N": [0.1, 2]}}, 300)
    shape = scene_shape(scene_from({}), CARD)
    assert rim_repays(near, shape)
    assert not rim_repays(far, shape)


@pytest.mark.parametrize("diameters_m", [(0.014,), (0.01, 0.018), (0.01, 0.012, 0.014, 0.016, 0.018)])
def test_changes_of_a_choice_are_solved_where_there_are_load_paths(diameters_m: tuple) -> None:
    shape = shape_of(FOAM, Body(), Punch(), "normal", diameters_m)
    changed = changed_diameters(shape).tolist()
    assert set(changed) <= set(shape.solved)
    assert (changed[0], changed[-1]) == (shape.diameters[0], shape.diameters[-1])


def test_what_finer_solutions_add_is_quadratic_between_three() -> None:
    gaps, depths = np.array(GAPS), np.array(DEPTHS)
    i, j = np.array([0, 3, 6]), np.array([0, 4, 7])
    x, y = np.meshgrid(np.log(gaps + 0.2), np.log(depths + 0.1), indexing="ij")
    rough, added = np.sin(3 * x) * np.cos(5 * y), 0.1 * x**2 * y - 0.2 * y**2
    whole = (rough + added)[None, ..., None]
    found = refined(gaps, depths, gaps[i], depths[j], rough[None, ..., None], whole[:, i][:, :, j])
    np.testing.assert_allclose(found, whole, rtol=0, atol=1e-12)


def test_a_table_whose_error_cannot_be_told_is_none() -> None:
    none, exact = np.zeros(0), Deviation(0.0, 0.0, 0.0)
    table = Table(shape_of(FOAM, Body(), Punch(), "normal"), none, none, none, none, none, exact, 0, 0.0)
    rim = RimTable(np.array([1.4]), np.array(GAPS), np.array(DEPTHS), none, none, none.astype(np.float32), none, exact,
                   0.0)
    with pytest.raises(NotConverged, match="6 of 6 changes"):
        checked(table, rim, lambda _, places: [(None, 0.0) for _ in places])
