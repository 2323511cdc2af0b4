"""Channels that recorded presses lack: which read nothing, and in words what reading without them costs."""

from dataclasses import replace

import numpy as np

from eitsim.sensors.labels import unit_of
from surrogate.data.dead_readings import MOST_DEAD, cost_said, most_lacked, named
from surrogate.recordings.press_reader import Reader, without_channels
from surrogate.recordings.presses import Presses
from surrogate.recordings.signals import Signals
from touchcal.arrays import Mask

BY_CHANCE = 1e-6  # that a channel which changes in training reads one value in all frames


def without_stuck(signals: Signals, presses: Presses) -> Presses:
    """The presses with channels dead that read one value in all frames, where they change so often in training that
    chance makes this less likely than BY_CHANCE; as they are where these are more than MOST_DEAD of all."""
    frames = np.vstack([presses.signal, presses.rest - presses.rest[:1]])
    same = np.all(frames == frames[:1], axis=0)
    for channel in np.flatnonzero(same):
        trained = signals.readings.kept[:, channel]
        commonest = np.unique(trained, return_counts=True)[1].max() / len(trained)
        same[channel] = commonest ** len(presses.signal) < BY_CHANCE
    if not same.any() or np.mean(same) > MOST_DEAD:
        return presses
    signal, rest, following = (np.where(same, np.nan, one) for one in (presses.signal, presses.rest, presses.following))
    return replace(presses, signal=signal, rest=rest, following=following)


def lost_words(reader: Reader, presses: Presses) -> str:
    """In words, which channels are dead in presses, those that most of these frames lack, and what that costs; empty
    where none is, or too many are."""
    channels = reader.signals.channels
    return most_lacked(reader.signals.dead(presses), channels, lambda dead: cost_words(reader, dead))


def lost_of_sets(dead: Mask) -> str:
    """In words, which channels are dead in frames (n, m) of several touches; empty likewise."""
    return most_lacked(dead, dead.shape[1], lambda one: (
        f"{named(one)} dead and left out, which probabilities and intervals allow for"))


def cost_words(reader: Reader, dead: Mask) -> str:
    """In words, which channels a mask (m + late,) of dead readings names, and what they cost on the training presses:
    held-out errors, and what filling in moves these presses by, taken as independent of them."""
    place, *others = without_channels(reader, dead.tobytes()).mean.tolist()
    moved = {"place": place} | dict(zip((one for one in reader.errors if one != "place"), others, strict=True))
    costs = {name: (float(np.hypot(error, moved[name])), error, "mm" if name == "place" else unit_of(name))
             for name, error in reader.errors.items()}
    return cost_said(dead[:reader.signals.channels], "training presses", costs)
