"""Presses that a recording names, read as its table is: each against the untouched frames about it, on its own."""

from collections.abc import Callable

import numpy as np

from eitsim.sensors.recording import Recording
from surrogate.live.moments import Moment
from surrogate.model.recorded.lost_channels import lost_words
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.tracking.followed_presses import read_of
from surrogate.model.tracking.followed_reading import Read, unread
from surrogate.model.tracking.tracked import UNTOUCHED, Tracked
from surrogate.recordings.press_reader import read
from surrogate.recordings.presses import touched
from touchcal.arrays import Array


def marks_presses(recording: Recording) -> bool:
    """Whether a recording says which of its frames are touched, and against which untouched ones."""
    return recording.kind == "difference" or ((recording.touch != "").any() and bool(recording.untouched.any()))


def marked_reader(model: PressModel, recording: Recording,
                  say: Callable[[str], object]) -> Callable[[Moment], Tracked]:
    """Frame after frame of a recording that marks its presses, as `surrogate predict` reads them, and what it says of
    dead channels; ValueError as there."""
    presses = model.presses_of(recording)
    if words := lost_words(model.reader, presses):
        say(words)
    found = read(model.reader, presses)
    place = found.place
    assert place is not None
    each = iter([(read_of(found, k, place.value[k]), signal) for k, signal in enumerate(presses.signal)])
    nothing = unread(UNTOUCHED, ""), np.zeros(presses.signal.shape[1])
    frames = iter([next(each) if one else nothing for one in touched(recording)])
    return lambda moment: _shown(moment, *next(frames))


def _shown(moment: Moment, said: Read, signal: Array) -> Tracked:
    return Tracked(moment.time_s, said.state, said.value, said.covariance, said.below, said.above, signal, np.nan, 0,
                   said.flag, said.row)
