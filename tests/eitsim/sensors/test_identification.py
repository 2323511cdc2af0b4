"""The order of readings: named where imperfections of a simulated disc tell it, asked where nothing does."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from eitsim.sensors.companions import in_step, late_readings
from eitsim.sensors.conventions import MEAN, Convention, conventions, counts_for, forms, pattern_name
from eitsim.sensors.disc_field import pair_fields, ring_kernel
from eitsim.sensors.identification import identified
from eitsim.sensors.recognition import account_of, canonical, exchanged, orders_of_conventions, orders_of_sensor
from eitsim.sensors.sensor_file import pairs_of, sensor_from


@pytest.fixture(scope="module")
def simulated(benchmark_module: Callable[[str], ModuleType]) -> ModuleType:
    """benchmarks/sensor_inspect.py, which makes and judges the baselines."""
    return benchmark_module("sensor_inspect")


@pytest.mark.thorough
@pytest.mark.parametrize(("case", "named"), [("imperfect", 9), ("dead", 4), ("exchanged", 2)])
def test_scrambled_baselines_are_named_and_none_wrongly(simulated: ModuleType, case: str, named: int) -> None:
    """Seeds that the benchmark does not count; without those of 32 electrodes, which take longer."""
    verdicts: Counter[str] = Counter()
    seed = 1000
    while sum(verdicts.values()) < (10 if case == "imperfect" else 5):
        if simulated.scrambled(seed, case).convention.count < 32:
            verdicts[simulated.row(seed, case)["verdict"]] += 1
        seed += 1
    assert verdicts["wrong"] == 0
    assert verdicts["named"] >= named


@pytest.mark.parametrize(("case", "seed"), [
    ("imperfect", 2002), ("exchanged", 2007), pytest.param("exchanged", 2011, marks=pytest.mark.slow)])
def test_readings_that_mirror_each_other_are_not_taken_twice(simulated: ModuleType, case: str, seed: int) -> None:
    """8 electrodes, where orders with repeats fit the symmetry; 32, whose imperfections hide exchanged leads best."""
    assert simulated.row(seed, case)["verdict"] == "named"


@pytest.mark.thorough
def test_an_even_ring_is_asked_what_symmetry_hides(simulated: ModuleType) -> None:
    """Which way drives move where readings move with them: the same numbers on an even ring."""
    seeds = [seed for seed in range(2000, 2030) if (one := simulated.scrambled(seed, "even").convention).rotating
             and one.count == 16][:4]
    assert {simulated.row(seed, "even")["verdict"] for seed in seeds} == {"asked"}


def test_a_convention_makes_the_pairs_of_the_scene_s_drives() -> None:
    single = pairs_of(sensor_from({}, Path()))
    np.testing.assert_array_equal(Convention(16, 16, 1, "before", 0, "undriven", True, 0, 1).pairs(), single)
    rotated = pairs_of(sensor_from({"drive": {"pattern": "skip-2", "reading": "differential"}}, Path()))
    np.testing.assert_array_equal(Convention(16, 16, 3, "pair", 1, "undriven", True, 0, 1).pairs(), rotated)


@pytest.mark.parametrize("count", [8, 15, 16])
def test_counts_are_found_again_and_lists_are_whole(count: int) -> None:
    for readings in {count * (count - 3), count * count}:
        assert count in counts_for(readings)
        assert all(one.pairs().shape == (readings, 4) for one in conventions(readings, count))


def test_pattern_names() -> None:
    assert [pattern_name(step, 16) for step in (1, 15, 8, 3, 13)] == ["adjacent", "adjacent", "opposite", "skip-2",
                                                                       "skip-2"]


def test_forms_know_reciprocity_and_signs() -> None:
    pairs = np.array([[0, 1, 5, 4], [5, 4, 0, 1], [1, 0, 5, 4], [1, 0, 4, 5]])
    found = forms(pairs, True)
    assert (found[:, :4] == found[0, :4]).all()
    assert (found[:, 4] * found[0, 4]).tolist() == [1, 1, -1, 1]


def test_canonical_is_the_same_for_a_turned_mirrored_ring_and_no_other() -> None:
    pairs = Convention(16, 16, 3, "pair", 1, "undriven", True, 2, -1).pairs()
    moved = (5 - pairs) % 16
    assert canonical(moved, 16, True) == canonical(pairs, 16, True)
    assert canonical(moved[:, [1, 0, 2, 3]], 16, True) == canonical(pairs, 16, True)  # one sign throughout
    assert canonical(moved[::-1], 16, True) != canonical(pairs, 16, True)
    mean = Convention(8, 8, 1, "mean", 0, "all", True, 2, -1).pairs()
    assert (mean == MEAN).any()
    assert canonical(np.where(mean == MEAN, MEAN, (3 - mean) % 8), 8, True) == canonical(mean, 8, True)


def test_the_kernel_of_narrow_electrodes_is_that_of_points() -> None:
    turns = np.arange(1, 16)
    points = -np.log(2 * np.sin(np.pi * turns / 16)) / np.pi
    np.testing.assert_allclose(ring_kernel(16, 1e-3)[1:], points, atol=1e-3)


def test_the_account_of_the_true_order_leaves_the_noise() -> None:
    pairs = Convention(16, 16, 1, "pair", 1, "undriven", True, 0, 1).pairs()
    order, *turned = orders_of_sensor(pairs, 16)
    kernel, turns = ring_kernel(16, 0.3), (np.arange(16)[:, None] - np.arange(16)) % 16
    z = kernel[turns]
    source, sink, plus, minus = pairs.T
    frame = z[plus, source] - z[plus, sink] - z[minus, source] + z[minus, sink]
    frame += 0.01 * np.sqrt(np.mean(frame**2)) * np.random.default_rng(0).normal(size=frame.shape)
    assert account_of(frame, order, signed=True).unexplained == pytest.approx(0.01, rel=0.2)
    assert account_of(frame, turned[4], signed=True).unexplained > 0.3
    assert account_of(frame, exchanged(order, 3, 4), signed=True).unexplained > 0.05


def test_orders_of_conventions_are_listed_once() -> None:
    orders = orders_of_conventions(192, counts_for(192))
    assert len({one.pairs.tobytes() for one in orders}) == len(orders)


@pytest.mark.thorough
@pytest.mark.parametrize(("step", "rotating", "first", "advance", "named"), [
    (8, False, 0, 1, True), (3, False, 7, 1, True), (1, False, 3, -1, True), (2, True, 14, -1, False)])
def test_touches_name_the_order_or_leave_it_among_those_asked_for(step: int, rotating: bool, first: int, advance: int,
                                                                  named: bool) -> None:
    """Signals of small touches by the disc's fields, which the method does not use."""
    random = np.random.default_rng(5)
    pairs = Convention(16, 16, step, "pair", 1, "undriven", rotating, first, advance).pairs()
    places = 0.9 * np.sqrt(random.random(300)) * np.exp(2j * np.pi * random.random(300))
    fields = np.conj(pair_fields(pairs[:, :2], 16, places)) * pair_fields(pairs[:, 2:], 16, places)
    signals = np.real(fields).T * random.uniform(0.5, 2, 300)[:, None]
    signals += 0.02 * np.sqrt(np.mean(signals**2)) * random.normal(size=signals.shape)
    orders = orders_of_conventions(len(pairs), counts_for(len(pairs)))
    found = identified(None, signals, orders, kind="difference")
    true = canonical(pairs, 16, False)
    assert found.decided_by == "touches"
    assert true in {canonical(one.pairs, one.count, False) for one in found.plausible}
    assert (found.order is not None) == named


def test_touches_say_nothing_where_drives_leave_no_gaps() -> None:
    random = np.random.default_rng(6)
    signals = random.normal(size=(50, 3)) @ random.normal(size=(3, 256))
    assert identified(None, signals, orders_of_conventions(256, counts_for(256)), kind="difference").plausible == ()


def test_readings_that_follow_one_frame_late_are_found_and_put_in_step() -> None:
    random = np.random.default_rng(0)
    true = random.normal(size=(200, 3)) @ random.normal(size=(3, 40)) + 0.1 * random.normal(size=(200, 40))
    late = true.copy()
    late[1:, :7] = true[:-1, :7]
    found = late_readings(late)
    assert np.flatnonzero(found).tolist() == list(range(7))
    np.testing.assert_array_equal(in_step(late, found), true[:-1])
    assert not late_readings(true).any()
