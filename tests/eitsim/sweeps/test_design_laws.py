"""Laws and lists of a design: quantiles, ends, strata, every combination once, and mistakes named by their key."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from scipy import stats
from scipy.stats import qmc

from eitsim.sweeps.design.design import Design, design_from, scene_at, tables_at
from eitsim.sweeps.design.distributions import distribution_of

SEEDS = some.integers(0, 2**32)
RAW = {"punch": {"diameter_mm": {"choice": [12, 14]}, "force_N": [0.2, 1.5]}, "skin": {"thickness_um": [15, 25]}}


def column(design: Design, key: str, table: str = "punch") -> list[Any]:
    rows = [tables_at(design, i) for i in range(design.scenes)]
    return [row["punch"][0][key] if table == "punch" else row[table][key] for row in rows]


@settings(max_examples=25, deadline=None)
@given(SEEDS, some.integers(0, 10**6), some.integers(1, 1000))
def test_a_random_row_depends_on_seed_and_index_alone(seed: int, index: int, more: int) -> None:
    few, many = (design_from(RAW | {"seed": seed}, index + n) for n in (1, 1 + more))
    assert tables_at(few, index) == tables_at(many, index)
    assert tables_at(few, index) != tables_at(design_from(RAW | {"seed": seed + 1}, index + 1), index)
    assert tables_at(few, index) != tables_at(many, index + 1)


def test_a_row_is_the_same_everywhere_and_for_ever() -> None:
    random, sobol, lhs = (tables_at(design_from(RAW | {"seed": 7, "sampler": s}, 16), 5)["punch"][0]
                          for s in ("random", "sobol", "lhs"))
    assert random == pytest.approx(
        {"diameter_mm": 14, "force_N": 1.172247552521, "x_mm": -37.56263147266, "y_mm": 76.81185663425}, rel=1e-11)
    assert sobol == pytest.approx(
        {"diameter_mm": 12, "force_N": 0.2795284515247, "x_mm": -2.006454748591, "y_mm": -36.65532337984}, rel=1e-11)
    assert lhs == pytest.approx(
        {"diameter_mm": 14, "force_N": 0.8554658177775, "x_mm": 17.28933286286, "y_mm": 82.4673071848}, rel=1e-11)


@pytest.mark.parametrize("name", ["normal", "lognormal"])
def test_quantiles_are_finite_up_to_the_largest_number_below_one(name: str) -> None:
    """A law cut off below leaves sums that round to 1, whose quantile is infinite."""
    for lo in np.linspace(0.1, 9.9, 50):
        distribution = distribution_of("d", {"dist": name, "mean": 10, "sd": 2, "lo": float(lo)})
        assert distribution is not None
        assert distribution.quantile is not None
        assert math.isfinite(distribution.quantile(1 - 2.0**-53))


@pytest.mark.parametrize(("raw", "named"), [
    ({"material": 3}, r"\[material\] must be a table"), ({"measurement": 3}, r"\[measurement\] must be a table"),
    ({"punch": {"place": {"grid": ["square"]}}}, "grid of place"),
    ({"punch": {"force_N": {"dist": ["normal"]}}}, "dist"),
    ({"fields": {"names": ["nothing"], "grid": ["square"]}}, r"names in \[fields\]"),
    ({"fields": {"names": ["strain"], "grid": ["square"]}}, r"grid in \[fields\]"),
    ({"fields": {"names": [{}]}}, r"names in \[fields\]"), ({"sampler": ["lhs"]}, "sampler"), ({"seed": [1]}, "seed"),
    ({"material": {"parts": [{}]}}, "parts in"), ({"fields": {"names": 3}}, "names in")])
def test_values_of_another_kind_are_told_by_their_key(raw: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        design_from({"scenes": 2} | raw)


@settings(max_examples=15, deadline=None)
@given(SEEDS, some.integers(2, 60))
def test_lhs_hits_every_stratum_once(seed: int, scenes: int) -> None:
    design = design_from(RAW | {"seed": seed, "sampler": "lhs"}, scenes)
    for key, table, lo, hi in (("force_N", "punch", 0.2, 1.5), ("thickness_um", "skin", 15, 25)):
        strata = np.floor((np.array(column(design, key, table)) - lo) / (hi - lo) * scenes)
        assert sorted(strata) == list(range(scenes))


def test_sobol_points_are_more_even_than_random_ones() -> None:
    discrepancy = {}
    for sampler in ("random", "lhs", "sobol"):
        design = design_from(RAW | {"seed": 3, "sampler": sampler}, 256)
        points = np.column_stack([column(design, "force_N"), column(design, "thickness_um", "skin")])
        discrepancy[sampler] = qmc.discrepancy((points - [0.2, 15]) / [1.3, 10])
    print(discrepancy)
    assert discrepancy["sobol"] < discrepancy["lhs"] < discrepancy["random"]
    assert discrepancy["sobol"] < 0.05 * discrepancy["random"]


@pytest.mark.parametrize(("law", "reference"), [
    ([2, 5], stats.uniform(2, 3)), ({"dist": "uniform", "lo": 2, "hi": 5}, stats.uniform(2, 3)),
    ({"dist": "loguniform", "lo": 0.01, "hi": 10}, stats.loguniform(0.01, 10)),
    ({"dist": "normal", "mean": 14, "sd": 2}, stats.norm(14, 2)),
    ({"dist": "normal", "mean": 14, "sd": 2, "lo": 13, "hi": 20}, stats.truncnorm(-0.5, 3, 14, 2)),
    ({"dist": "normal", "mean": 1, "sd": 2, "lo": 0}, stats.truncnorm(-0.5, math.inf, 1, 2)),
    ({"dist": "lognormal", "mean": 1, "sd": 0.5},
     stats.lognorm(math.sqrt(math.log(1.25)), scale=1 / math.sqrt(1.25)))])
def test_quantiles_are_those_of_the_law(law: Any, reference: Any) -> None:
    distribution = distribution_of("force_N in [punch]", law)
    assert distribution is not None
    assert distribution.quantile is not None
    u = np.linspace(0.001, 0.999, 41)
    np.testing.assert_allclose([distribution.quantile(v) for v in u], reference.ppf(u), rtol=1e-9)
    ends = (distribution.quantile(0.0), distribution.quantile(1 - 2.0**-53))
    assert distribution.ends[0] <= ends[0]
    assert ends[1] <= distribution.ends[1]
    assert np.all(np.isfinite(ends))


def test_whole_numbers_have_the_same_odds() -> None:
    distribution = distribution_of("diameter_mm in [punch]", {"dist": "integer", "lo": 10, "hi": 18})
    assert distribution is not None
    assert distribution.quantile is not None
    drawn = [distribution.quantile((i + 0.5) / 900) for i in range(900)]
    assert np.unique(drawn, return_counts=True)[1].tolist() == [100] * 9
    assert all(isinstance(value, int) for value in drawn)


def test_lists_make_every_combination_once_and_start_over() -> None:
    raw = {"punch": {"x_mm": {"list": [0, 20, 40]}, "y_mm": 0, "diameter_mm": {"list": [10, 18]}, "force_N": [0.1, 1]}}
    design = design_from(raw)
    assert design.scenes == 6
    pairs = list(zip(column(design, "diameter_mm"), column(design, "x_mm"), strict=True))
    assert pairs == [(d, x) for d in (10, 18) for x in (0, 20, 40)]
    twice = design_from(raw, 12)
    assert column(twice, "x_mm")[6:] == column(design, "x_mm")
    assert column(twice, "force_N")[:6] == column(design, "force_N") != column(twice, "force_N")[6:]


def test_any_key_is_drawn_by_words() -> None:
    raw = {"punch": {"profile": {"choice": ["flat", "sphere", "cone"]}, "conductor": {"choice": [True, False]},
                     "friction": {"choice": ["none", "coulomb"]}, "friction_coefficient": [0.2, 0.4]},
           "skin": {"strain": {"choice": ["normal", "principal"]}}}
    design = design_from(raw, 60)
    punches = [scene_at(design, i).punches[0] for i in range(60)]
    assert {p.profile for p in punches} == {"flat", "sphere", "cone"}
    assert {p.conductor for p in punches} == {True, False}
    assert {p.friction_coefficient > 0 for p in punches if p.friction == "none"} == {False}
    assert {p.friction_coefficient > 0 for p in punches if p.friction == "coulomb"} == {True}


@pytest.mark.parametrize(("table", "named"), [
    ({"force_N": {"dist": "cauchy"}}, r"force_N in \[punch\].*cauchy.*loguniform"),
    ({"force_N": {"dist": "normal", "mean": 1}}, r"force_N in \[punch\].*mean and sd.*lo or hi"),
    ({"force_N": {"dist": "normal", "mean": 1, "sd": 0}}, r"force_N in \[punch\].*sd above 0"),
    ({"force_N": {"dist": "normal", "mean": 0, "sd": 1, "lo": 9}}, r"force_N in \[punch\].*Widen lo and hi"),
    ({"force_N": {"dist": "loguniform", "lo": 0, "hi": 1}}, r"force_N in \[punch\].*lo above 0"),
    ({"force_N": {"dist": "integer", "lo": 0.5, "hi": 1}}, r"force_N in \[punch\].*whole numbers"),
    ({"force_N": {"list": []}}, r"force_N in \[punch\]"), ({"force_N": [2, 1]}, r"force_N in \[punch\].*above"),
    ({"force_N": [True, False]}, r"force_N in \[punch\]"), ({"force_N": {"choice": [1, "two"]}}, r"force_N.*'two'"),
    ({"profile": {"choice": ["flat", "spher"]}}, r"profile in \[punch\].*'spher'.*sphere"),
    ({"profile": [0, 1]}, r"profile in \[punch\]"), ({"size": [1, 2]}, "unknown key 'size'"),
    ({"palce": {}}, "unknown key 'palce' .*Did you mean 'place'"),
    ({"diametr_mm": 9}, r"in \[punch\].*Did you mean 'diameter_mm'"),
    ({"force_N": [float("nan"), 1]}, r"force_N in \[punch\] holds nan.*Give lo and hi as finite numbers"),
    ({"diameter_mm": "wide"}, r"diameter_mm in \[punch\] must be a finite number")])
def test_mistakes_name_the_key(table: dict, named: str) -> None:
    with pytest.raises(ValueError, match=named):
        design_from({"scenes": 3, "punch": table})


@pytest.mark.parametrize(("table", "key", "choice"), [
    ("electrodes", "count", [8, 16]), ("drive", "pattern", ["adjacent", "opposite"]),
    ("drive", "currents", [[[1, -1]], [[1, 0]]])])
def test_what_decides_the_readings_is_the_same_in_all_rows(table: str, key: str, choice: list[Any]) -> None:
    with pytest.raises(ValueError, match=rf"{key} in \[{table}\] is drawn, but the readings of all rows"):
        design_from({"scenes": 3, table: {key: {"choice": choice}}})


@pytest.mark.parametrize("times", [[2, 5, 60], {"choice": [[2, 5]]}, {"list": [1, [2, 5]]}])
def test_a_row_has_one_time_of_its_hold(times: Any) -> None:
    with pytest.raises(ValueError, match=r"time_s in \[hold\] holds several times.*\{list = "):
        design_from({"scenes": 3, "hold": {"time_s": times}})
    assert scene_at(design_from({"scenes": 1, "hold": {"time_s": [5]}}), 0).hold.time_s == (5.0,)
    drawn = design_from({"hold": {"time_s": {"list": [2, 5, 60]}}})
    assert [scene_at(drawn, i).hold.time_s for i in range(3)] == [(2.0,), (5.0,), (60.0,)]
