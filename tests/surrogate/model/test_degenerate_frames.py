from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from surrogate.data.baseline_frame import compared, untouched
from surrogate.data.flags import WORDS, Flag
from surrogate.data.samples import SweepSamples
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map.forward_map import linearise
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.model.missing_channels import check_enough, named, silent, stuck, without
from surrogate.model.model import Model
from surrogate.model.predict import (
    SIZE,
    STRONG,
    Predictor,
    lost_words,
    numbers_of,
    predict,
    prepare,
    sign_caution,
)
from surrogate.model.train import train
from surrogate.model.trained import estimate

Array = NDArray[np.float64]
Synthetic = Callable[[int, int], tuple[Array, Array]]
NOISE_V = 1e-6


@pytest.fixture(scope="module")
def forward(forward_model: Model) -> Model:
    return forward_model


@pytest.fixture(scope="module")
def ridge(samples: SweepSamples) -> Model:
    return train(samples, "ridge", ("x0", "y0", "F"), 1)


@pytest.fixture(scope="module")
def predictors(forward: Model, ridge: Model, untouched_V: Array) -> dict[str, Predictor]:
    return {model.method: prepare(model, untouched_V, NOISE_V) for model in (forward, ridge)}


@pytest.mark.thorough
@pytest.mark.parametrize("method", ["forward", "ridge"])
def test_sound_frames_are_not_flagged(predictors: dict[str, Predictor], synthetic: Synthetic, untouched_V: Array,
                                      method: str) -> None:
    touch, signal = synthetic(12, 71)
    frames = untouched_V + signal + NOISE_V * np.random.default_rng(0).normal(size=signal.shape)
    found = predict(predictors[method], frames)
    assert found.flag == [""] * 12
    assert np.abs(found.value[:, :2] - touch[:, :2]).max() < 3


@pytest.mark.parametrize("method", ["forward", "ridge"])
def test_what_is_no_touch_of_the_training_is_flagged_and_widened(
        predictors: dict[str, Predictor], synthetic: Synthetic, untouched_V: Array, method: str) -> None:
    _, signal = synthetic(3, 72)
    sound = predict(predictors[method], untouched_V + signal)
    limit = np.quantile(untouched_V + signal, 0.8)
    cases = {"sign flipped": -signal, "channels shifted by one": np.roll(signal, 1, axis=1),
             "saturated": np.minimum(untouched_V + signal, limit) - untouched_V}
    for name, odd in cases.items():
        found = predict(predictors[method], untouched_V + odd)
        assert all(WORDS[Flag.MISFIT] in flag for flag in found.flag), name
        assert np.all(found.half_width > 2 * sound.half_width), name
    assert all(WORDS[Flag.OUTSIDE] in flag for flag in predict(predictors[method], untouched_V + 40 * signal).flag)
    strong = signal * (1.5 * STRONG * predictors[method].novelty.strongest_V / np.linalg.norm(signal, axis=1))[:, None]
    flags = predict(predictors[method], untouched_V + strong).flag
    assert all(WORDS[Flag.OUTSIDE] in flag and SIZE in flag for flag in flags)


def test_intervals_of_forces_end_at_0_and_those_of_places_do_not(ridge: Model, synthetic: Synthetic,
                                                                 untouched_V: Array) -> None:
    _, signal = synthetic(12, 73)
    predictor = prepare(ridge, untouched_V, 1e-3)
    found = predict(predictor, untouched_V + 0.5 * signal)
    low = numbers_of(ridge, found).reshape(12, -1, 3)[..., 1]
    assert np.any(low[:, 2] == 0)
    assert np.nanmin(low[:, 2]) >= min(0, np.nanmin(found.value[:, 2]))
    assert np.nanmin(low[:, :2]) < 0


@pytest.mark.parametrize("method", ["forward", "ridge"])
def test_a_frame_in_other_units_leaves_its_neighbours_alone(predictors: dict[str, Predictor], synthetic: Synthetic,
                                                            untouched_V: Array, method: str) -> None:
    frames = untouched_V + synthetic(3, 72)[1]
    odd = frames.copy()
    odd[1] *= 1e3
    alone, found = predict(predictors[method], frames), predict(predictors[method], odd)
    assert np.isnan(found.value[1]).all()
    assert found.flag[1] == f"{WORDS[Flag.OUTSIDE]}; {WORDS[Flag.MISFIT]}"
    assert found.value[[0, 2]] == pytest.approx(alone.value[[0, 2]], rel=1e-9)


def test_a_force_beyond_the_training_widens_to_the_range_of_the_training(forward: Model, samples: SweepSamples,
                                                                         untouched_V: Array) -> None:
    """Rows are told to be lighter than they are, so that the model is of a lighter range."""
    heaviest = samples.signal_V[np.argsort(samples.target[:, 3])[-3:]]
    force = forward.names.index("F")
    lighter = np.where(np.arange(len(forward.names)) == force, 0.5, np.inf)
    narrow = replace(forward, trained=replace(forward.trained, highest=lighter))
    found = predict(prepare(narrow, untouched_V, NOISE_V), untouched_V + heaviest)
    print(found.value, found.half_width, found.flag)
    assert all(flag.startswith(f"{WORDS[Flag.OUTSIDE]} of F") for flag in found.flag)
    assert not any(WORDS[Flag.SEVERAL] in flag for flag in found.flag)  # widened, not of several answers
    assert found.half_width[:, force] == pytest.approx(0.5 - narrow.trained.lowest[force])


@pytest.mark.parametrize(("method", "outside"), [("forward", False), ("ridge", True)])
def test_a_place_as_near_to_the_centre_as_trained_ones_is_outside_for_methods_without_symmetry(
        predictors: dict[str, Predictor], samples: SweepSamples, untouched_V: Array, method: str,
        outside: bool) -> None:
    """The range of x0 ends at less than the touch's, so that only touches in other directions were as far out."""
    model, rows = predictors[method].model, np.flatnonzero(np.abs(samples.target[:, 0] - 30) < 3)[:1]
    ends = model.trained.highest.copy()
    ends[model.names.index("x0")] = 20.0
    narrow = prepare(replace(model, trained=replace(model.trained, highest=ends)), untouched_V, NOISE_V)
    (flag,) = predict(narrow, untouched_V + samples.signal_V[rows]).flag
    assert flag == (f"{WORDS[Flag.OUTSIDE]} of x0" if outside else "")


@pytest.mark.thorough
def test_no_frames_give_no_rows(ridge: Model, forward: Model) -> None:
    for model in (ridge, forward):
        columns = model.predict(model.baseline_V[None], noise_V=1e-4).columns
        none = model.predict(np.zeros((0, len(model.baseline_V))), noise_V=1e-4)
        assert len(none) == 0
        assert list(none.columns) == list(columns)


def test_a_noise_that_is_no_number_is_refused(ridge: Model, untouched_V: Array) -> None:
    for noise_V in (np.inf, np.nan, -1e-6):
        with pytest.raises(ValueError, match="finite number of volts"):
            prepare(ridge, untouched_V, noise_V)


def test_a_frame_equal_to_the_baseline_has_no_touch(predictors: dict[str, Predictor], untouched_V: Array) -> None:
    for predictor in predictors.values():
        found = predict(predictor, untouched_V[None])
        assert found.flag == [WORDS[Flag.NO_TOUCH]]
        assert np.isnan(found.value).all()


@pytest.mark.slow
def test_a_dead_channel_is_left_out_of_an_inversion(predictors: dict[str, Predictor], synthetic: Synthetic,
                                                    untouched_V: Array) -> None:
    touch, signal = synthetic(10, 73)
    frames = untouched_V + signal
    whole = predict(predictors["forward"], frames)
    frames[:, [7, 30]] = 0.0, np.nan
    found = predict(predictors["forward"], frames)
    assert found.flag == whole.flag
    assert lost_words(predictors["forward"], frames).startswith("in 10 of 10 frames v_007, v_030 are dead and left out")
    assert np.abs(found.value[:, :2] - touch[:, :2]).max() < 0.5
    assert len(predictors["forward"].reduced) == 1
    assert np.mean(found.half_width / whole.half_width) > 0.99


@pytest.mark.parametrize("seed", range(3))
def test_dead_channels_are_filled_in_where_a_method_needs_all(ridge: Model, synthetic: Synthetic, untouched_V: Array,
                                                              seed: int) -> None:
    """Values stay near those with all channels, which lie in intervals that are no narrower."""
    predictor = prepare(ridge, untouched_V, NOISE_V)
    frames = untouched_V + synthetic(40, 80 + seed)[1]
    whole = predict(predictor, frames)
    dead = np.random.default_rng(seed).choice(208, 20, replace=False)
    frames[:, dead] = np.nan
    found = predict(predictor, frames)
    moved = np.abs(found.value - whole.value) / found.half_width
    print(np.mean(moved, axis=0), np.mean(moved < 1, axis=0), np.median(found.half_width / whole.half_width, axis=0))
    assert found.flag == whole.flag
    assert np.all(np.mean(moved < 1, axis=0) >= 0.9)
    assert np.all(np.mean(found.half_width / whole.half_width, axis=0) > 0.99)


@pytest.mark.slow
def test_a_dead_electrode_widens_the_intervals(predictors: dict[str, Predictor], synthetic: Synthetic,
                                               untouched_V: Array) -> None:
    """All readings that need one electrode are gone. The misfit of those left, which widens intervals where it exceeds
    1, is another draw of the noise, so that single touches may be told a little less."""
    model = predictors["forward"].model
    ring = model.ring
    dead = np.any([getattr(ring, name) == 3 for name in ("source", "sink", "read", "ground")], axis=0)
    touch, signal = synthetic(12, 74)
    frames = untouched_V + signal + NOISE_V * np.random.default_rng(1).normal(size=signal.shape)
    whole = predict(predictors["forward"], frames)
    found = predict(predictors["forward"], np.where(dead, 0.0, frames))
    within = np.array([flag == "" for flag in whole.flag])
    assert 40 < dead.sum() < 104
    assert within.sum() > 8
    assert np.all(np.abs(found.value[:, :2] - touch[:, :2])[within] < 2 * found.half_width[within, :2])
    wider = found.half_width[within, :2] / whole.half_width[within, :2]
    assert np.all(wider > 0.95)
    assert np.all(np.median(wider, axis=0) > 1.05)
    signal = (frames - untouched_V)[within]
    ratio = estimate(without(model, dead), signal[:, ~dead], NOISE_V).sd / estimate(model, signal, NOISE_V).sd
    assert np.all(ratio > 0.95)
    assert np.all(np.exp(np.mean(np.log(ratio), axis=0)) > 1.1)  # the median of so few is one touch's


def test_the_map_beside_a_dead_electrode_is_the_whole_map_without_its_readings(forward: Model,
                                                                               synthetic: Synthetic) -> None:
    ring = forward.ring
    dead = np.any([getattr(ring, name) == 3 for name in ("source", "sink", "read", "ground")], axis=0)
    touch = np.array([[r * np.cos(ring.angle_rad[3] + t), r * np.sin(ring.angle_rad[3] + t), 12.0, 1.0]
                      for r in (60.0, 75.0, 84.0) for t in (0.0, 0.1)])
    maps = [model.learner.forward for model in (forward, without(forward, dead))]
    whole, kept = (linearise(one, to_unknown(touch, one.p0)) for one in maps)
    assert np.allclose(kept.signal_V, whole.signal_V[:, ~dead], rtol=1e-9, atol=1e-12)
    assert np.allclose(kept.jacobian, whole.jacobian[:, ~dead], rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_a_channel_that_is_dead_in_the_baseline_is_dead_in_every_frame(forward: Model, synthetic: Synthetic,
                                                                       untouched_V: Array) -> None:
    baseline = np.where(np.arange(208) == 7, 0.0, untouched_V)
    predictor, frames = prepare(forward, baseline), untouched_V + synthetic(1, 75)[1]
    assert predict(predictor, frames).flag == [""]
    assert lost_words(predictor, frames).startswith("in 1 of 1 frames v_007 is dead and left out")


def test_more_than_half_of_the_channels_cannot_be_done_without(predictors: dict[str, Predictor], synthetic: Synthetic,
                                                               untouched_V: Array) -> None:
    frames = np.where(np.arange(208) < 110, 0.0, untouched_V + synthetic(1, 76)[1])
    found = predict(predictors["forward"], frames)
    assert np.isnan(found.value).all()
    assert "110 of 208 readings are dead" in found.flag[0]


def test_channels_that_are_dead_in_every_frame_are_refused_where_too_few_are_left(synthetic: Synthetic,
                                                                                 untouched_V: Array) -> None:
    volts = untouched_V + synthetic(4, 77)[1]
    volts[:, 9], volts[1] = volts[0, 9], np.nan
    assert np.flatnonzero(stuck(volts)).tolist() == [9]
    check_enough(stuck(volts), "a.csv")
    with pytest.raises(ValueError, match=r"a.csv: dead channels: .*so that no frame can be read: 105 of 208"):
        check_enough(np.arange(208) < 105, "a.csv")


def test_a_reading_that_is_zero_by_symmetry_is_not_dead() -> None:
    quiet = np.array([[1.0, 1e-16, 2.0]])
    assert not silent(quiet, np.array([1.0, -2e-17, 2.0])).any()
    assert silent(quiet, np.array([1.0, 0.1, 2.0])).tolist() == [[False, True, False]]
    assert not stuck(np.ones((3, 4))).any()
    assert named(np.arange(9) > 2) == "dead channels: columns 4, 5, 6, 7 and 2 more"


def test_an_untouched_frame_of_elsewhere_is_cautioned_with_the_likely_cause(untouched_V: Array, ring: Ring) -> None:
    rng = np.random.default_rng(0)
    assert compared(untouched_V, ring, 1.0001 * untouched_V).words == ""
    assert "differs by 100 % from that of the training" in compared(untouched_V, ring, 2 * untouched_V).words
    for other, cause in ((-untouched_V, "leads of the current or of the voltmeter"), (1e3 * untouched_V, "in volts"),
                         (rng.permutation(untouched_V), "another order"), (rng.normal(size=208), "is it untouched")):
        assert cause in compared(untouched_V, ring, other).words


def test_untouched_frames_without_a_channel_tell_their_noise_by_the_others(untouched_V: Array) -> None:
    frames = untouched_V + 1e-6 * np.random.default_rng(0).normal(size=(30, 208))
    frames[3, 7] = np.nan
    found = untouched(frames)
    assert np.flatnonzero(np.isnan(found.volts)).tolist() == [7]
    assert found.noise_V == pytest.approx(1e-6 * np.sqrt(1 + 1 / 30), rel=0.1)


@pytest.mark.parametrize("method", ["forward", "ridge"])
def test_frames_of_the_other_sign_are_told_with_the_likely_cause(
        predictors: dict[str, Predictor], synthetic: Synthetic, untouched_V: Array, method: str) -> None:
    """Untouched and touched frame exchanged, and the voltmeter's leads after the untouched frame; noise alone is
    neither."""
    signal, rng = synthetic(2, 78)[1], np.random.default_rng(0)
    for frames in (untouched_V - signal, -(untouched_V + signal)):
        found = predict(predictors[method], frames)
        assert np.all(found.kinds & Flag.OTHER_SIGN)
        assert all(WORDS[Flag.OTHER_SIGN] in flag for flag in found.flag)
        assert "2 of 2 frames" in sign_caution(found.kinds)
        assert "untouched and a touched frame exchanged" in sign_caution(found.kinds)
    mean = predictors[method].novelty.mean  # a touch elsewhere, nearly at a right angle to the trained ones
    across = signal[0] - 1.01 * (signal[0] @ mean) / (mean @ mean) * mean
    assert WORDS[Flag.OTHER_SIGN] not in predict(predictors[method], untouched_V + across[None]).flag[0]
    rest = predict(predictors[method], untouched_V + np.vstack([signal, 1e-3 * NOISE_V * rng.normal(size=(20, 208))]))
    assert sign_caution(rest.kinds) == ""
