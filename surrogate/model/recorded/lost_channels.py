"""Channels that recorded presses lack: which read nothing, and in words what reading without them costs."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from eitsim.sensors.labels import unit_of
from surrogate.data.dead_readings import MOST_DEAD, too_many
from surrogate.recordings.press_reader import Reader, without_channels
from surrogate.recordings.presses import Presses
from surrogate.recordings.signals import Signals
from touchcal.arrays import Mask

BY_CHANCE = 1e-6  # that a channel which changes in training reads one value in all frames
NAMED = 4  # channels that are named, at most


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
    return _most_lacked(reader.signals.dead(presses), channels, lambda dead: cost_words(reader, dead))


def lost_of_sets(dead: Mask) -> str:
    """In words, which channels are dead in frames (n, m) of several touches; empty likewise."""
    return _most_lacked(dead, dead.shape[1], lambda one: (
        f"{_named(one)} dead and left out, which probabilities and intervals allow for"))


def cost_words(reader: Reader, dead: Mask) -> str:
    """In words, which channels a mask (m + late,) of dead readings names, and what they cost on the training presses:
    held-out errors, and what filling in moves these presses by, taken as independent of them."""
    square = without_channels(reader, dead.tobytes()).square
    moved = {"place": square[:2].sum()} | dict(zip((one for one in reader.errors if one != "place"), square[2:],
                                                   strict=True))
    units = {name: "mm" if name == "place" else unit_of(name) for name in reader.errors}
    costs = ", ".join(f"{name} about {np.sqrt(error**2 + moved[name]):.3g} {units[name]} without, {error:.3g} with"
                      for name, error in reader.errors.items())
    return (f"{_named(dead[:reader.signals.channels])} dead and left out, and intervals are wider for it; mean error "
            f"by the training presses: {costs}")


def _most_lacked(dead: Mask, channels: int, words: Callable[[Mask], str]) -> str:
    lacking = [one.any() and not too_many(one) for one in dead[:, :channels]]
    if not any(lacking):
        return ""
    masks, count = np.unique(dead[lacking], axis=0, return_counts=True)
    others = f"; other frames, {sum(lacking) - count.max()} of them, lack other channels" * (len(masks) > 1)
    return f"in {count.max()} of {len(dead)} frames {words(masks[count.argmax()])}{others}."


def _named(dead: Mask) -> str:
    names = [f"v_{channel:03d}" for channel in np.flatnonzero(dead)]
    more = f" and {len(names) - NAMED} more" * (len(names) > NAMED)
    return f"{', '.join(names[:NAMED])}{more} {'is' if len(names) == 1 else 'are'}"
