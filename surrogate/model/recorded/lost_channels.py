"""Channels that recorded presses lack: which read nothing, and in words what reading without them costs."""

from dataclasses import replace

import numpy as np

from eitsim.sensors.labels import unit_of
from eitsim.sensors.recording import Recording
from surrogate.data.dead_readings import MOST_DEAD, cost_said, most_lacked, named
from surrogate.model import sticking
from surrogate.recordings.press_reader import Reader, without_channels
from surrogate.recordings.presses import Presses
from surrogate.recordings.signals import Signals
from touchcal.arrays import Mask


def without_stuck(recording: Recording, signals: Signals | None = None) -> Recording:
    """The recording with channels dead from where they stick to the end on, by how often they change there and in
    training, where signals say that; as it is where these are more than MOST_DEAD of all."""
    if np.iscomplexobj(recording.readings):
        return recording
    before = sticking.usual(signals.readings.kept[:, :signals.channels]) if signals else None
    return replace(recording, readings=sticking.off(np.asarray(recording.readings, np.float64), MOST_DEAD, before))


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
