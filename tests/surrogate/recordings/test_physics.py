"""What a model of the sensor expects of patterns: the fields, how the sensor lies, a sweep in their place, and when it
is used. All presses are synthetic: exact signals of circular spots, each reading with a gain of its own."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eitsim.scene.drive import Protocol
from eitsim.sensors.sensor_file import Sensor, sensor_from
from surrogate.recordings import templates
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.patterns import direction
from surrogate.recordings.physics.disc_sensitivity import DiscSensitivity
from surrogate.recordings.physics.expectation import Expectation, Pose, expectation_of
from surrogate.recordings.physics.simulated_patterns import read_simulated
from surrogate.recordings.physics.turned_readings import RingSymmetry
from touchcal.arrays import Array
from touchcal.errors import InputFileError

SENSOR = sensor_from({}, Path())
MIDDLE, TURN = np.array([30.0, -40.0]), 2.0


def labelled_presses(synthetic: Callable[..., tuple[Array, Array]], count: int, seed: int, *,
                     mirrored: bool = False) -> tuple[Array, Array]:
    """Signals (n, 208) with gains of either sign, and places (n, 2), mm, in coordinates in which the sensor is turned,
    moved and, where asked, mirrored."""
    touch, signal = synthetic(count, seed)
    rng = np.random.default_rng(50)
    gains = np.exp(0.3 * rng.standard_normal(signal.shape[1])) * rng.choice([-1, 1], signal.shape[1])
    z = touch[:, 0] + 1j * touch[:, 1]
    z = (np.conj(z) if mirrored else z) * np.exp(1j * TURN)
    return signal * gains, np.stack([z.real, z.imag], axis=1) + MIDDLE


def test_the_sensitivity_is_the_signal_of_a_small_spot(spots: Callable[..., Array]) -> None:
    place = np.array([[0.0, 0.0], [40.0, 20.0], [-10.0, 70.0]])
    expected = DiscSensitivity(SENSOR.protocol)((place[:, 0] + 1j * place[:, 1]) / 100)
    exact = direction(spots(place, np.full(3, 0.5), np.full(3, 0.2)))
    assert np.abs(np.sum(expected * exact, axis=1)).min() > 0.999
    assert np.abs(np.sum(expected * exact[[1, 2, 0]], axis=1)).max() < 0.9


@pytest.mark.parametrize("mirrored", [False, True])
def test_how_the_sensor_lies_is_found_from_few_presses(synthetic: Callable[..., tuple[Array, Array]],
                                                      mirrored: bool) -> None:
    signal, place = labelled_presses(synthetic, 20, 1, mirrored=mirrored)
    pose = expectation_of(SENSOR).pose(direction(signal), place)
    assert pose.mirrored == mirrored
    assert abs(np.angle(np.exp(1j * (pose.turn - TURN)))) < 0.05
    assert abs(pose.middle - complex(*MIDDLE)) < 5
    assert pose.radius == pytest.approx(100, rel=0.1)


def test_a_pose_puts_electrode_0_at_1_and_places_outside_on_the_rim() -> None:
    pose = Pose(complex(*MIDDLE), 100.0, TURN, mirrored=False)
    there = MIDDLE + np.array([[0.0, 0.0], [50 * np.cos(TURN), 50 * np.sin(TURN)], [0.0, 300.0]])
    found = pose.on_disc(there)
    np.testing.assert_allclose(found[:2], [0, 0.5], atol=1e-12)
    assert abs(found[2]) == pytest.approx(0.97)
    other = Pose(complex(*MIDDLE), 100.0, TURN, mirrored=True)
    np.testing.assert_allclose(other.on_disc(there), np.conj(found), atol=1e-12)


@pytest.mark.slow
def test_templates_go_on_from_physics_and_read_better_from_few_presses(
        synthetic: Callable[..., tuple[Array, Array]]) -> None:
    signal, place = labelled_presses(synthetic, 15, 2)
    new, there = labelled_presses(synthetic, 100, 3)
    blind, informed = (templates.fit(signal, place, time_blocks(15), compress=False, priors=priors).templates
                       for priors in ((templates.nothing,), (templates.nothing, expectation_of(SENSOR).learn)))
    assert informed.weights[1] > 0.5
    miss = [np.linalg.norm(one.read(new)[0] - there, axis=1).mean() for one in (blind, informed)]
    assert miss[1] < 0.8 * miss[0]


@pytest.mark.slow
def test_physics_that_does_not_explain_the_presses_does_no_harm(synthetic: Callable[..., tuple[Array, Array]]) -> None:
    signal, place = labelled_presses(synthetic, 15, 2)
    other = Expectation(DiscSensitivity(SENSOR.protocol), 100.0, np.random.default_rng(4).permutation(signal.shape[1]))
    new, there = labelled_presses(synthetic, 100, 3)
    blind, tried = (templates.fit(signal, place, time_blocks(15), compress=False, priors=priors).templates
                    for priors in ((templates.nothing,), (templates.nothing, other.learn)))
    miss = [np.linalg.norm(one.read(new)[0] - there, axis=1).mean() for one in (blind, tried)]
    assert tried.weights[1] < 0.5
    assert miss[1] < 1.05 * miss[0]


def test_a_sweep_gives_the_patterns_of_its_touches(sweep: Path, synthetic: Callable[..., tuple[Array, Array]]) -> None:
    touch, signal = synthetic(40, 77, reach_mm=60.0)
    expected = direction(read_simulated(sweep, SENSOR)((touch[:, 0] + 1j * touch[:, 1]) / 100))
    assert np.sum(expected * direction(signal), axis=1).min() > 0.99  # signs too, which linear sensitivity leaves open
    assert np.sum(expected * direction(signal)[::-1], axis=1).mean() < 0.5


@pytest.mark.parametrize(("tables", "said"), [
    ({"electrodes": {"count": 8}}, "it simulates 16 electrodes, and the sensor has 8"),
    ({"drive": {"pattern": "opposite", "reading": "differential"}}, "it simulates 208 readings a frame"),
    ({"drive": {"pattern": "skip-1"}}, "its protocol is another: reading 0 is a current from electrode 0 to 1"),
])
def test_a_sweep_of_another_sensor_is_refused(sweep: Path, tables: dict[str, dict[str, object]], said: str) -> None:
    other: Sensor = sensor_from(tables, Path())
    with pytest.raises(InputFileError, match=said):
        read_simulated(sweep, other)


def ringed(synthetic: Callable[..., tuple[Array, Array]], count: int, seed: int) -> tuple[Array, Array]:
    """Presses of a sensor whose instrument reads something else of the same skin: of each reading, a third of the one
    two turns on, which no model of the drive expects."""
    touch, signal = synthetic(count, seed)
    frame = signal.reshape(count, 16, 13)
    z = np.conj(touch[:, 0] + 1j * touch[:, 1]) * np.exp(1j * TURN)
    seen = frame - 0.6 * np.roll(frame, 2, axis=1) + 0.4 * np.roll(frame, 5, axis=2)
    return seen.reshape(count, -1), np.stack([z.real, z.imag], axis=1) + MIDDLE


def test_readings_of_one_kind_are_each_other_turned() -> None:
    kind, turn = RingSymmetry(SENSOR.protocol).turned
    np.testing.assert_array_equal(kind, np.tile(np.arange(13), 16))
    np.testing.assert_array_equal(turn, np.repeat(np.arange(16), 13))
    protocol = Protocol(SENSOR.protocol.currents_A[:15], SENSOR.protocol.weights[:15])
    assert (RingSymmetry(protocol).turned[0] == -1).all()


@pytest.mark.thorough
def test_the_symmetry_of_the_ring_foresees_what_no_press_was_near_to(synthetic: Callable[..., tuple[Array, Array]]
                                                                     ) -> None:
    signal, place = ringed(synthetic, 25, 5)
    new, there = ringed(synthetic, 100, 6)
    view = templates.view_of(signal, readings=False)
    expected = RingSymmetry(SENSOR.protocol).learn(view.of(signal), place)
    for found, exact in ((expected.at(there), view.of(new)), (expected.of(place), view.of(signal))):
        left = exact - exact.mean(axis=0)
        assert np.sum((left - (found - found.mean(axis=0))) ** 2) < 0.35 * np.sum(left**2)
    blind, informed, by_disc = (templates.fit(signal, place, time_blocks(25), compress=False, priors=(
        templates.nothing, *more)).templates for more in (
            (), (RingSymmetry(SENSOR.protocol).learn,), (expectation_of(SENSOR).learn,)))
    miss = [np.linalg.norm(one.read(new)[0] - there, axis=1).mean() for one in (blind, informed, by_disc)]
    assert informed.weights[1] > 0.8
    assert miss[1] < 0.85 * min(miss[0], miss[2])


def test_a_ring_that_is_not_the_same_all_round_is_not_believed(synthetic: Callable[..., tuple[Array, Array]]) -> None:
    signal, place = labelled_presses(synthetic, 15, 2)
    order = np.random.default_rng(4).permutation(signal.shape[1])
    tried = templates.fit(signal[:, order], place, time_blocks(15), compress=False,
                          priors=(templates.nothing, RingSymmetry(SENSOR.protocol).learn)).templates
    assert tried.weights[1] < 0.3
