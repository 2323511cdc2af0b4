from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from eitsim.sweeps.measurement.instrument import below, level_db
from surrogate.data import outputs
from surrogate.data.samples import split
from surrogate.model.evaluate import material_told, transfer
from surrogate.model.predict import _widened
from surrogate.model.trained import SLACK, outside_range
from surrogate.statistics.conformal import conformal_scale, normal, sure_coverage
from surrogate.statistics.metrics import score


@pytest.mark.parametrize(("rows", "parts"), [(200, [140, 30, 30]), (60, [42, 9, 9]), (4000, [2800, 600, 600])])
def test_rows_are_split_70_15_15_by_the_seed(rows: int, parts: list[int]) -> None:
    found = split(np.arange(rows), 1)
    assert [int(np.sum(found == part)) for part in ("train", "val", "test")] == parts
    assert np.array_equal(found, split(np.arange(rows), 1))
    assert not np.array_equal(found, split(np.arange(rows), 2))


def test_too_few_rows_are_refused() -> None:
    with pytest.raises(ValueError, match="12 ok rows are too few"):
        split(np.arange(12), 0)


def test_a_score_by_hand() -> None:
    below, above = (np.tile(widths, (4, 1)).T for widths in ((0.5, 2.0, 1.0), (0.5, 1.0, 2.0)))
    found = score(np.array([1.0, 2.0, 3.0, 6.0]), np.array([1.0, 3.0, 3.0, 4.0]), below, above, "mm")
    assert (found.mse, found.mae, found.n, found.coverage_90, found.unit) == (1.25, 0.75, 4, 0.75, "mm")
    assert (found.coverage_50, found.coverage_95, found.half_width_90) == (0.5, 1.0, 1.5)
    assert found.rmse == pytest.approx(np.sqrt(1.25))
    assert found.r2 == pytest.approx(1 - 1.25 / 3.5)


def test_a_constant_target_has_no_r2() -> None:
    assert score(np.full(3, 14.0), np.array([14.0, 14.1, 13.9]), np.ones((3, 3)), np.ones((3, 3)), "mm").r2 is None


def test_decibels() -> None:
    assert below(60, 2.0) == pytest.approx(2e-3)
    assert level_db(2e-3, 2.0) == pytest.approx(60)


@pytest.mark.parametrize(("rows", "coverage"), [(9, 0.9), (30, 0.9), (600, 0.9), (600, 0.5), (600, 0.95)])
def test_conformal_intervals_cover_what_they_promise(rows: int, coverage: float) -> None:
    rng = np.random.default_rng(0)
    sd = rng.uniform(0.5, 2, (2000, rows + 1))
    ratio = np.abs(rng.standard_t(3, (2000, rows + 1)))
    scale = conformal_scale((ratio * sd)[:, :rows].T, sd[:, :rows].T, rows, coverage)
    covered = np.mean(ratio[:, rows] <= scale)
    assert coverage - 0.015 < covered < coverage + 1 / (rows + 1) + 0.015


@pytest.mark.parametrize("rows", [9, 30, 110])
def test_calibrations_cover_less_than_is_told_as_seldom_as_it_is_told(rows: int) -> None:
    """The coverage of an interval of uniform ratios is its length."""
    ratio = np.random.default_rng(1).random((rows, 4000))
    length = conformal_scale(ratio, np.ones_like(ratio), rows, branched=np.zeros(4000, bool))
    unlucky = np.mean((length if rows > 9 else ratio.max(axis=0)) < sure_coverage(rows))
    assert unlucky == pytest.approx(0.05, abs=0.012)


def test_the_order_statistic_is_the_one_of_exchangeable_errors() -> None:
    """Of 30 ratios the 28th, whatever copies of them there are."""
    error, sd = np.arange(1.0, 31.0)[:, None], np.ones((30, 1))
    assert conformal_scale(error, sd, 30)[0] == 28
    assert conformal_scale(np.tile(error, (3, 1)), np.tile(sd, (3, 1)), 30)[0] == 28


def test_few_rows_fall_back_on_the_larger_of_both() -> None:
    assert conformal_scale(np.array([[0.1], [0.2]]), np.ones((2, 1)), 2)[0] == normal(0.9)
    assert conformal_scale(np.array([[0.1], [5.0]]), np.ones((2, 1)), 2)[0] == 5.0


def test_one_of_two_punches_in_doubt_is_held_by_its_interval_though_most_rows_are_sure() -> None:
    """Diameters 0 or 1, the mean p read; 19 rows of 20 are sure."""
    rng = np.random.default_rng(0)
    p = np.where(np.arange(1000) % 20 > 0, 1e-9, rng.uniform(0.3, 0.7, 1000))
    error, sd = (p - (rng.uniform(size=1000) < p))[:, None], np.sqrt(p * (1 - p))[:, None]
    scales = {known: conformal_scale(error, sd, 1000, 0.9, np.array([known])) for known in (False, True)}
    held = {known: np.mean((np.abs(error) <= scale * sd)[::20]) for known, scale in scales.items()}
    print("rows in doubt held by 90 % intervals:", held)
    assert held[False] == 0
    assert held[True] >= 0.9


def test_outputs_are_chosen_by_name() -> None:
    assert outputs.chosen("all") == outputs.NAMES
    assert outputs.chosen("F, x0") == ("x0", "F")
    with pytest.raises(ValueError, match="'z' is unknown; known: all, x0, y0, d, F, sigma_max"):
        outputs.chosen("x0,z")


def test_sets_are_compared_on_their_unseen_rows() -> None:
    def scores(rmse: float, *parts: str) -> dict[str, Any]:
        return {"outputs": {"x0": {part: {"rmse": rmse, "unit": "mm"} for part in parts}}}

    sets = {"own": scores(0.2, "train", "test"), "mesh": scores(0.5, "all"), "seen": scores(0.1, "train")}
    rows = transfer(sets)["x0"]
    assert [(row["set"], row["part"]) for row in rows] == [("own", "test"), ("mesh", "all")]
    assert [row["rmse_over_first"] for row in rows] == pytest.approx([1.0, 2.5])


def test_intervals_widen_by_strangeness_and_to_the_range_of_the_punch_outside_it() -> None:
    """x0 within [-10, 10] mm, F within [0.5, 2.0] N: factors from 1 on, 10 and the whole range of F outside, and never
    more than the range."""
    trained: Any = SimpleNamespace(lowest=np.array([-10.0, 0.5]), highest=np.array([10.0, 2.0]))
    model: Any = SimpleNamespace(trained=trained, names=["x0", "F"])
    found = _widened(model, np.full((4, 2), [0.5, 0.1]), np.array([0.2, 3.0, 1.0, 1e9]),
                     np.array([False, False, True, False]))
    assert found == pytest.approx(np.array([[0.5, 0.1], [1.5, 0.3], [5.0, 1.5], [20.0, 1.5]]))


@pytest.mark.parametrize(("cards", "calibrated", "here", "said"), [
    (3, 1, 1, "rows of one card"), (3, 3, 1, "spread of 3 cards"), (1, 1, 1, "have one card."), (1, 1, 5, "have 5"),
    (None, 1, 1, "")])
def test_what_intervals_hold_of_the_material_follows_the_cards(cards: int | None, calibrated: int, here: int,
                                                               said: str) -> None:
    model: Any = SimpleNamespace(record={"dataset": {"cards": cards}, "calibration": {"cards": calibrated}},
                                 method="forward")
    samples: Any = SimpleNamespace(card=np.arange(10) % here)
    found = material_told(model, samples)
    assert said in found
    assert ("train on a sweep" in found) == (here > 1 and cards == 1)
    assert bool(found) == bool(said)


def test_values_are_outside_from_a_part_of_the_trained_range_past_its_ends() -> None:
    trained: Any = SimpleNamespace(lowest=np.array([100.0]), highest=np.array([110.0]))
    model: Any = SimpleNamespace(trained=trained, names=["A_c"], method="ridge")
    slack = SLACK * 10.0
    found: Any = SimpleNamespace(value=np.array([[100 - 2 * slack], [100 - slack / 2], [110 + slack / 2],
                                                 [110 + 2 * slack]]))
    assert outside_range(model, found)[:, 0].tolist() == [True, False, False, True]
