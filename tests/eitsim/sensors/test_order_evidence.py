"""What readings say of their order without a model: driven pairs that hold no measurement, reciprocity, an offset."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.sensors.conventions import Convention
from eitsim.sensors.formats.open_file import open_recording
from eitsim.sensors.inspection import Inspection, inspect
from eitsim.sensors.inspection_words import cautions
from eitsim.sensors.order_evidence import at_driven, exchanged_difference, not_taken, repeated_difference, silence
from eitsim.sensors.recognition import Order, canonical
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import drive_of_pairs, read_pairs, read_sensor, sensor_from
from eitsim.sensors.unmeasured import unmeasured

CASES = Path(__file__).parents[4] / "shared" / "cases" / "eit"
cases = pytest.mark.skipif(not CASES.exists(), reason="recordings of public cases are not here")
SIXPOINT = CASES.parents[1] / "real" / "sixpoint"
ADJACENT = Convention(16, 16, 1, "pair", 1, "all", False, 0, 1).pairs()
SKIP_2 = Convention(16, 16, 3, "pair", 1, "all", True, 4, 1).pairs()


def tank(pairs: np.ndarray, seed: int) -> np.ndarray:
    """Readings of a ring in a space of three dimensions, 1/r, which no disc is: a model of another class."""
    random, count = np.random.default_rng(seed), int(pairs.max()) + 1
    place = np.exp(2j * np.pi * (np.arange(count) + 0.03 * random.normal(size=count)) / count)
    away = np.abs(place[:, None] - place)
    np.fill_diagonal(away, np.pi / count)
    z = 1 / away + 0.3 / np.sqrt(1 + away**2)
    source, sink, plus, minus = pairs.T
    return z[plus, source] - z[plus, sink] - z[minus, source] + z[minus, sink]


def seen(frame: np.ndarray, pairs: np.ndarray | None = None, count: int = 16) -> Inspection:
    one = Recording(frame[None], np.arange(1), None, np.array([""]), "voltage", Path("a.csv"))
    sensor = None if pairs is None else sensor_from(
        {"electrodes": {"count": count}, "drive": drive_of_pairs(pairs, count)}, Path())
    return inspect(one, sensor)


def is_order(found: Inspection, pairs: np.ndarray) -> bool:
    order = found.identified.order
    return order is not None and canonical(order.pairs, order.count, False) == canonical(pairs, 16, False)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("steps", [(1, 4), (4, 1)])
def test_what_two_drives_in_turn_measure_twice_names_them_whatever_the_body(steps: tuple[int, int], seed: int) -> None:
    random, pairs = np.random.default_rng(seed), Convention(8, 8, steps[0], "pair", 1, "undriven", False, 0, 1,
                                                           then=steps[1]).pairs()
    drive = np.sort(pairs[:, :2], axis=1) @ (8, 1) * 64 + np.sort(pairs[:, 2:], axis=1) @ (8, 1)
    frame = np.abs(tank(pairs, seed)) * np.exp(0.3 * random.normal(size=4096))[drive]
    frame *= 1 + 0.005 * random.normal(size=len(pairs))
    found = seen(frame, pairs, 8)
    assert found.agrees is not False
    assert {one.convention and one.convention.then for one in found.identified.plausible} == {steps[1]}
    assert repeated_difference(frame, pairs) < 0.05


@pytest.mark.skipif(not SIXPOINT.exists(), reason="recordings of six probes are not here")
@pytest.mark.parametrize("session", [1, 2])
def test_recorded_adjacent_then_opposite_drives_are_named(session: int) -> None:
    found = inspect(open_recording(SIXPOINT / f"session{session}_frames.csv"))
    order = found.identified.order
    assert order is not None
    np.testing.assert_array_equal(order.pairs, read_pairs(SIXPOINT / "pairs.csv", 8))
    assert found.identified.words()["pattern"] == "adjacent then opposite"
    assert found.identified.sign == "magnitude"


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("pairs", [ADJACENT, SKIP_2], ids=["adjacent", "skip-2"])
def test_driven_pairs_that_are_0_name_the_order_whatever_the_body_and_the_gains(pairs: np.ndarray, seed: int) -> None:
    random = np.random.default_rng(seed)
    frame = np.where(at_driven(pairs), 0, tank(pairs, seed)) * np.exp(0.5 * random.normal(size=len(pairs)))
    found = seen(frame, pairs)
    assert found.agrees is not False
    assert any(canonical(one.pairs, 16, False) == canonical(pairs, 16, False) for one in found.identified.plausible)
    if pairs is ADJACENT:  # of readings that move with the drive the other way round looks the same
        assert is_order(found, pairs)
        assert found.dead_readings.size == 0
        assert found.not_taken.tolist() == np.flatnonzero(at_driven(pairs)).tolist()


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
def test_driven_pairs_at_the_end_of_the_range_are_no_readings(seed: int) -> None:
    frame = np.abs(tank(ADJACENT, seed))
    frame = np.minimum(frame, 1.3 * frame[~at_driven(ADJACENT)].max())
    assert unmeasured(frame[None]).sum() >= 16
    assert is_order(seen(frame), ADJACENT)


def test_a_symmetric_frame_is_at_no_end_of_its_range() -> None:
    frame = tank(ADJACENT, 0).reshape(16, 16)[0]
    even = np.array([np.roll(frame, k) for k in range(16)]).ravel()
    assert not unmeasured(even[None]).any()


def test_a_frame_that_a_touch_makes_slightly_uneven_is_at_no_end_of_its_range() -> None:
    even = tank(ADJACENT, 0).reshape(16, 16)[0]
    frame = np.array([np.roll(even, k) for k in range(16)])
    assert not unmeasured((frame * np.linspace(1, 1.005, 16)[:, None]).ravel()[None]).any()


@pytest.mark.thorough
def test_dead_electrodes_are_dead_and_driven_ones_are_not_taken() -> None:
    dead = (ADJACENT[:, 2:] == 5).any(axis=1)
    silent = at_driven(ADJACENT) | dead
    assert silence(Order(16, ADJACENT), silent) > silence(Order(16, SKIP_2), silent) + 50
    assert not not_taken(ADJACENT, dead).any()
    found = seen(np.where(silent, 0, tank(ADJACENT, 1)), ADJACENT)
    assert found.dead_electrodes == (5,)
    assert found.dead_readings.tolist() == np.flatnonzero(dead & ~at_driven(ADJACENT)).tolist()


def test_reciprocity_holds_under_the_true_order_alone_whatever_is_added() -> None:
    frame = tank(ADJACENT, 2)
    assert exchanged_difference(frame, ADJACENT) < 1e-12
    assert exchanged_difference(np.abs(frame).max() + 0.5 + frame, ADJACENT) < 1e-12
    assert exchanged_difference(frame, Convention(16, 16, 1, "pair", 1, "all", False, 3, 1).pairs()) > 0.5


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
def test_a_right_file_is_not_contradicted_by_counts_with_an_offset(seed: int) -> None:
    """Driven pairs saturate softly, as an amplifier does, and all readings stand upon an offset."""
    frame = tank(ADJACENT, seed)
    frame = 7200 + 5000 * np.tanh(frame)
    found = seen(frame, ADJACENT)
    assert found.agrees is not False
    free = seen(frame)
    assert free.identified.order is None or is_order(free, ADJACENT)


@pytest.mark.thorough
def test_an_offset_of_a_disc_s_readings_is_found(benchmark_module) -> None:  # type: ignore[no-untyped-def]
    simulated = benchmark_module("sensor_inspect")
    z = simulated.transfer(np.random.default_rng(0), 16, 1.0)
    pairs = Convention(16, 16, 1, "pair", 1, "undriven", False, 0, 1).pairs()
    source, sink, plus, minus = pairs.T
    frame = z[plus, source] - z[plus, sink] - z[minus, source] + z[minus, sink]
    offset = 3 * np.abs(frame).max()
    found = seen(frame + offset)
    assert is_order(found, pairs)
    size = np.sqrt(np.mean((frame + offset) ** 2))
    assert found.identified.level * size == pytest.approx(offset, rel=0.02)
    assert any("offset" in one for one in cautions(found))


@pytest.mark.thorough
@cases
@pytest.mark.parametrize("name", ["02_golfball_phantom_mat/vhvi.mat", "02_golfball_phantom_mat/vhvi_B.mat",
                                  "03_montreal_moving_target/demo4.mat", "16_black_sensor_serial_csv/frames256.csv"])
def test_public_recordings_are_right_or_asked_and_their_file_is_not_contradicted(name: str) -> None:
    recording = open_recording(CASES / name)
    free = inspect(recording)
    assert free.identified.order is None or is_order(free, ADJACENT)
    assert is_order(free, ADJACENT) == ("black" not in name)
    assert not free.late.size
    told = inspect(recording, sensor_from({"drive": drive_of_pairs(ADJACENT, 16)}, Path()))
    assert told.agrees is not False


@cases
def test_a_tank_s_symmetry_does_not_exclude_its_order() -> None:
    found = inspect(open_recording(CASES / "01_kaufmann_skip7_mat" / "vhvi.mat"))
    assert is_order(found, Convention(16, 16, 7, "pair", 7, "all", False, 0, 1).pairs())
    assert found.identified.unexplained < 0.002


@pytest.mark.thorough
@cases
@pytest.mark.parametrize("name", ["drop3.csv", "drop4.csv"])
def test_an_order_far_from_an_even_disc_is_the_first_of_those_asked_for(name: str) -> None:
    found = inspect(open_recording(CASES / "03_montreal_moving_target" / name)).identified
    pairs = Convention(16, 16, 1, "pair", 1, "undriven", False, 0, 1).pairs()
    assert found.order is None
    assert canonical(found.plausible[0].pairs, 16, False) == canonical(pairs, 16, False)


@pytest.mark.thorough
@cases
def test_a_file_under_which_other_pairs_would_be_0_is_contradicted() -> None:
    folder = CASES / "02_golfball_phantom_mat"
    assert inspect(open_recording(folder / "vhvi.mat"), read_sensor(folder / "sensor_named.toml")).agrees is False


@cases
@pytest.mark.parametrize(("folder", "pattern"), [("s1", "adjacent"), ("s2", "skip-2")])
def test_a_board_s_folder_states_its_order(folder: str, pattern: str) -> None:
    found = inspect(open_recording(CASES / "10_sciospec_tank_folder" / folder))
    assert (found.electrodes, found.identified.words()["pattern"], found.identified.decided_by) == (16, pattern, "file")
