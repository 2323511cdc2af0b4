"""Forces of other profiles at the same signals, learned and in the intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import surrogate
from surrogate.data.samples import OtherProfile, SweepSamples, take
from surrogate.forward_map.inversion import other_profiles
from surrogate.forward_map.inversion.other_profiles import ForceRatio
from surrogate.learners.forward import TouchInversion
from surrogate.model.assumed_punch import assumed_punch
from surrogate.model.sweep_model import SweepModel
from surrogate.model.train import train
from surrogate.model.trained import TrainedModel
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
    low, high = other_profiles.extremes(ratios_of(model), touch)
    off = np.abs(high / stronger(touch) - 1)
    print("ratio off by", np.quantile(off, [0.5, 0.9, 1.0]))
    assert np.all(low == 1)
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
    before, after = (other_profiles.extremes(ratios_of(one), inner.target[:8, :4]) for one in (model, read))
    assert np.array_equal(before, after)


def test_too_few_touches_of_a_profile_teach_nothing(inner: SweepSamples) -> None:
    (one,) = inner.others
    few = OtherProfile(one.profile, one.touch[:other_profiles.FEWEST - 1], one.signal_V[:other_profiles.FEWEST - 1])
    assert ratios_of(model_of(replace(inner, others=(few,)))) == ()
