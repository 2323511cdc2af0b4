"""Places of touches in a design: uniform over what is left of the disc, grids, lists, and touches that stay apart."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from eitsim.scene.scene import Punch, rim_gap_m
from eitsim.sweeps.design.design import Design, design_from, scene_at, tables_at


def places(design: Design) -> np.ndarray:
    return np.array([[(p["x_mm"], p["y_mm"]) for p in tables_at(design, i)["punch"]] for i in range(design.scenes)])


def on(place: dict[str, Any], count: int | None = None, **punch: Any) -> np.ndarray:
    return places(design_from({"seed": 11, "punch": {"place": place, **punch}}, count))[:, 0]


def gap_mm(one: Punch, other: Punch) -> float:
    return 1e3 * (math.hypot(one.x_m - other.x_m, one.y_m - other.y_m) - (one.diameter_m + other.diameter_m) / 2)


@pytest.mark.parametrize("sampler", ["random", "sobol"])
def test_places_are_uniform_over_the_disc(sampler: str) -> None:
    found = places(design_from({"seed": 11, "sampler": sampler, "punch": {"diameter_mm": 14}}, 1600))[:, 0]
    rings = np.floor(8 * np.hypot(*found.T) ** 2 / 93**2)
    sectors = np.floor(8 * (np.arctan2(found[:, 1], found[:, 0]) / (2 * np.pi) % 1))
    counts = np.bincount((8 * rings + sectors).astype(int), minlength=64)
    p = stats.chisquare(counts).pvalue
    print(f"{sampler}: p = {p:.3f}")
    assert counts.size == 64
    assert p > 0.01


def test_limits_of_a_place_are_kept_and_reached() -> None:
    design = design_from({"punch": {"place": {"gap_mm": 20}, "diameter_mm": [10, 30]}}, 500)
    gaps = [1e3 * rim_gap_m(scene.body, scene.punches[0]) for scene in (scene_at(design, i) for i in range(500))]
    assert 20 <= min(gaps) < 20.5
    reach = np.hypot(*on({"within_mm": 45}, 500).T)
    assert 44 < reach.max() <= 45
    one = design_from({"body": {"radius_mm": {"choice": [6, 100]}}, "electrodes": {"width_mm": 1}}, 20)
    outcomes = set()
    for i in range(20):
        try:
            outcomes.add(bool(tables_at(one, i)))
        except ValueError as error:
            outcomes.add("does not fit" in str(error))
    assert outcomes == {True}


def test_grids_cover_the_disc_where_the_largest_punch_fits() -> None:
    square = on({"grid": "square", "spacing_mm": 10}, diameter_mm={"choice": [10, 20]})
    assert len(square) == 253
    assert set(np.unique(square)) == set(range(-90, 91, 10))
    assert np.hypot(*square.T).max() <= 90
    polar = on({"grid": "polar", "spacing_mm": 20, "gap_mm": 10}, diameter_mm=20)
    radii, counts = np.unique(np.hypot(*polar.T).round(9), return_counts=True)
    assert (radii.tolist(), counts.tolist()) == ([0, 20, 40, 60, 80], [1, 6, 12, 18, 24])
    spiral = on({"grid": "sunflower", "count": 200, "within_mm": 50})
    reach = np.hypot(*spiral.T)
    nearest = [np.sort(np.hypot(*(spiral - place).T))[1] for place in spiral]
    assert len(spiral) == 200
    assert reach.max() <= 50
    assert np.mean(reach < 25) == pytest.approx(0.25, abs=0.01)
    assert min(nearest) > 0.7 * max(nearest)


def test_a_calibration_grid_meets_every_force() -> None:
    design = design_from({"punch": {"place": {"list": [[0, 0], [10, -20]]}, "force_N": {"list": [0.5, 1, 2]}}})
    rows = [tables_at(design, i)["punch"][0] for i in range(design.scenes)]
    assert [(row["force_N"], row["x_mm"], row["y_mm"]) for row in rows] == [
        (f, x, y) for f in (0.5, 1, 2) for x, y in ((0, 0), (10, -20))]
    chosen = on({"choice": [[0, 0], [10, -20]]}, 40)
    assert {tuple(place) for place in chosen.tolist()} == {(0.0, 0.0), (10.0, -20.0)}


@pytest.mark.parametrize("sampler", ["random", "lhs", "sobol"])
def test_touches_left_to_chance_stay_apart(sampler: str) -> None:
    raw = {"sampler": sampler, "seed": 2, "touches": {"choice": [1, 2, 4]},
           "punch": {"place": {"apart_mm": 15}, "diameter_mm": [10, 25]}}
    design = design_from(raw, 120)
    scenes = [scene_at(design, i) for i in range(120)]
    assert {len(scene.punches) for scene in scenes} == {1, 2, 4}
    gaps = [gap_mm(*pair) for scene in scenes for pair in itertools.combinations(scene.punches, 2)]
    assert 15 <= min(gaps) < 20
    assert scenes[7] == scene_at(design_from(raw, 120), 7)
    if sampler == "random":
        assert scenes[7] == scene_at(design_from(raw, 8), 7)


def test_the_larger_distance_of_two_touches_holds() -> None:
    for apart in ((30, 0), (0, 30)):
        punch = [{"place": {"apart_mm": mm}} for mm in apart]
        design = design_from({"seed": 3, "punch": punch}, 60)
        assert min(gap_mm(*scene_at(design, i).punches) for i in range(60)) > 30


def test_a_touch_that_stands_fast_is_avoided_and_one_without_room_is_told() -> None:
    raw = {"punch": [{"diameter_mm": 60, "x_mm": [-60, 60]}, {"x_mm": 0, "y_mm": 0, "diameter_mm": 20}]}
    design = design_from(raw, 30)
    assert all(abs(x) > 40 for x in places(design)[:, 0, 0])
    assert np.all(places(design)[:, 1] == 0)
    with pytest.raises(ValueError, match=r"touch . found no place among the others in 1000 draws.*smaller punches"):
        design_from({"touches": 4, "punch": {"diameter_mm": 90}}, 3)


def test_touches_have_tables_of_their_own_or_share_one() -> None:
    shared = design_from({"touches": [1, 3], "punch": {"place": {"list": [[0, 0], [40, 0]]}, "force_N": [0.1, 1]}}, 50)
    forces = [[p.force_N for p in scene_at(shared, i).punches] for i in range(50)]
    assert {len(row) for row in forces} == {1, 2, 3}
    assert all(len(set(row)) == len(row) for row in forces)
    own = design_from({"touches": {"list": [1, 2]}, "punch": [{"x_mm": -30, "diameter_mm": 10}, {"x_mm": 30}]})
    assert [[p.diameter_m for p in scene_at(own, i).punches] for i in range(2)] == [[0.01], [0.01, 0.014]]


@pytest.mark.parametrize(("raw", "named"), [
    ({"place": {"grid": "hexagonal", "spacing_mm": 5}}, "'hexagonal' is unknown; known: square, polar, sunflower"),
    ({"place": {"grid": "square", "count": 5}}, "takes spacing_mm and no count"),
    ({"place": {"grid": "polar", "spacing_mm": 0}}, "spacing_mm of place"),
    ({"place": {"spacing_mm": 5}}, "belongs to a grid"), ({"place": {"list": [[0]]}}, r"\[\[x, y\], ...\]"),
    ({"place": {"gap": 5}}, "unknown 'gap'"), ({"place": {"gap_mm": -1}}, "gap_mm of place"),
    ({"place": {"list": [[0, 0]], "gap_mm": 5}}, "gap_mm .* no effect on a list"),
    ({"place": {"list": [[0, 0]], "apart_mm": 5}}, "apart_mm .* no effect on a list"),
    ({"place": {"grid": "square", "spacing_mm": 9, "apart_mm": 5}}, "apart_mm .* no effect on a grid"),
    ({"place": {}, "y_mm": 0}, "both place and y_mm"),
    ({"place": {"grid": "square", "spacing_mm": 5}, "diameter_mm": {"dist": "normal", "mean": 14, "sd": 1}},
     "leaves no room for a grid"), ({"place": [0, 10]}, "place in .punch. takes")])
def test_mistakes_in_places_are_named(raw: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        design_from({"scenes": 3, "punch": raw})


@pytest.mark.parametrize("touches", [
    2.0, [1.0, 2.0], {"choice": [1.0, 2.0]}, {"list": [2.0, 1.0]}, {"rows": [1.0, 2.0]},
    {"dist": "integer", "lo": 1.0, "hi": 2.0}])
def test_whole_numbers_of_touches_may_be_written_with_a_point(touches: Any) -> None:
    design = design_from({"scenes": 2, "touches": touches, "punch": [{"x_mm": -30}, {"x_mm": 30}]})
    assert {len(scene_at(design, i).punches) for i in range(2)} <= {1, 2}


@pytest.mark.parametrize(("touches", "named"), [
    (0, "touches must be a whole number"), ([1, 1.5], "whole number"), ({"choice": [1, 5]}, r"2 .* are given"),
    ("two", "touches must be"), ({"dist": "normal", "mean": 2, "sd": 1}, "touches must be"),
    ({"dist": "uniform", "lo": 1, "hi": 3}, "touches must be"), ({"choice": [1, 1.5]}, "touches must be"),
    ({"dist": "normal", "mean": 2, "sd": 1, "lo": 1, "hi": 3}, "touches must be"), (True, "touches must be"),
    ({"list": ["two"]}, "touches must be"), ({"dist": ["integer"]}, "is unknown")])
def test_mistakes_in_touches_are_named(touches: Any, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        design_from({"scenes": 3, "touches": touches, "punch": [{"x_mm": -30}, {"x_mm": 30}]})
