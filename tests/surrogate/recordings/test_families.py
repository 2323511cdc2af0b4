"""Each family of readers on synthetic presses, and how they are combined."""

import numpy as np
import pytest

from surrogate.recordings import kernel_ridge, networks, stacking, templates
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.dead_channels import filled, learn_readings
from surrogate.recordings.patterns import learn_features
from surrogate.recordings.presses import Presses
from surrogate.statistics.conformal import calibrated, radius
from touchcal.arrays import Array

from .conftest import synthetic_presses

Pressed = tuple[Presses, Array]


def distance(value: Array, place: Array) -> float:
    return float(np.linalg.norm(value - place, axis=1).mean())


def test_blocks_are_runs_of_equal_length() -> None:
    blocks = time_blocks(21)
    assert np.all(np.diff(blocks) >= 0)
    assert set(np.bincount(blocks)) == {1, 2}
    assert set(np.bincount(time_blocks(1603))) == {200, 201}
    assert len(np.bincount(time_blocks(1603))) == 8


@pytest.mark.parametrize("compress", [False, True])
def test_templates_read_new_presses_and_say_so_of_held_out_ones(presses: Pressed, compress: bool) -> None:
    signal, place = presses[0].signal, presses[1]
    fitted = templates.fit(signal, place, time_blocks(len(place)), compress=compress)
    new, there = synthetic_presses(2, 100)
    error = distance(fitted.templates.read(new.signal)[0], there)
    assert error < 8
    assert distance(fitted.place, place) == pytest.approx(error, rel=0.6)


def test_templates_of_direction_do_not_depend_on_depth(presses: Pressed) -> None:
    fitted = templates.fit(presses[0].signal, presses[1], time_blocks(len(presses[1])), compress=False)
    once, thrice = (fitted.templates.read(depth * presses[0].signal)[0] for depth in (1.0, 3.0))
    np.testing.assert_allclose(once, thrice, atol=1e-6)


def test_kernel_ridge_chooses_by_what_refits_without_a_row_would_say(presses: Pressed) -> None:
    signal, place = presses[0].signal, presses[1]
    fitted = kernel_ridge.fit(signal, place)
    each = kernel_ridge.held_out(fitted, signal, place, np.arange(len(place)))
    nodes = fitted.nodes
    scores = {(width, ridge): score for score, width, ridge in kernel_ridge._leave_one_out(nodes, place, None)}
    width, ridge = min(scores, key=lambda one: abs(one[0] - fitted.width) + abs(one[1] - fitted.ridge))
    assert (width, ridge) == pytest.approx((fitted.width, fitted.ridge))
    # The quick formula keeps the mean of all rows; refits take their own.
    assert distance(each, place) == pytest.approx(scores[width, ridge], rel=0.05)


def test_networks_learn_and_hold_rows_out(presses: Pressed) -> None:
    inputs, place = learn_features(presses[0].signal).of(presses[0].signal), presses[1]
    blocks = time_blocks(len(place))
    ensemble, held_out = networks.fit(inputs, place, blocks, seed=1, epochs=60)
    seen = distance(ensemble.read_each(inputs).mean(axis=0), place)
    assert seen < 0.8 * distance(held_out, place)
    assert distance(held_out, place) < 0.6 * distance(np.broadcast_to(place.mean(axis=0), place.shape), place)


def test_networks_are_the_same_for_the_same_seed(presses: Pressed) -> None:
    inputs, place, blocks = presses[0].signal[:20], presses[1][:20], time_blocks(20)
    one, two, other = (networks.fit(inputs, place, blocks, seed, epochs=2)[1] for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - other).max() > 1e-3


def test_many_rows_are_seen_in_fewer_epochs_and_few_in_all() -> None:
    """A network of one output takes as many batches from 1,400 rows as from 5,000; up to 1,151 rows all epochs stay."""
    for rows in (1, 10, 87, 350, 1151):
        batch, each, epochs = networks.schedule(rows, networks.EPOCHS)
        assert rows - batch < batch * each <= rows
        assert epochs == networks.EPOCHS
    for rows in (1152, 1400, 5000):
        batch, each, epochs = networks.schedule(rows, networks.EPOCHS)
        assert networks.MOST_STEPS - each < each * epochs <= networks.MOST_STEPS
    assert networks.schedule(10**6, networks.EPOCHS)[2] == 1


def test_weights_are_the_inverse_variances_of_independent_errors() -> None:
    rng = np.random.default_rng(0)
    target, size = np.zeros((20000, 2)), np.array([1.0, 2.0, 4.0])
    found = stacking.weights(size[:, None, None] * rng.standard_normal((3, 20000, 2)), target, np.ones(3))
    np.testing.assert_allclose(found, size**-2 / np.sum(size**-2), atol=0.02)


def test_a_family_whose_error_is_another_ones_and_more_has_no_weight() -> None:
    rng = np.random.default_rng(0)
    good = rng.standard_normal((500, 2))
    found = stacking.weights(np.stack([good, 2 * good + 0.1 * rng.standard_normal((500, 2))]), np.zeros((500, 2)),
                             np.ones(2))
    np.testing.assert_array_equal(found, [1, 0])


def test_few_presses_weigh_families_as_other_skins_did_and_many_by_their_errors() -> None:
    rng, size, prior = np.random.default_rng(0), np.array([1.0, 0.8]), np.array([0.8, 0.2])
    few, many = (stacking.weights(size[:, None, None] * rng.standard_normal((2, count, 2)), np.zeros((count, 2)), prior)
                 for count in (5, 5000))
    assert few[0] > 0.6
    assert many[0] == pytest.approx(0.64 / 1.64, abs=0.03)


def drawn(seed: int, count: int, correlation: float = 0.0) -> tuple[Array, Array, Array]:
    """Errors (count, 2), as a t variable with four degrees of freedom, their spreads, and the covariance."""
    rng = np.random.default_rng(seed)
    spread = rng.uniform(0.5, 4, (count, 2))
    root = np.linalg.cholesky(np.array([[1.0, correlation], [correlation, 1.0]]))
    error = spread * (rng.standard_normal((count, 2)) @ root.T) / np.sqrt(rng.chisquare(4, (count, 1)) / 4)
    return error, spread, correlation * spread.prod(axis=1)


def test_intervals_hold_and_follow_the_spread() -> None:
    intervals = calibrated(*drawn(0, 4000))
    error, spread, _ = drawn(1, 4000)
    half = intervals.half_width(spread)
    assert np.mean(np.abs(error) <= half) == pytest.approx(0.9, abs=0.02)
    assert half[spread > 3].mean() > 2 * half[spread < 1].mean()


@pytest.mark.parametrize("said", [True, False])
def test_ellipses_hold_and_are_smaller_where_errors_correlate(said: bool) -> None:
    areas = []
    for correlation in (0.0, 0.8):
        known, new = drawn(0, 4000, correlation), drawn(1, 4000, correlation)
        intervals = calibrated(known[0], known[1], said * known[2])
        bounds = intervals.bounds(new[1], said * new[2])
        assert np.mean(radius(new[0], bounds) <= bounds.ellipse) == pytest.approx(0.9, abs=0.02)
        areas.append(np.mean(bounds.ellipse**2 * np.sqrt(1 - bounds.correlation**2)))
    assert areas[1] < 0.85 * areas[0]


def test_few_presses_are_calibrated_more_steadily_than_by_their_order_statistic() -> None:
    error, spread, _ = drawn(1, 2000)
    held, plain = [], []
    for seed in range(100, 200):
        known = drawn(seed, 20)
        held.append(np.mean(np.abs(error) <= calibrated(*known).half_width(spread)))
        sd = np.sqrt(known[1] ** 2 + 9 * np.mean(known[0] ** 2))
        factor = np.sort(np.abs(known[0] / sd), axis=None)[36]
        plain.append(np.mean(np.abs(error) <= factor * np.sqrt(spread**2 + 9 * np.mean(known[0] ** 2))))
    assert np.mean(held) == pytest.approx(0.9, abs=0.02)
    assert np.std(held) < 0.95 * np.std(plain)


def test_a_dead_channel_is_filled_in_by_its_neighbours(presses: Pressed) -> None:
    signal, new = presses[0].signal, synthetic_presses(3, 20)[0].signal
    readings = learn_readings(signal)
    dead = new.copy()
    dead[:, [5, 77]] = np.nan
    found = filled(readings, dead)
    assert np.isfinite(found).all()
    np.testing.assert_array_equal(np.delete(found, [5, 77], axis=1), np.delete(new, [5, 77], axis=1))
    error = np.abs(found - new)[:, [5, 77]].mean()
    assert error < 0.5 * np.abs(new - readings.mean)[:, [5, 77]].mean()


def test_a_training_signal_with_fewer_digits_is_known_and_another_frame_of_its_press_is_not() -> None:
    rng = np.random.default_rng(5)
    signal, place = rng.normal(size=(20, 30)), rng.normal(size=(20, 2))
    noise = 0.02 * rng.normal(size=30)
    fitted = kernel_ridge.fit(signal, place)
    again, another = signal.round(3), signal + 0.02 * rng.normal(size=signal.shape)
    assert fitted.trained_on(again, again + noise).all()
    assert not fitted.trained_on(another, another + noise).any()
