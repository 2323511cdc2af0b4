"""Streams of synthetic touches: exact responses of spots, read by a map that was learned from others."""

import io
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from surrogate.data import outputs
from surrogate.data.flags import WORDS, Flag
from surrogate.data.frame_drift import by_gain
from surrogate.data.samples import SweepSamples, take
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion import reading_covariance
from surrogate.model.model import Model
from surrogate.model.tracking.followed_model import KEPT, FollowedModel
from surrogate.model.tracking.tracked import CALIBRATING, SEVERAL_TOUCHES, TOUCH, UNREADABLE, UNTOUCHED, Tracked
from surrogate.model.tracking.tracked_stream import track
from surrogate.model.tracking.tracker import WAIT, Tracker
from surrogate.model.train import train
from surrogate.statistics.conformal import COVERAGE
from touchcal.arrays import Array, Mask

Spots = Callable[..., Array]
NOISE_V, RATE_HZ = 1e-4, 50.0
REST = 30  # untouched frames before a press


def punch(d_mm: Array, force_N: Array) -> tuple[Array, Array]:
    """Radius, mm, and contrast of the spot that tests of models learn from."""
    press = force_N / (d_mm / 14) ** 1.5
    return d_mm / 2 * (1 + 0.06 * press / (1 + press)), 0.55 * press / (press + 1.2)


@pytest.fixture(scope="module")
def model(forward_model: Model) -> Model:
    return forward_model


@pytest.fixture(scope="module")
def press(spots: Spots, untouched_V: Array) -> Callable[[Array, int], Array]:
    """(touches (n, 4), seed) -> frames: REST untouched ones, the touches, REST untouched ones."""
    def frames(touch: Array, seed: int) -> Array:
        signal = spots(touch, *punch(touch[:, 2], touch[:, 3]))
        rest = np.zeros((REST, signal.shape[1]))
        clean = np.concatenate([rest, signal, rest])
        return untouched_V + clean + NOISE_V * np.random.default_rng(seed).normal(size=clean.shape)
    return frames


def tracked(tracker: Tracker, frames: Array) -> list[Tracked]:
    return [tracker.update(frame) for frame in frames]


def slide(frames: int = 40, force: float = 1.0) -> Array:
    """(frames, 4) a press that is pressed, slides 24 mm and is lifted."""
    level = force * np.minimum(1.0, np.minimum(np.arange(1, frames + 1), np.arange(frames, 0, -1)) / 5)
    return np.column_stack([np.linspace(-12, 12, frames), np.full(frames, 20.0), np.full(frames, 13.0), level])


@pytest.mark.slow
def test_the_first_frame_of_a_touch_is_read_as_alone(model: Model, press: Callable[..., Array],
                                                     untouched_V: Array) -> None:
    frames = press(slide()[5:10], 0)
    tracker = Tracker(model, untouched_V, NOISE_V)
    for frame in frames[:REST]:
        assert tracker.update(frame).state == UNTOUCHED
    now = tracker.update(frames[REST])
    noise_V = now.noise_V * np.sqrt(1 + 1 / (REST + 1 - WAIT))
    alone = model.predict(now.signal_V + untouched_V, untouched_V, noise_V=noise_V)
    assert now.state == TOUCH
    assert np.allclose(now.value, alone[["x0_m", "y0_m", "d_m", "F_N"]].to_numpy()[0], rtol=2e-4, atol=1e-6)


@pytest.mark.slow
def test_touches_elsewhere_without_a_pause_are_read_as_alone(model: Model, spots: Spots, untouched_V: Array) -> None:
    touch = np.array([[0.0, 30, 12, 1.0], [-30, -10, 16, 0.6], [25, -25, 11, 1.5], [5, 5, 14, 0.9]])
    frames = untouched_V + spots(touch, *punch(touch[:, 2], touch[:, 3]))
    found = np.array([now.value for now in tracked(Tracker(model, untouched_V, 1e-5), frames)])
    alone = model.predict(frames, untouched_V, noise_V=1e-5)
    assert np.allclose(found, alone[["x0_m", "y0_m", "d_m", "F_N"]], rtol=2e-2, atol=1e-4)


@pytest.mark.thorough
def test_a_sliding_press_is_found_followed_held_and_let_go(model: Model, press: Callable[..., Array],
                                                           untouched_V: Array) -> None:
    held = []
    for seed in range(4):
        touch = slide(force=0.6 + 0.3 * seed)
        said = tracked(Tracker(model, untouched_V, NOISE_V, rate_hz=RATE_HZ), press(touch, seed))
        states = [now.state for now in said]
        assert states[:REST] == [UNTOUCHED] * REST
        assert states[REST + 1] == TOUCH
        assert states[-REST + 2:] == [UNTOUCHED] * (REST - 2)
        for now, true in zip(said[REST:-REST], touch, strict=True):
            if np.isfinite(now.value[0]):
                off = 1e3 * now.value[:2] - true[:2]
                held.append(off @ np.linalg.solve(1e6 * now.covariance[:2, :2], off) <= -2 * np.log1p(-COVERAGE))
    assert len(held) > 140
    assert 0.8 < np.mean(held) < 0.99


@pytest.mark.slow
def test_what_is_wrong_with_the_map_does_not_average_out(model: Model, press: Callable[..., Array],
                                                         untouched_V: Array) -> None:
    """The place of a held press is no surer after 300 frames than the exact frame makes it; its diameter is surer than
    after one."""
    touch = np.tile([10.0, -15.0, 13.0, 0.8], (300, 1))
    said = tracked(Tracker(model, untouched_V, NOISE_V), press(touch, 5))[REST + 1:-REST]
    mean = press(touch, 5)[REST:-REST].mean(axis=0)
    exact = tracked(Tracker(model, untouched_V, 1e-7), np.tile(mean, (3, 1)))
    floor = np.sqrt(np.diag(exact[0].covariance)[:2])
    assert np.all(np.sqrt(np.diag(said[-1].covariance)[:2]) > 0.9 * floor)
    assert said[-1].below[2] + said[-1].above[2] < 0.7 * (said[0].below[2] + said[0].above[2])


@pytest.mark.slow
def test_noise_that_patterns_share_is_in_the_ellipses(model: Model, spots: Spots, untouched_V: Array) -> None:
    """Nine parts of ten of its energy are common to the readings of a current pattern; as if it were white, the place
    of a held press is in its interval in half of the presses."""
    rng, count, ring = np.random.default_rng(12), 24, model.ring
    pattern = np.unique(np.column_stack([ring.source, ring.sink]), axis=0, return_inverse=True)[1].ravel()

    def noise(frames: int) -> Array:
        own, common = rng.normal(size=(frames, len(pattern))), rng.normal(size=(frames, pattern.max() + 1))[:, pattern]
        return 5 * NOISE_V * (np.sqrt(0.1) * own + np.sqrt(0.9) * common)

    touch = np.column_stack([rng.uniform(-25, 25, (count, 2)), rng.uniform(11, 17, count),
                             rng.uniform(0.5, 1.5, count)])
    tracker, held = Tracker(model, untouched_V + noise(200)), []
    for true, signal in zip(touch, spots(touch, *punch(touch[:, 2], touch[:, 3])), strict=True):
        tracked(tracker, untouched_V + noise(6))
        now = tracked(tracker, untouched_V + signal + noise(6))[-1]
        assert now.state == TOUCH
        off = true[:2] / 1e3 - now.value[:2]
        held.append((-now.below[:2] <= off) & (off <= now.above[:2]))
    print("places held:", np.mean(held, axis=0))
    assert np.mean(held) > 0.8


@pytest.mark.thorough
def test_a_drift_is_followed_and_makes_no_contact(model: Model, press: Callable[..., Array],
                                                  untouched_V: Array) -> None:
    touch = slide(80)
    frames = np.concatenate([press(touch, k)[:REST] for k in range(12)] + [press(touch, 9)])
    way = np.random.default_rng(0).normal(size=len(untouched_V))
    frames += np.linspace(0, 5e-3, len(frames))[:, None] * way / np.linalg.norm(way)
    said = tracked(Tracker(model, untouched_V, NOISE_V), frames)
    rest = np.ones(len(frames), bool)
    rest[-REST - len(touch):-REST + 2] = False
    assert {now.state for now, still in zip(said, rest, strict=True) if still} == {UNTOUCHED}
    middle = said[-REST - 40]
    assert np.hypot(*(1e3 * middle.value[:2] - touch[40, :2])) < 1.0


def after_one_another(press: Callable[..., Array], count: int, pause: int = 12) -> tuple[Array, Mask]:
    """Frames of presses with short pauses between, and which of them are touched."""
    touch = slide(12, 0.6)
    one = press(touch, 0)[REST - pause:-REST]
    frames = np.concatenate([press(touch, 20)[:REST], press(touch, 21)[:pause],
                             *(press(touch, k)[REST - pause:-REST] for k in range(count)), press(touch, 22)[:pause]])
    still = np.zeros(pause, bool)
    return frames, np.r_[np.zeros(REST, bool), still, np.tile(np.arange(len(one)) >= pause, count), still]


def walked(root: Array, frames: int) -> Array:
    """(frames, readings) walk whose covariance grows by root' root, of a root (k, readings), in a second."""
    return np.cumsum(np.random.default_rng(4).normal(size=(frames, len(root))), axis=0) @ root / np.sqrt(RATE_HZ)


@pytest.mark.thorough
@pytest.mark.parametrize("cause", ["any", "gains"])
def test_a_drift_that_only_short_pauses_show_makes_no_contact(model: Model, press: Callable[..., Array], cause: str
                                                             ) -> None:
    """In a second it goes three times as far as noise along each of three directions, or gains walk by 0.02 %."""
    frames, touched = after_one_another(press, 4)
    rng, readings = np.random.default_rng(3), frames.shape[1]
    root = (3 * NOISE_V * np.sqrt(readings) * np.linalg.qr(rng.normal(size=(readings, 3)))[0].T if cause == "any" else
            2e-4 * by_gain(model.ring, model.baseline_V).T)
    said = tracked(Tracker(model, rate_hz=RATE_HZ, say=lambda words: None), frames + walked(root, len(frames)))
    states = np.array([now.state for now in said])
    begun = np.flatnonzero(touched[1:] & ~touched[:-1]) + 1
    lifted = np.flatnonzero(~touched[1:] & touched[:-1]) + 1
    assert len(begun) == 4
    assert set(states[begun + 1]) == {TOUCH}
    still = ~touched
    still[np.r_[:20, lifted, lifted + 1]] = False
    assert set(states[still]) == {UNTOUCHED}


@pytest.mark.thorough
def test_an_untouched_frame_that_jumps_is_taken_anew(model: Model, press: Callable[..., Array]) -> None:
    """No touch explains what is left, however much it is."""
    frames = press(slide(), 8)
    way = np.random.default_rng(1).normal(size=frames.shape[1])
    frames[10:] += 0.05 * way / np.linalg.norm(way)
    said = tracked(Tracker(model, frames[:8], NOISE_V, rate_hz=RATE_HZ), frames[8:])
    assert said[2].kinds == Flag.DRIFTED
    assert said[2].flag == WORDS[Flag.DRIFTED]
    assert {now.state for now in said[:REST - 8]} == {UNTOUCHED}
    assert {now.flag for now in said[5:REST - 8]} == {""}
    assert {now.state for now in said[REST - 4:-REST]} == {TOUCH}
    assert {now.state for now in said[-REST + 2:]} == {UNTOUCHED}


@pytest.mark.thorough
def test_a_frame_that_is_cut_changes_nothing(model: Model, press: Callable[..., Array]) -> None:
    """One reading of 1000 V, or all of them half as large again, in an untouched frame."""
    frames = press(slide(), 8)
    whole = tracked(Tracker(model, rate_hz=RATE_HZ), frames)
    for cut in (np.where(np.arange(frames.shape[1]) == 50, 1000.0, frames[24]), frames[24] * 1.5):
        said = tracked(Tracker(model, rate_hz=RATE_HZ), np.concatenate([frames[:24], cut[None], frames[25:]]))
        assert said[24].flag
        assert [now.state for now in said] == [now.state for now in whole]
        now, then = said[REST + 20], whole[REST + 20]
        assert np.all(np.abs(now.value - then.value) < 0.5 * then.below)
        assert said[-1].noise_V == pytest.approx(whole[-1].noise_V, rel=0.05)


def test_a_frame_of_no_single_touch_teaches_nothing_of_the_touch(model: Model, press: Callable[..., Array]) -> None:
    """In a press of a known punch all readings are once 2 % higher; the interval of d holds it afterwards."""
    touch = np.tile([-20.0, -17.0, 12.0, 0.8], (12, 1))
    frames = press(touch, 1)
    frames[REST + 6] *= 1.02
    said = tracked(Tracker(model, rate_hz=RATE_HZ), frames)[REST:-REST]
    assert said[6].flag
    for now in said[7:]:
        off = now.value * [1e3, 1e3, 1e3, 1] - touch[0]
        assert now.state == TOUCH
        assert np.hypot(*off[:2]) < 0.5
        assert -2 * 1e3 * now.below[2] < off[2] < 2 * 1e3 * now.above[2]


@pytest.mark.thorough
def test_a_jump_of_all_readings_is_said_and_scaled(model: Model, press: Callable[..., Array]) -> None:
    """The current rises by a quarter while nothing touches."""
    words: list[str] = []
    touch = slide()
    frames = press(touch, 3)
    frames[22:] *= 1.25
    said = tracked(Tracker(model, rate_hz=RATE_HZ, say=words.append), frames)
    assert [one.split("):")[1].split(":")[0] for one in words] == [" all readings are 1.25 times those"]
    assert said[22].flag == WORDS[Flag.OTHER_SIGN]
    now, then = said[REST + 20], tracked(Tracker(model, say=lambda one: None), press(touch, 3))[REST + 20]
    assert now.state == TOUCH
    assert now.signal_V == pytest.approx(then.signal_V, abs=2 * NOISE_V)
    assert np.hypot(*(now.value - then.value)[:2]) < 0.5e-3


def test_a_reading_that_no_instrument_has_is_a_dead_channel(model: Model, press: Callable[..., Array],
                                                            untouched_V: Array) -> None:
    frames = press(slide(), 3)
    frames[REST + 5:, 40] = 1e300
    words: list[str] = []
    said = tracked(Tracker(model, untouched_V, NOISE_V, say=words.append), frames)[REST + 10]
    assert (said.state, said.flag) == (TOUCH, "")
    assert [one.split(",")[0] for one in words] == ["v_040 is dead and left out"]


@pytest.mark.thorough
def test_channels_that_flicker_take_no_more_memory(model: Model, press: Callable[..., Array], untouched_V: Array
                                                   ) -> None:
    """Each frame of a touch lacks another pair of readings, strange ones too."""
    frames = press(slide(), 3)
    tracker = Tracker(model, untouched_V, NOISE_V)
    for k, frame in enumerate(frames[REST - 2:REST + KEPT + 4]):
        frame[[k, k + 50]] = np.nan
        frame[150:153] *= 1.05 if k % 5 == 0 else 1
        assert tracker.update(frame).state != UNREADABLE
    assert isinstance(tracker._following, FollowedModel)
    assert len(tracker._following._fewer) == KEPT


def test_a_press_in_the_untouched_frame_is_no_contact_when_it_is_lifted(model: Model, press: Callable[..., Array]
                                                                        ) -> None:
    frames = press(slide(), 9)
    said = tracked(Tracker(model, frames[REST + 20:REST + 22].mean(axis=0), NOISE_V, rate_hz=RATE_HZ,
                        say=lambda words: None), frames[-REST:])
    assert said[0].flag == WORDS[Flag.OTHER_SIGN]
    assert {now.state for now in said} == {UNTOUCHED}


def test_calibration_tells_the_noise_and_how_long_it_takes(model: Model, press: Callable[..., Array]) -> None:
    tracker = Tracker(model)
    said = tracked(tracker, press(slide(), 3))
    count = tracker.calibration
    assert [now.state for now in said[:count - 1]] == [CALIBRATING] * (count - 1)
    assert [now.left for now in said[:count]] == list(range(count - 1, -1, -1))
    assert said[count].state == UNTOUCHED
    assert said[-1].noise_V == pytest.approx(NOISE_V, rel=0.1)
    assert said[REST + 10].state == TOUCH


@pytest.mark.parametrize(("touched", "calibrated"), [
    (np.tile([0.0, 20, 13, 0.8], (6, 1)), 40), pytest.param(slide(14, 0.8), 40, marks=pytest.mark.thorough),
    pytest.param(slide(14, 0.0), 20, marks=pytest.mark.thorough)])
def test_a_touch_while_the_untouched_frame_is_learnt_is_no_noise(
        model: Model, press: Callable[..., Array], touched: Array, calibrated: int) -> None:
    words: list[str] = []
    tracker = Tracker(model, say=words.append)
    states = [now.state for now in tracked(tracker, np.concatenate([press(touched, 8)[REST - 4:], press(slide(), 9)]))]
    assert states[:calibrated - 1] == [CALIBRATING] * (calibrated - 1)
    assert tracker.noise_V == pytest.approx(NOISE_V, rel=0.2)
    assert TOUCH in states
    assert sum("touch nothing" in one for one in words) == (calibrated > 20)



@pytest.mark.thorough
def test_a_channel_that_dies_in_a_touch_costs_nothing(model: Model, press: Callable[..., Array],
                                                      untouched_V: Array) -> None:
    frames = press(slide(), 4)
    lost = frames.copy()
    lost[REST + 12:, [40, 41]] = np.nan
    words: list[str] = []
    whole, fewer = (tracked(Tracker(model, untouched_V, NOISE_V, say=words.append), one) for one in (frames, lost))
    assert [one.split(" dead")[0] for one in words] == ["v_040, v_041 are"]
    for k in range(REST + 12, REST + 34):
        assert fewer[k].state == TOUCH
        assert fewer[k].flag == whole[k].flag
        assert np.hypot(*(fewer[k].value - whole[k].value)[:2]) < np.hypot(*whole[k].below[:2])
    # what is left of the information is a little less
    assert np.trace(fewer[REST + 30].covariance[:2, :2]) > np.trace(whole[REST + 30].covariance[:2, :2])
    lost[REST + 14] = np.nan
    assert tracked(Tracker(model, untouched_V, NOISE_V, say=words.append), lost)[REST + 14].state == UNREADABLE


@pytest.mark.thorough
def test_two_touches_are_said_to_be_more_than_one(model: Model, press: Callable[..., Array],
                                                  untouched_V: Array) -> None:
    one = np.tile([-25.0, 5.0, 13.0, 1.0], (12, 1))
    other = one * [-1, 1, 1, 0.8]
    both = press(one, 0) + press(other, 1) - untouched_V
    said = tracked(Tracker(model, untouched_V, 1.5 * NOISE_V), both)[REST + 2:-REST]
    assert {now.state for now in said} == {SEVERAL_TOUCHES}
    alone = tracked(Tracker(model, untouched_V, NOISE_V), press(one, 0))[REST + 2:-REST]
    assert {now.state for now in alone} == {TOUCH}


def test_a_punch_whose_error_is_said_to_be_small_is_not_the_likely_one_for_that(
        model: Model, press: Callable[..., Array], untouched_V: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    """As near a rim, where the map is surer of small punches, which end farther from it."""
    own_error = reading_covariance.own_error

    def surer_of_small_ones(forward: ForwardMap, unknown: Array, size: Array) -> tuple[Array, Array, Array]:
        floor, axes, sd = own_error(forward, unknown, size)
        return np.where(np.exp(unknown[:, 2]) < 13, floor, np.hypot(floor, 3 * NOISE_V)), axes, sd

    monkeypatch.setattr(reading_covariance, "own_error", surer_of_small_ones)
    held = np.tile([10.0, -15.0, 16.0, 1.2], (12, 1))
    now = tracked(Tracker(model, untouched_V, NOISE_V), press(held, 1))[-REST - 1]
    assert now.value[2] == pytest.approx(0.016, abs=1e-3)
    assert now.value[2] - now.below[2] < 0.016 < now.value[2] + now.above[2]


@pytest.mark.thorough
def test_a_diameter_that_never_varied_has_no_error(samples: SweepSamples, synthetic: Callable[..., tuple[Array, Array]],
                                                   untouched_V: Array) -> None:
    touch, signal = synthetic(100, 11, [14.0], 45.0)
    target = np.column_stack([touch, samples.target[:100, outputs.TOUCH:]])
    one_punch = replace(take(samples, np.arange(100)), signal_V=signal, target=target)
    tracker = Tracker(train(one_punch, "forward", outputs.NAMES[:outputs.TOUCH], 1), untouched_V, NOISE_V)
    now = tracked(tracker, untouched_V + np.repeat(signal[:1], 3, axis=0))[-1]
    assert now.state == TOUCH
    assert now.value[2] == pytest.approx(0.014)
    assert now.below[2] == now.above[2] == 0.0
    assert np.isfinite([now.below, now.above]).all()
    assert np.isfinite(now.covariance).all()


def test_another_method_reads_every_frame_alone(samples: SweepSamples, press: Callable[..., Array], untouched_V: Array
                                                ) -> None:
    ridge, frames = train(samples, "ridge", ("x0", "F"), 1), press(slide(), 6)
    now = tracked(Tracker(ridge, untouched_V, NOISE_V), frames)[REST + 15]
    assert now.value[0] == pytest.approx(ridge.predict(now.signal_V + untouched_V)["x0_m"][0], rel=1e-6)
    assert np.isnan(now.value[[1, 2]]).all()


def test_one_line_in_is_one_row_out(model: Model, press: Callable[..., Array], untouched_V: Array) -> None:
    lines = [",".join(map(repr, frame)) for frame in press(slide(8), 7).tolist()]
    lines.insert(REST + 4, "1,2,3")
    said: list[str] = []
    sink = io.StringIO()
    counts = track(Tracker(model, rate_hz=100.0), io.BytesIO("\n".join(lines).encode()), sink, said.append)
    head, *rows = [row.split(",") for row in sink.getvalue().splitlines()]
    assert head == ["line", *Tracker(model).columns, "state", "flag"]
    assert counts.answered == len(rows) == len(lines)
    state, flag = head.index("state"), head.index("flag")
    assert rows[0][state] == CALIBRATING
    assert rows[REST + 4][state] == UNREADABLE
    assert rows[REST + 4][flag].startswith('"unreadable: 3 columns')
    assert rows[REST + 5][state] == TOUCH
    assert float(rows[REST + 5][head.index("y0_mm")]) == pytest.approx(20.0, abs=1.0)
    assert said[0].startswith("the first 20 frames tell the untouched frame and the noise, 0.2 s at 100 frames a")
    assert float(said[1].removeprefix("calibrated: the noise of a reading is ").removesuffix(" V.")) == pytest.approx(
        NOISE_V, rel=0.1)


def test_a_line_that_is_no_frame_does_not_end_the_calibration(model: Model, press: Callable[..., Array]) -> None:
    lines = [",".join(map(repr, frame)) for frame in press(slide(8), 7).tolist()]
    lines.insert(5, "1,2,3")
    said: list[str] = []
    track(Tracker(model), io.BytesIO("\n".join(lines).encode()), io.StringIO(), said.append)
    assert [words.split(" ")[0] for words in said] == ["the", "line", "calibrated:"]
    assert said[1].startswith("line 6: unreadable: 3 columns, expected 208 voltages")


def test_bad_frames_and_noise_are_refused(model: Model) -> None:
    with pytest.raises(ValueError, match="a frame of 7 readings; the trained sensor has 208"):
        Tracker(model).update(np.zeros(7))
    with pytest.raises(ValueError, match="finite number of volts from 0, got -1"):
        Tracker(model, noise_V=-1.0)
    with pytest.raises(ValueError, match="untouched frames of 7 readings; the trained sensor has 208"):
        Tracker(model, np.ones((2, 7)))
    with pytest.raises(ValueError, match="untouched frames of 0 readings"):
        Tracker(model, [])
    assert Tracker(model, np.ones((16, 13)), 1e-4, say=lambda words: None).noise_V == 1e-4
