"""One frame in depth: direct inversion, the posterior of one touch, and the options of `surrogate frame`."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from surrogate.bounds.fisher_information import Slopes
from surrogate.cli.frame_command import frame
from surrogate.data import outputs
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map.forward_map import ForwardMap, fit, linearise
from surrogate.forward_map.inversion.invert import invert
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.learners.forward import TouchInversion
from surrogate.model.predict import Predictions
from surrogate.single_frame import diameter_profile, likelihood_emulator
from surrogate.single_frame import posterior as posterior_module
from surrogate.single_frame import simulated_posterior as simulated_posterior_module
from surrogate.single_frame import simulator_inversion as direct_module
from surrogate.single_frame.posterior import posterior_of, prior_of, weighed_draws
from surrogate.single_frame.rows import One, direct_row
from surrogate.single_frame.simulated_posterior import Correction, simulated_posterior
from surrogate.single_frame.simulator_inversion import direct, relative_curvature
from surrogate.single_frame.simulator_likelihood import Simulator, Solved, Unknowns, unknowns_of
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array
from touchcal.errors import NotConverged

Draw = Callable[..., tuple[Array, Array]]


@pytest.fixture(scope="module")
def forward(ring: Ring, synthetic: Draw) -> ForwardMap:
    return fit(ring, *synthetic(120, 1))


def test_a_whitening_is_a_root_of_the_inverse_covariance() -> None:
    columns = np.random.default_rng(0).normal(size=(9, 3))
    whiten = Unknowns(0.3, columns).whitening
    assert whiten @ (0.09 * np.eye(9) + columns @ columns.T) @ whiten.T == pytest.approx(np.eye(9), abs=1e-10)


def test_the_simulator_s_own_error_counts_beside_noise_and_material() -> None:
    signal, material = np.arange(1.0, 5.0), np.ones((4, 1))
    found = unknowns_of(Solved(signal, signal, 0.01, 0.1), Slopes(np.ones((4, 4)), material), 0.02)
    assert found.white_V**2 == pytest.approx(0.02**2 + 1e-4 * np.mean(signal**2))
    assert found.columns == pytest.approx(np.column_stack([material, 0.01 * signal]))


def stand_in(monkeypatch: pytest.MonkeyPatch, forward: ForwardMap) -> tuple[list[Array], Callable[[Array], Array]]:
    """A simulator whose readings are the learned map's, made 3 % stronger and turned a little; the touches that it
    solves, and its readings."""
    calls: list[Array] = []

    def signal(touch: Array) -> Array:
        x, y, d, force = touch
        turned = np.array([[x + 0.01 * y, y - 0.01 * x, d, 1.03 * force]])
        return linearise(forward, to_unknown(turned, forward.p0)).signal_V[0]

    def solved(_: Simulator, touch: Array) -> Solved:
        calls.append(touch)
        return Solved(signal(touch), np.ones(208), 1e-6, 1e-6)

    def slopes_at(_: Simulator, touch: Array) -> Slopes:
        steps = 1e-4 * np.eye(4)
        return Slopes(np.stack([(signal(touch + s) - signal(touch - s)) / 2e-4 for s in steps], axis=1),
                      np.empty((208, 0)))

    monkeypatch.setattr(direct_module, "solved", solved)
    monkeypatch.setattr(direct_module, "slopes_at", slopes_at)
    monkeypatch.setattr(simulated_posterior_module, "solved", solved)
    return calls, signal


def test_direct_inversion_recovers_a_touch_of_its_own_simulator(monkeypatch: pytest.MonkeyPatch, forward: ForwardMap
                                                                ) -> None:
    """Derivatives are those at the start."""
    calls, signal = stand_in(monkeypatch, forward)
    truth = np.array([20.0, -11.0, 14.0, 0.9])
    simulator = Simulator.__new__(Simulator)
    found = direct(simulator, forward, signal(truth), 1e-5, truth + np.array([0.5, 0.4, 0.3, -0.05]))
    assert found.converged
    assert found.simulations == len(calls)
    assert np.all(np.abs(found.touch - truth) < 0.3 * np.sqrt(np.diag(found.covariance)))
    known = direct(simulator, forward, signal(truth), 1e-5, truth + np.array([0.5, 0.4, 0.0, -0.05]), known_d=True)
    assert known.covariance[2, 2] < found.covariance[2, 2]
    assert known.touch == pytest.approx(truth, abs=3e-3)


def row_of(forward: ForwardMap, signal_V: Array, noise_V: float) -> dict[str, Any]:
    """The row of a frame by direct inversion after the map's own answer, and whether that is broad."""
    found = invert(forward, signal_V[None], noise_V)
    half = np.sqrt(np.einsum("npp->np", found.covariance)) * normal(COVERAGE)
    learned = Predictions(found.touch, half, half, [""], np.empty((1, 0)), np.zeros(1, np.int64))
    model = SimpleNamespace(learner=TouchInversion(forward, None, np.arange(4)), names=outputs.NAMES,  # type: ignore
                            method="forward")
    row = direct_row(model, Simulator.__new__(Simulator), One(1, signal_V, learned), noise_V)  # type: ignore
    return row | {"broad": bool(found.broad[0])}


@pytest.mark.thorough
def test_a_map_of_one_diameter_knows_the_punch_and_takes_the_simulator_s_answer(
        monkeypatch: pytest.MonkeyPatch, ring: Ring, synthetic: Draw) -> None:
    """Over the posterior of punches its d and F are no broader than about the peak."""
    forward = fit(ring, *synthetic(120, 5, [14.0]))
    _, signal = stand_in(monkeypatch, forward)
    rng, noise, held = np.random.default_rng(6), 2e-6, []
    for touch in synthetic(20, 7, [14.0], 40.0)[0] * [1, 1, 1, 0.9]:
        row = row_of(forward, signal(touch) + noise * rng.normal(size=208), noise)
        assert row["broad"]
        assert (row["by"], row["flag"]) == ("simulator", "")
        assert row["d_mm"] == pytest.approx(14.0, abs=1e-3)
        assert row["d_hi90_mm"] - row["d_lo90_mm"] < 1e-3
        held.append([row[f"{name}_lo90_{unit}"] < value < row[f"{name}_hi90_{unit}"] for name, unit, value in (
            ("x0", "mm", touch[0]), ("y0", "mm", touch[1]), ("F", "N", touch[3]))])
    print("90 % intervals of x, y, F that hold:", np.mean(held, axis=0))
    assert np.mean(held) > 0.8


@pytest.mark.thorough
def test_a_known_punch_whose_signal_several_forces_make_keeps_the_learned_answer(
        monkeypatch: pytest.MonkeyPatch, ring: Ring, synthetic: Draw, spots: Callable[..., Array]) -> None:
    touch = synthetic(160, 8, [14.0])[0]
    forward = fit(ring, touch, spots(touch, np.full(160, 7.2), 0.5 * np.sin(np.pi * touch[:, 3] / 2.1)))
    _, signal = stand_in(monkeypatch, forward)
    row = row_of(forward, signal(np.array([10.0, -20.0, 14.0, 0.5])), 1e-6)
    assert (row["by"], row["flag"]) == ("learned", "several forces fit this frame")
    assert row["F_hi90_N"] - row["F_lo90_N"] > 1.0


def test_punches_of_any_diameter_that_make_one_signal_are_left_to_the_posterior(monkeypatch: pytest.MonkeyPatch,
                                                                                forward: ForwardMap) -> None:
    _, signal = stand_in(monkeypatch, forward)
    noise = 1e-4
    row = row_of(forward, signal(np.array([20.0, -11.0, 14.0, 0.9])) + noise * np.random.default_rng(9).normal(
        size=208), noise)
    assert row["broad"]
    assert row["by"] == "learned"
    assert "d and F are broad: ask for --posterior" in row["flag"]


def test_a_simulator_without_readings_at_the_start_says_so(monkeypatch: pytest.MonkeyPatch, forward: ForwardMap
                                                           ) -> None:
    def solved(_: Simulator, touch: Array) -> Solved:
        raise NotConverged("no readings", estimate=touch)

    monkeypatch.setattr(direct_module, "solved", solved)
    with pytest.raises(NotConverged, match="no readings"):
        direct(Simulator.__new__(Simulator), forward, np.ones(208), 1e-4, np.array([0.0, 0.0, 14.0, 1.0]))


def test_an_emulator_of_a_polynomial_is_exact_and_knows_no_more_than_its_points() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, size=(likelihood_emulator.requested(4), 4))

    def residual(u: Array) -> Array:
        return np.column_stack([u[:, 0] * u[:, 1] - 1, u[:, 2] ** 4, u[:, 3] + u[:, 0] ** 3, 1 + 0 * u[:, 0]])

    made, other = likelihood_emulator.fit(points, residual(points)), rng.uniform(-0.9, 0.9, size=(20, 4))
    assert likelihood_emulator.chi_squared(made, other) == pytest.approx(np.sum(residual(other) ** 2, axis=1), abs=1e-9)
    assert np.isinf(likelihood_emulator.chi_squared(made, np.full((1, 4), 2.0))).all()


def test_a_straightened_ridge_is_the_best_place_and_load_of_each_diameter() -> None:
    def whitened(u: Array) -> tuple[Array, Array]:
        left = np.column_stack([u[:, 0] - np.sin(u[:, 2]), u[:, 1], 5 * (u[:, 3] - u[:, 2] ** 2), 0.1 * u[:, 2]])
        slope = np.zeros((len(u), 4, 4))
        slope[:, 0, 0], slope[:, 1, 1], slope[:, 2, 3], slope[:, 3, 2] = 1, 1, 5, 0.1
        slope[:, 0, 2], slope[:, 2, 2] = -np.cos(u[:, 2]), -10 * u[:, 2]
        return left, slope

    ridge = diameter_profile.find(whitened, np.zeros(4), (-1.0, 1.0), lambda d: (0 * d - 2, 0 * d + 2), lambda u: u)
    nodes = np.linspace(-1, 1, diameter_profile.DIAMETERS)
    best = np.column_stack([np.sin(nodes), 0 * nodes, nodes, nodes**2])
    straight = diameter_profile.straightened(ridge, best)
    assert straight == pytest.approx(np.outer(nodes, [0, 0, 1, 0]), abs=1e-6)
    assert diameter_profile.bent(ridge, straight) == pytest.approx(best)
    assert ridge.spread[0] == pytest.approx(np.diag([1, 1, 0.04]), rel=1e-6)


def test_a_ridge_stays_between_its_diameters_wherever_it_starts() -> None:
    def whitened(u: Array) -> tuple[Array, Array]:
        return u.copy(), np.broadcast_to(np.eye(4), (len(u), 4, 4))

    ridge = diameter_profile.find(
        whitened, np.array([0.0, 0.0, 9.0, 0.0]), (-1.0, 1.0), lambda d: (0 * d - 2, 0 * d + 2), lambda u: u
    )
    assert (ridge.log_d[0], ridge.log_d[-1]) == (-1.0, 1.0)


def test_chains_start_where_the_prior_is_not_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though the likelihood is best outside."""
    started: list[Array] = []

    def run_ensembles(density: object, centre: Array, *rest: object) -> object:
        started.append(centre)
        raise NotConverged("started")

    monkeypatch.setattr(posterior_module, "run_ensembles", run_ensembles)
    points = np.random.default_rng(0).normal(size=(60, 2))
    with pytest.raises(NotConverged):
        weighed_draws(lambda u: 9 * (u - [2.0, 0.0]), lambda u: np.where(u[:, 0] < 0, 0.0, -np.inf),
                      lambda u: {"x": u[:, 0]}, points, seed=0)
    assert started[0][0] < 0


def test_a_posterior_of_one_diameter_is_refused(forward: ForwardMap) -> None:
    one = replace(forward, bounds=np.array([[0.0, 14.0, 0.1], [65.0, 14.0, 2.0]]))
    with pytest.raises(ValueError, match="one d alone, 14"):
        prior_of(one)


def test_readings_leave_their_tangent_by_the_square_of_the_interval(forward: ForwardMap) -> None:
    touch, covariance = np.array([20.0, -11.0, 14.0, 0.9]), np.diag([0.1, 0.1, 0.05, 0.01]) ** 2
    covariance[2, 3] = covariance[3, 2] = 0.9 * 0.05 * 0.01
    once, twice = (relative_curvature(forward, touch, scale**2 * covariance, np.eye(208) / 1e-5)
                   for scale in (1.0, 2.0))
    assert twice / once == pytest.approx(4.0, rel=0.05)


@pytest.mark.thorough
def test_draws_under_a_linear_map_and_a_gaussian_prior_are_those_of_the_closed_form() -> None:
    rng = np.random.default_rng(1)
    slope, signal = rng.normal(size=(9, 2)), rng.normal(size=9)
    prior_mean, prior_sd = np.array([0.5, -1.0]), np.array([0.6, 0.3])
    covariance = np.linalg.inv(slope.T @ slope + np.diag(prior_sd**-2))
    mean = covariance @ (slope.T @ signal + prior_mean / prior_sd**2)
    found = weighed_draws(lambda u: u @ slope.T - signal,
                          lambda u: -0.5 * np.sum(((u - prior_mean) / prior_sd) ** 2, axis=1),
                          lambda u: {"sum": u.sum(axis=1)}, mean + 1.5 * rng.normal(size=(200, 2)), seed=0)
    sd = np.sqrt(np.diag(covariance))
    assert found.checks["converged"]
    assert found.effective == pytest.approx(2000)
    assert np.all(np.abs(found.points.mean(axis=0) - mean) < 4 * sd / np.sqrt(len(found.points)))
    assert np.cov((found.points / sd).T) == pytest.approx(covariance / np.outer(sd, sd), abs=0.15)


def test_a_correction_is_what_it_was_made_from_and_its_derivatives_are_its_own() -> None:
    rng = np.random.default_rng(3)
    centre, log_d = np.array([10.0, 5.0, 2.6, 1.0]), np.array([2.4, 2.6, 2.9])
    more = rng.normal(size=(3, 6))
    more[1] = 0.0
    made = Correction(centre, rng.normal(size=6), rng.normal(size=(6, 4)), log_d, more)
    at = centre + np.outer(log_d - 2.6, [0, 0, 1, 0])
    assert made.at(at)[0] == pytest.approx(made.offset + (at - centre) @ made.slope.T + more)
    for log_d_off in (0.11, 0.5, -0.4):
        touch = (centre + np.array([0.3, -0.2, log_d_off, 0.4]))[None]
        by = [(made.at(touch + h)[0] - made.at(touch - h)[0]) / 2e-6 for h in 1e-6 * np.eye(4)[:, None]]
        assert np.stack(by, axis=2) == pytest.approx(made.at(touch)[1], rel=1e-6)


@pytest.mark.slow
def test_a_posterior_by_the_simulator_is_about_its_own_touch_and_not_the_map_s(
        monkeypatch: pytest.MonkeyPatch, forward: ForwardMap) -> None:
    """A stand-in turns the map by 0.2 mm, many standard deviations of the place."""
    calls, signal = stand_in(monkeypatch, forward)
    truth, noise = np.array([20.0, -11.0, 14.0, 0.9]), 2e-5
    frame = signal(truth) + noise * np.random.default_rng(1).normal(size=208)
    told = simulated_posterior(Simulator.__new__(Simulator), forward, frame, noise)
    low, high = np.quantile(told.posterior.draws, (0.005, 0.995), axis=0)
    own = posterior_of(forward, frame, noise).draws[:, :2]
    print("off by sd:", (told.posterior.draws.mean(axis=0) - truth) / told.posterior.draws.std(axis=0),
          "held-out error:", told.held_out_error, "effective draws:", told.posterior.effective)
    assert np.all((truth > low) & (truth < high))
    assert told.held_out_error < 1
    assert told.simulations == len(calls)
    assert np.abs(own.mean(axis=0) - truth[:2]).max() > 5 * own.std(axis=0).max()


@pytest.mark.slow
def test_posteriors_hold_the_touches_of_noisy_frames_as_often_as_they_say(forward: ForwardMap, synthetic: Draw) -> None:
    touch, signal = synthetic(5, 5, reach_mm=50.0)
    noise, inside = 2e-4, []
    for k, (truth, clean) in enumerate(zip(touch, signal, strict=True)):
        frame = clean + noise * np.random.default_rng(k).normal(size=clean.size)
        found = posterior_of(replace(forward, known_mm=np.zeros(0)), frame, noise, seed=k)
        low, high = np.quantile(found.draws, (0.05, 0.95), axis=0)
        inside.append((truth > low) & (truth < high))
        assert found.checks["converged"]
    held = np.mean(inside)
    print(f"90 % intervals hold {held:.0%} of {np.size(inside)}")
    assert held >= 0.75


@pytest.mark.parametrize(("options", "words"), [
    ({"direct": True, "posterior": True}, "give one of"),
    ({"direct": True, "touches": 2}, "give one of"),
    ({"direct": True}, "--card"),
    ({"data": Path("sweep")}, "needs --card"),
    ({"touches": 2, "card": Path("card.json")}, "--direct or --posterior. Leave it out"),
    ({"posterior": True, "frames": "-"}, "answered as they come")])
def test_options_that_do_not_go_together_are_refused_with_the_mend(options: dict[str, object], words: str) -> None:
    given = {"model_folder": Path("model"), "frames": "frames.csv"} | options
    with pytest.raises(ValueError, match=words):
        frame(**given)  # pyright: ignore[reportArgumentType]
