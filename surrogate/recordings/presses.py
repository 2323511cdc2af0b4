"""Presses of a recording: what each touched frame adds to the untouched one, and where it was pressed."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eitsim.sensors.labels import Labels, labels_of
from eitsim.sensors.recording import Recording
from surrogate.recordings.baselines import in_order, tracked
from touchcal.arrays import Array, Index, Mask
from touchcal.errors import InputFileError


@dataclass(frozen=True, eq=False)
class Presses:
    """Touched frames in time order."""

    name: NDArray[np.str_]  # (n,) touch
    index: NDArray[np.int64]  # (n,) number of the frame in time
    signal: Array  # (n, m) touched less untouched readings, in the unit of the readings; NaN where a channel is dead
    # (n, m) the frame that follows in the recording, likewise; NaN where it is not there
    following: Array
    age: Array  # (n,) time to the nearest untouched frame, in the unit of `rest_time`; 0 for differences
    rest: Array  # (k, m) untouched frames, in time order
    rest_time: Array  # (k,) their times, s, or their indices where the recording has no clock
    time: Array  # (n,) time of each touched frame, likewise
    clocked: bool = False  # whether times are seconds, and not indices
    columns: tuple[str, ...] = ()  # (m,) names of the readings in their file, where these are others than v_000 ...

    @property
    def with_noise(self) -> "Presses":
        """The presses with that between two untouched frames added, of the median norm; as they are without two."""
        steps = np.nan_to_num(np.diff(self.rest, axis=0))
        if not len(steps):
            return self
        step = steps[np.argsort(np.linalg.norm(steps, axis=1))[len(steps) // 2]]
        return replace(self, signal=self.signal + step, following=self.following + step)


def touched(recording: Recording) -> Mask:
    """(frames,) which frames of a recording are touched; all of differences."""
    return np.ones(len(recording.touch), bool) if recording.kind == "difference" else recording.touch != ""


def presses_of(recording: Recording) -> Presses:
    """The touched frames of a recording, each less the untouched frame tracked to its time; InputFileError where there
    is no untouched frame, no touched one, or a complex reading."""
    frames, time = recording.readings, in_order(recording.index, recording.time_s)
    if np.iscomplexobj(frames):
        raise InputFileError(recording.source, "complex readings; give their magnitudes or their real parts.")
    untouched, pressed = recording.untouched, touched(recording)
    if not pressed.any():
        raise InputFileError(recording.source, "no frame is touched: fill in the column touch. To read frames of which "
                                               "that is not known, give the columns v_000 ... alone as a stream: "
                                               "surrogate predict MODEL - < FRAMES.csv")
    rest = np.asarray(frames[untouched], float)
    signal, age = np.asarray(frames[pressed], float), np.zeros(int(pressed.sum()))
    following = _following(np.asarray(frames, float), recording.index)[pressed]
    if recording.kind != "difference":
        if not untouched.any():
            raise InputFileError(recording.source, f"no frame is untouched, and the readings are of the kind "
                                                   f"{recording.kind}. Record untouched frames, their touch empty.")
        used = pressed | untouched
        baseline, age = tracked(np.asarray(frames[used], float), time[used], untouched[used])
        signal, following = signal - baseline, following - baseline
    return Presses(recording.touch[pressed], recording.index[pressed], signal, following, age, rest, time[untouched],
                   time[pressed], recording.time_s is not None, recording.columns)


def presses_in_time_of(recording: Recording, clocked: bool) -> Presses:
    """The presses of a recording with times as a model knows them, in seconds or in frames; ValueError where it knows
    them in seconds and the recording has no clock."""
    if clocked and recording.time_s is None and recording.kind != "difference":
        raise ValueError(f"{recording.source}: it has no column time_s, and the model was trained on a recording "
                         "with one, so that the ages of untouched frames cannot be compared. Add time_s, or train "
                         "on a recording without it.")
    return presses_of(recording if clocked else replace(recording, time_s=None))


def labelled(presses: Presses, labels: Labels, source: str) -> tuple[Presses, Labels]:
    """The presses that have labels, and their labels in the same order; ValueError where the labels name no touch of
    the recording."""
    row = {name: number for number, name in enumerate(labels.touch.tolist())}
    known = np.array([name in row for name in presses.name.tolist()])
    if not known.any():
        raise ValueError(f"{source}: none of its {len(row)} touches is one of the recording's, which begin with "
                         f"{', '.join(presses.name[:3].tolist())}. Name touches as the recording does.")
    kept = taken(presses, np.flatnonzero(known))
    return kept, labels_of(labels, np.array([row[name] for name in kept.name.tolist()]))


def unmatched(recording: Recording, labels: Labels) -> list[str]:
    """Labels without a touch in the recording, and its touches without a label, a sentence each."""
    there, named = ([*dict.fromkeys(one.tolist())] for one in (recording.touch[recording.touch != ""], labels.touch))
    strange, unknown = ([name for name in some if name not in {*others}]
                        for some, others in ((named, there), (there, named)))
    return [f"{what}: {len(odd)} of {len(whole)} touches, the first '{odd[0][:20]}'."
            for what, odd, whole in (("labelled, but not in the recording", strange, named),
                                     ("in the recording, but without a label, so that they teach nothing", unknown,
                                      there)) if odd]


def silenced(presses: Presses, channels: Mask) -> Presses:
    """The presses with no signal and no untouched reading of these channels (m,)."""
    there = np.any(np.isfinite(presses.following), axis=1, keepdims=True)
    return replace(presses, signal=np.where(channels, 0.0, presses.signal), rest=np.where(channels, 0.0, presses.rest),
                   following=np.where(channels & there, 0.0, presses.following))


def cut(presses: Presses) -> Presses:
    """The presses without the frames that follow them."""
    return replace(presses, following=np.full_like(presses.following, np.nan))


def taken(presses: Presses, rows: NDArray[np.intp]) -> Presses:
    """Some of the presses, in this order."""
    return replace(presses, name=presses.name[rows], index=presses.index[rows], signal=presses.signal[rows],
                   following=presses.following[rows], age=presses.age[rows], time=presses.time[rows])


def until(presses: Presses, latest: float) -> Presses:
    """The presses with the untouched frames up to a time alone."""
    return _rested(presses, np.flatnonzero(presses.rest_time <= latest))


def whole_rest(presses: Presses) -> Presses:
    """The presses with the untouched frames that have no dead channel alone."""
    return _rested(presses, np.flatnonzero(np.isfinite(presses.rest).all(axis=1)))


def _rested(presses: Presses, kept: Index) -> Presses:
    return replace(presses, rest=presses.rest[kept], rest_time=presses.rest_time[kept])


def _following(frames: Array, index: NDArray[np.int64]) -> Array:
    """(frames, m) the frame whose index is one more; NaN where there is none."""
    out = np.full_like(frames, np.nan)
    next_to = np.flatnonzero(np.diff(index) == 1)
    out[next_to] = frames[next_to + 1]
    return out
