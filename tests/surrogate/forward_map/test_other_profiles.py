"""Forces of other profiles at the same signals, learned and in the intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtri

import surrogate
from surrogate.data.samples import OtherProfile, SweepSamples, take
from surrogate.forward_map.inversion import other_profiles
from surrogate.forward_map.inversion.other_profiles import ForceRatio
from surrogate.learners.base import regression
from surrogate.learners.forward import TouchInversion
from surrogate.model.assumed_punch import assumed_punch
from surrogate.model.sweep_model import SweepModel
from surrogate.model.train import train
from surrogate.model.trained import Calibration, TrainedModel, interval_scale
from touchcal.arrays import Array

HEAVIER = 1.2


def stronger(touch: Array) -> Array:
    """Force over that of the trained punch of the same signal, of a made-up profile: more for heavy touches."""
    return 1 + (HEAVIER - 1) * touch[:, 3] / 2


@pytest.fixture(scope="module")
def inner(samples: SweepSamples) -> SweepSamples:
    """Rows in the interior, and touches of a profile that makes the signals of the first ones under other forces."""
    near = take(samples, np.hypot(*samples.target[:, :2].T) < 45)
    touch = near.target[:, :4].copy()
    touch[:, 3] *= stronger(touch)
    return replace(near, others=(OtherProfile("odd", touch[:24], near.signal_V[:24]),))


def model_of(rows: SweepSamples, known_punches: bool = False) -> SweepModel:
    return train(rows, "forward", outputs="x0,y0,d,F", seed=1, exact_signals=True, known_punches=known_punches)


def ratios_of(model: TrainedModel) -> tuple[ForceRatio, ...]:
    assert isinstance(model.learner, TouchInversion)
    return model.learner.profiles


def test_intervals_of_the_force_hold_that_of_the_other_profile(inner: SweepSamples) -> None:
    model = model_of(inner)
    touch = inner.target[24:, :4]
    ratio, sd = other_profiles.at(ratios_of(model), touch)
    off = np.abs(ratio[:, 1] / stronger(touch) - 1)
    print("ratio off by", np.quantile(off, [0.5, 0.9, 1.0]))
    assert np.all(ratio[:, 0] == 1)
    assert np.all(sd[:, 0] == 0)
    assert np.mean(off <= 2 * sd[:, 1]) > 0.8
    assert np.median(off) < 0.01
    assert np.quantile(off, 0.9) < 0.03
    base = inner.baseline_V[0]
    found = model.predict(base + inner.signal_V[24:], base, noise_V=1e-6)
    said = found["F_hi90_N"].to_numpy() >= 0.98 * touch[:, 3] * stronger(touch)
    unflagged = (found["flag"] == "").to_numpy()
    assert unflagged.mean() > 0.8
    assert said[unflagged].mean() > 0.9
    assert "odd" in assumed_punch(model)


def test_known_punches_leave_no_other_profile(inner: SweepSamples) -> None:
    assert ratios_of(model_of(inner, known_punches=True)) == ()


def test_a_stored_model_holds_them(inner: SweepSamples, tmp_path: Path) -> None:
    model = model_of(inner)
    model.save(tmp_path / "model")
    read = surrogate.load(tmp_path / "model")
    assert isinstance(read, SweepModel)
    before, after = (other_profiles.at(ratios_of(one), inner.target[:8, :4]) for one in (model, read))
    assert np.array_equal(before, after)


def test_too_few_touches_of_a_profile_teach_nothing(inner: SweepSamples) -> None:
    (one,) = inner.others
    few = OtherProfile(one.profile, one.touch[:other_profiles.FEWEST - 1], one.signal_V[:other_profiles.FEWEST - 1])
    assert ratios_of(model_of(replace(inner, others=(few,)))) == ()


def test_intervals_of_the_force_hold_as_often_as_they_state_where_each_profile_is_as_likely() -> None:
    """Values of touches of two profiles, whose forces differ by less and more than the errors, at several coverages."""
    rng, n = np.random.default_rng(5), 4000
    ratio = np.stack([np.ones(n), rng.uniform(1, 1.5, n)], axis=1)
    ratio_sd, truth, which = 0.05 * np.array([0, 1.0]), rng.uniform(0.5, 2, n), rng.integers(0, 2, n)
    met = ratio[np.arange(n), which] + ratio_sd[which] * rng.normal(size=n)
    sd = np.where(rng.uniform(size=n) < 0.5, 0.02, 0.1)
    value = truth / met * (1 + sd * rng.normal(size=n))
    found = replace(regression(value[:, None], (value * sd)[:, None] ** 2), ratio=ratio[:, None],
                    ratio_sd=np.broadcast_to(ratio_sd, (n, 1, 2)))
    coverage = np.array([0.5, 0.9, 0.95])
    z = ndtri((1 + coverage) / 2)[:, None, None]
    below, above = found.ends(np.broadcast_to(z, (3, n, 1)), z)
    held = (value[:, None] - below <= truth[:, None]) & (truth[:, None] <= value[:, None] + above)
    assert held.mean(axis=(1, 2)) == pytest.approx(coverage, abs=0.02)
    alone = held[1, which == 0, 0].mean()
    assert 0.85 < alone < 0.95


def test_other_profiles_take_no_smaller_punch_from_an_interval_of_the_force() -> None:
    """Where profiles need more force for one signal, the tail of a mixture is a smaller tail of the trained profile."""
    one = np.ones((1, 1))
    found = replace(regression(one, 0.01 * one), ratio=np.array([[[1.0, 1.2, 1.3]]]), ratio_sd=np.zeros((1, 1, 3)))
    z = float(ndtri(0.95))
    wide = replace(found, past_below=0.2 * one, past_above=0.1 * one)
    assert found.ends(z * one, z)[0] < 0.1 * z
    assert wide.ends(z * one, z)[0] == pytest.approx(0.2 * z)
    assert wide.ends(z * one, z)[1] > 0.3


def test_the_least_factor_is_that_of_the_interval_which_ends_at_the_truth() -> None:
    """Mixtures with unequal sides, and punches outside the training range that hold some truths whatever the factor."""
    rng, n = np.random.default_rng(8), 300
    value, ratio = rng.uniform(0.5, 2, (n, 1)), np.stack([np.ones((n, 1)), rng.uniform(0.9, 1.3, (n, 1))], axis=2)
    found = replace(regression(value, (0.1 * value) ** 2), ratio=ratio, ratio_sd=0.03 * (ratio != 1),
                    above=0.15 * value, past_above=rng.uniform(0, 0.1, (n, 1)))
    truth, z = value * (1 + 0.15 * rng.normal(size=(n, 1))), float(ndtri(0.95))
    factor = found.least_factor(truth, z)
    below, above = found.ends(factor, z)
    off, asked = truth - value, factor > 0
    assert 0.1 < asked.mean() < 0.9
    assert np.where(off < 0, below, above)[asked] == pytest.approx(np.abs(off)[asked], rel=1e-5)
    assert np.all(np.abs(off)[~asked] <= np.where(off < 0, below, above)[~asked])


def test_answers_that_are_flagged_calibrate_no_interval() -> None:
    """Half of the rows are of punches outside the training range, with errors ten times as large as the others'."""
    rng, n = np.random.default_rng(9), 400
    truth, odd = rng.uniform(0, 10, (n, 1)), rng.uniform(size=n) < 0.5
    value = truth + np.where(odd, 10, 1)[:, None] * rng.normal(size=(n, 1))
    answer = replace(regression(value, np.ones((n, 1))), other=odd)
    learner: Any = SimpleNamespace(branched=lambda names: np.zeros(1, bool), estimate=lambda signal_V, noise_V: answer)
    model: Any = SimpleNamespace(
        method="ridge", names=("F",), seed=1, learner=learner, ring=SimpleNamespace(sheet=None),
        calibration=Calibration(np.ones((n, 3)), truth, np.zeros(n)),
        trained=SimpleNamespace(lowest=np.array([-50.0]), highest=np.array([60.0])))
    assert 1.4 < interval_scale(model).factor[0, 0] < 1.9
    answer = replace(answer, other=np.ones(n, bool))
    assert interval_scale(model).factor[0, 0] > 5
