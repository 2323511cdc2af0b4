"""What the rim changes, from a table: touches solved anew are recovered within the error stated for their gap
and depth; where the table ends."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.forward.nominal_sensor import signal_differences
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.load_paths.build_table import build
from eitsim.mechanics.load_paths.load_path import Deviation
from eitsim.mechanics.load_paths.rim_table import (
    between,
    cells_of,
    changed_diameters,
    deviation_at,
    extended,
    middle_depths,
    middle_gaps,
    middles_of,
    near_rim_from,
    with_cell_errors,
    within,
)
from eitsim.mechanics.load_paths.table import shape_of, state, touch_from, with_diameters
from eitsim.mechanics.load_paths.types import RimTable, Table
from eitsim.mechanics.rim.solve_near_rim import ROUGH, on_two_meshes
from eitsim.scene.choices import Kind
from eitsim.scene.drive import as_tuples
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, scene_from
from eitsim.simulation.assumptions import stored_choice
from eitsim.simulation.build_rim_table import GRID, Grid, build_rim, checked, refined
from eitsim.simulation.choose import served
from eitsim.simulation.near_edges import solve_near_rim, with_signal_errors
from eitsim.simulation.reuse import scene_shape
from eitsim.simulation.simulate import solve_scene
from eitsim.simulation.words import decision
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.load_path_choice import fine_enough_for, rim_repays
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.errors import NotConverged

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0, 0, 0], "longterm")
CARD = MaterialCard("Table 1", FOAM, None, Conductivity(30.0, [-2, 2, -1], (0, 0.4)))


@pytest.fixture(scope="module")
def table():
    paths = build(shape_of(FOAM, Body(), Punch()), depths=(0.055, 0.075, 0.1, 0.13))
    grid = Grid((0.5, 0.7, 1.0, 1.4), (0.06, 0.08, 0.1, 0.125), (0.5, 1.0, 1.4), (0.06, 0.1, 0.125))
    return replace(paths, rim=build_rim(paths, grid=grid))


def pressed(table, gap_m: float, depth: float) -> Punch:
    """A punch at a gap from the rim under the force of a depth far from it, in thicknesses."""
    found = state(table, 1.4, depth=depth)
    assert found is not None
    return Punch(x_m=0.093 - gap_m, force_N=found.number["mean_pressure"] * FOAM.mu_0_Pa * np.pi * 0.007**2)


def stored(table, punch: Punch) -> Touch | None:
    touch = touch_from(table, FOAM, Body(), punch)
    assert touch is not None
    return near_rim_from(table, touch, Body(), punch)


@pytest.mark.slow
def test_touches_near_the_rim_are_recovered(table) -> None:
    punch = pressed(table, 8e-3, 0.09)
    quick, fresh = stored(table, punch), solve_near_rim(FOAM, Body(), punch)
    assert quick is not None
    added = fresh.depth_m / touch_from(table, FOAM, Body(), punch).depth_m - 1
    missed = abs(quick.depth_m / fresh.depth_m - 1)
    print("the rim adds", added, "missed", missed, table.rim.error)
    assert quick.rim is not None
    assert quick.rim.error_estimate is not None
    depth, *signals = quick.rim.error_estimate
    assert 0 < missed < table.error.depth + depth
    assert missed < added / 4
    found = signal_differences(Body(), punch, fresh, quick.rim, fresh.rim)
    assert np.all(found < 2 * np.array(signals))
    assert signals[0] < 0.01
    assert quick.contact_area_m2 == pytest.approx(fresh.contact_area_m2, rel=0.02)


@pytest.mark.slow
def test_the_disc_may_be_turned(table) -> None:
    punch = pressed(table, 8e-3, 0.09)
    turned = replace(punch, x_m=punch.x_m * 0.6, y_m=punch.x_m * 0.8)
    straight, aslant = stored(table, punch), stored(table, turned)
    assert straight is not None
    assert aslant is not None
    assert aslant.depth_m == pytest.approx(straight.depth_m, rel=1e-12)


RECTANGLE = Body(Outline("rectangle", width_m=0.2, height_m=0.15))


@pytest.fixture(scope="module")
def straight():
    paths = build(shape_of(FOAM, RECTANGLE, Punch()), depths=(0.055, 0.075, 0.1, 0.13))
    grid = Grid((0.5, 0.7, 1.0, 1.4), (0.06, 0.08, 0.1, 0.125), (0.5, 1.0, 1.4), (0.06, 0.1, 0.125))
    return replace(paths, rim=build_rim(paths, grid=grid))


@pytest.mark.slow
@pytest.mark.parametrize("body", [RECTANGLE, Body(Outline("polygon", points_m=(
    (0.1, 0.1), (-0.1, 0.15), (-0.1, -0.15), (0.1, -0.1))))])
def test_one_table_serves_straight_edges_of_any_outline(straight, body: Body) -> None:
    """It is made on a disc whose rim is far; touches solved anew on the outline, on the table's mesh, are
    recovered. Single touches near one edge have a finer one, from which signals differ by up to four times the
    table's error here."""
    punch = pressed(straight, 8e-3, 0.09)
    alone = touch_from(straight, FOAM, body, punch)
    assert alone is not None
    quick, fresh = near_rim_from(straight, alone, body, punch), with_signal_errors(on_two_meshes(
        solve_touch(FOAM, body, punch), FOAM, body, punch, rough=ROUGH))
    assert quick is not None
    assert quick.rim is not None
    assert fresh.rim is not None
    assert quick.rim.error_estimate is not None
    np.testing.assert_allclose(quick.rim.towards, [1.0, 0.0], atol=1e-12)
    assert (quick.rim.disc_m, quick.rim.offset_m) == (fresh.rim.disc_m, pytest.approx(fresh.rim.offset_m, rel=1e-12))
    added, missed = fresh.depth_m / alone.depth_m - 1, abs(quick.depth_m / fresh.depth_m - 1)
    print("the edge adds", added, "missed", missed, quick.rim.error_estimate)
    assert 0 < missed < min(added / 4, straight.error.depth + quick.rim.error_estimate[0])
    disc, near = Body(), replace(punch, x_m=0.085)
    found = signal_differences(disc, near, fresh, *(replace(one.rim, towards=None) for one in (quick, fresh)))
    assert np.all(found < 2 * quick.rim.error_estimate[1:])


@pytest.mark.parametrize("body", [Body(), RECTANGLE])
def test_a_shape_with_fewer_diameters_is_that_of_these(body: Body) -> None:
    """So that a sweep that a wider punch has grown keeps its table."""
    few, more = (shape_of(FOAM, body, Punch(), diameters) for diameters in ((8e-3, 10e-3), (8e-3, 10e-3, 14e-3)))
    assert with_diameters(more, few.diameters, spans=False) == few


@pytest.mark.slow
def test_a_table_of_straight_edges_serves_no_round_one_and_no_disc(straight) -> None:
    turn = 2 * np.pi * np.arange(200) / 200
    polygon = Body(Outline("polygon", points_m=as_tuples(0.1 * np.column_stack([np.cos(turn), np.sin(turn)]))))
    punch = pressed(straight, 8e-3, 0.09)
    alone = touch_from(straight, FOAM, polygon, punch)
    assert alone is not None
    assert near_rim_from(straight, alone, polygon, punch) is None
    assert touch_from(straight, FOAM, Body(), punch) is None
    assert near_rim_from(straight, alone, Body(), punch) is None


def test_all_outlines_have_one_shape_and_discs_their_own() -> None:
    wider = replace(RECTANGLE, edge=replace(RECTANGLE.outline, width_m=0.3))
    shapes = {shape_of(FOAM, body, Punch()) for body in (RECTANGLE, wider, Body())}
    assert len(shapes) == 2
    assert shape_of(FOAM, RECTANGLE, Punch()).disc == pytest.approx(10.7)


@pytest.mark.thorough
def test_a_table_of_straight_edges_repays_where_touches_lie_near_one_alone() -> None:
    """Those in corners are refused, and those near round edges are solved."""
    skin, thin = {"outline": "rectangle", "width_mm": 200, "height_mm": 150}, {"signal": 0.05}
    scene = scene_from({"body": skin, "accuracy": thin})
    shape = scene_shape(scene, CARD)
    for x_mm, y_mm, repaid in (([80, 90], [-20, 20], True), ([0, 10], [0, 5], False), ([85, 90], [60, 65], False)):
        punch = {"x_mm": x_mm, "y_mm": y_mm, "force_N": [0.1, 2]}
        assert rim_repays(design_from({"body": skin, "accuracy": thin, "punch": punch}, 300), shape) is repaid


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
    assert "what the rim changes" in decision(stored_choice(table, touch, scene_from({}))).reason
    assert served(replace(table, rim=None), FOAM, scene) == (None,)
    result = solve_scene(scene, CARD, table=table, bodies=False)  # as rows of sweeps are
    assert result.outcome == "ok"
    (said,) = [d for d in result.plan.decisions if d.kind is Kind.STORED]
    assert [d.decision for d in result.plan.decisions if d.kind == "nearest_edge"] == [
        "what the rim changes of the axisymmetric touch, from a table"]
    assert said.error_bound > max(table.error.depth, table.error.signal(scene.skin.strain))


def test_a_table_of_changes_is_made_where_it_repays_its_cost() -> None:
    near = design_from({"punch": {"x_mm": [75, 85], "y_mm": 0, "force_N": [0.1, 2]}}, 300)
    far = design_from({"punch": {"x_mm": [0, 20], "y_mm": 0, "force_N": [0.1, 2]}}, 300)
    shape = scene_shape(scene_from({}), CARD)
    assert rim_repays(near, shape)
    assert not rim_repays(far, shape)


@pytest.mark.parametrize("diameters_m", [(0.014,), (0.01, 0.018), (0.01, 0.012, 0.014, 0.016, 0.018)])
def test_changes_of_a_choice_are_solved_where_there_are_load_paths(diameters_m: tuple) -> None:
    shape = shape_of(FOAM, Body(), Punch(), diameters_m)
    changed = changed_diameters(shape).tolist()
    assert set(changed) <= set(shape.solved)
    assert (changed[0], changed[-1]) == (shape.diameters[0], shape.diameters[-1])


def test_what_finer_solutions_add_is_cubic_between_four() -> None:
    gaps, depths = np.array(GRID.gaps), np.array(GRID.depths)
    fine_gaps, fine_depths = np.array(GRID.fine_gaps), depths[[0, 4, 8, 14]]
    i, j = (np.searchsorted(*pair) for pair in ((gaps, fine_gaps), (depths, fine_depths)))
    x, y = np.meshgrid(np.log(gaps + 0.2), np.log(depths + 0.1), indexing="ij")
    rough, added = np.sin(3 * x) * np.cos(5 * y), 0.1 * x**3 * y - 0.2 * y**2
    whole = (rough + added)[None, ..., None]
    found = refined(gaps, depths, fine_gaps, fine_depths, rough[None, ..., None], whole[:, i][:, :, j])
    np.testing.assert_allclose(found, whole, rtol=0, atol=1e-12)


def test_lines_go_on_to_the_rim_as_parabolas_where_changes_are_not_found() -> None:
    gaps = np.array(GRID.gaps)
    x = np.log(gaps + 0.2)
    whole = np.stack([1 + x - x**2, np.sin(x)], axis=-1)[None, :, None]
    holes = whole.copy()
    holes[:, [0, 2]] = np.nan
    found = extended(gaps, holes)
    np.testing.assert_allclose(found[..., 0], whole[..., 0], rtol=0, atol=1e-12)
    assert found[:, 3:].tolist() == whole[:, 3:].tolist()
    assert abs(found[0, 0, 0, 1] - whole[0, 0, 0, 1]) > 1e-3


def bare(error_estimate: np.ndarray, depths: tuple[float, ...] = (0.1, 0.2, 0.4)) -> RimTable:
    """A table that holds nothing but what it is off, measured in every cell, at gaps 0, 0.1, 0.3 and 0.6."""
    none = np.zeros(0)
    return RimTable(np.array([1.4]), np.array([0.0, 0.1, 0.3, 0.6]), np.array(depths), none, none,
                    none.astype(np.float32), np.zeros((1, 4, len(depths), 9)), error_estimate,
                    np.where(np.isfinite(error_estimate), error_estimate, np.nan), 0.0)


def test_the_error_is_that_of_the_gap_and_depth() -> None:
    error_estimate = np.arange(1.0, 10.0).reshape(3, 3, 1) * [1e-3, 2e-3, 1e-2, 1e-2]
    rim = bare(error_estimate)
    for gap, depth, cell in ((0.05, 0.05, (0, 0)), (0.1, 0.15, (1, 1)), (0.6, 0.1, (2, 0))):
        assert np.array_equal(deviation_at(rim, gap, depth), error_estimate[cell])
    assert [deviation_at(rim, *place) for place in ((0.7, 0.05), (0.2, 0.41))] == [None, None]


def test_cells_next_to_one_that_was_measured_too_far_off_are_left_out() -> None:
    error_estimate = np.arange(1.0, 10.0).reshape(3, 3, 1) * [1e-3, 2e-3, 1e-2, 1e-2]
    rim = within(bare(error_estimate), 15e-3, "normal")
    assert np.array_equal(np.isfinite(rim.error_estimate).all(axis=-1), np.arange(3)[:, None] * np.ones(3) == 0)
    assert (rim.error.depth, rim.error.signals.tolist()) == (3e-3, [6e-3, 3e-2, 3e-2])
    assert deviation_at(rim, 0.2, 0.15) is None
    assert not np.isfinite(within(bare(error_estimate), 15e-3, "areal").error_estimate).any()


@pytest.mark.parametrize(("own", "served"), [(9e-3, [[True, False, False], [True, False, False], 3 * [True]]),
                                             (11e-3, 3 * [3 * [True]])])
def test_cells_are_kept_up_to_twice_what_touches_solved_anew_are_off_there(own: float, served: list) -> None:
    measured = np.full((3, 3, 4), np.nan)
    measured[0, 2] = 20e-3
    measured[[0, 2, 2], [0, 0, 2]] = 1e-3
    rim = replace(bare(np.full((3, 3, 4), 20e-3)), measured=measured)
    rim.numbers[:, 0, 2, 6] = own
    assert np.isfinite(within(rim, 15e-3, "normal").error_estimate[..., 1]).tolist() == served
    assert np.isfinite(within(rim, 20e-3, "normal").error_estimate).all()


def test_cells_take_the_largest_error_of_the_checked_ones_next_to_them() -> None:
    rim = bare(np.zeros((3, 3, 4)))
    rim.error_estimate[2, 2] = np.inf
    off = {(0, 0): 1e-3, (0, 2): 2e-3, (1, 1): 4e-3, (2, 0): None}
    found = with_cell_errors(
        rim, {cell: None if one is None else Deviation(one, 2 * one * np.ones(3), 0.0) for cell, one in off.items()}
    )
    assert found.error_estimate[..., 0].tolist() == [[4e-3, 4e-3, 4e-3], [4e-3, 4e-3, 4e-3], [np.inf, 4e-3, np.inf]]
    assert found.error.signals.tolist() == 3 * [8e-3]
    alone = with_cell_errors(rim, {(0, 0): Deviation(1e-3, np.full(3, 2e-3), 0.0)})
    assert np.unique(alone.error_estimate[:2].reshape(-1, 4), axis=0).tolist() == [[1e-3, *3 * [2e-3]]]


def test_cells_are_checked_in_their_middle() -> None:
    rim = bare(np.zeros((3, 3, 4)))
    places = middles_of(rim, cells_of(rim), [1.0, 1.8])
    assert len(places) == 9
    assert [d for d, *_ in places] == [1.0, 1.0, 1.8, 1.0, 1.0, 1.8, 1.8, 1.8, 1.0]
    numbered = replace(rim, error_estimate=rim.error_estimate + np.arange(9.0).reshape(3, 3, 1))
    assert [deviation_at(numbered, gap, depth).tolist() for _, gap, depth in places] == [4 * [k] for k in range(9)]
    assert np.all(np.diff([middle_gaps(rim.gaps), middle_depths(rim.depths)]) > 0)


@pytest.mark.parametrize(("diameters_m", "spans", "requested"), [
    ((0.014,), False, [1.4]), ((0.01, 0.018), True, [1.158, 1.554]),
    ((0.01, 0.012, 0.014, 0.016, 0.018), False, [1.2, 1.6])])
def test_changes_are_checked_at_diameters_at_which_they_are_not_solved(
        diameters_m: tuple, spans: bool, requested: list[float]) -> None:
    shape = shape_of(FOAM, Body(), Punch(), diameters_m, spans=spans)
    assert between(shape) == pytest.approx(requested, rel=1e-3)


def rough(error_estimate: np.ndarray) -> Table:
    """A table without paths, exact but near the rim."""
    none = np.zeros(0)
    return Table(shape_of(FOAM, Body(), Punch()), none, none, none, none, none, Deviation(0.0, np.zeros(3), 0.0), 0,
                 0.0, rim=bare(error_estimate))


def test_cells_that_miss_the_wanted_error_are_left_out_and_it_is_told() -> None:
    error_estimate = np.full((3, 3, 4), 5e-3)
    error_estimate[0, 1:] = [2e-2, *3 * [3e-2]]
    design = design_from({"accuracy": {"signal": 0.01}}, 3)
    table, why = fine_enough_for(design, rough(error_estimate))
    assert table is not None
    assert table.rim is not None
    assert table.rim.error.signal("normal") == 5e-3
    assert why == ("touches in 6 of 9 cells of gap and depth near the rim are solved anew, in 6 since the table is "
                   "more than 0.01 off, and more than twice what touches solved anew state")
    gone = error_estimate.copy()
    gone[2, 0] = np.inf
    _, why = fine_enough_for(design, rough(gone))
    assert "solved anew, in 1 since no change was found there and in 6 since" in why
    table, why = fine_enough_for(design, rough(4 * error_estimate))
    assert table is not None
    assert table.rim is None
    assert "no table of what the rim changes" in why


def test_a_table_whose_error_cannot_be_told_is_none() -> None:
    table = rough(np.zeros((3, 3, 4)))
    assert table.rim is not None
    with pytest.raises(NotConverged, match="5 of 5 changes"):
        checked(table, table.rim, lambda _, places: [(None, 0.0) for _ in places])


def test_a_table_of_changes_that_are_not_found_is_none() -> None:
    with pytest.raises(NotConverged, match="too few gaps and depths"):
        build_rim(rough(np.zeros((3, 3, 4))), lambda _, places: [(None, 0.0) for _ in places])
