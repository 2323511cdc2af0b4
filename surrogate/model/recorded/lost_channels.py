"""Channels that recorded presses lack: which read nothing, and in words what learning and reading without them cost."""

from dataclasses import replace

import numpy as np

from eitsim.sensors.labels import unit_of
from eitsim.sensors.recording import Recording
from surrogate.data.dead_readings import MOST_DEAD, Costs, Names, cost_said, errors_said, most_lacked, named, too_many
from surrogate.model import sticking
from surrogate.recordings.press_reader import Reader, without_channels
from surrogate.recordings.presses import Presses
from surrogate.recordings.signals import Signals
from touchcal.arrays import Mask

TELLING = "training presses"  # which rows say what channels cost


def without_stuck(recording: Recording, signals: Signals | None = None) -> Recording:
    """The recording with channels dead from where they stick to the end on, by how often they change there and in
    training, where signals say that; as it is where these are more than MOST_DEAD of all."""
    if np.iscomplexobj(recording.readings):
        return recording
    before = sticking.usual(signals.readings.kept[:, :signals.channels]) if signals else None
    return replace(recording, readings=sticking.off(np.asarray(recording.readings, np.float64), MOST_DEAD, before))


def stuck_in(recording: Recording, sound: Recording) -> Mask:
    """(m,) channels of a recording that stick in it, by the recording `without_stuck`."""
    return np.any(np.isnan(sound.readings) & ~np.isnan(recording.readings), axis=0)


def lost_words(reader: Reader, presses: Presses) -> str:
    """In words, which channels are dead in presses, those that most of these frames lack, and what that costs; empty
    where none is, or too many are."""
    channels = reader.signals.channels
    return most_lacked(reader.signals.dead(presses), channels, lambda dead: cost_words(reader, dead, presses.columns))


def lost_of_sets(dead: Mask, columns: Names) -> str:
    """In words, which channels are dead in frames (n, m) of several touches; empty likewise."""
    return most_lacked(dead, dead.shape[1], lambda one: (
        f"{named(one, columns)} dead and left out, which probabilities and intervals allow for"))


def cost_words(reader: Reader, dead: Mask, columns: Names) -> str:
    """In words, which channels a mask (m + late,) of dead readings names, and what they cost."""
    return cost_said(dead[:reader.signals.channels], TELLING, _costs(reader, dead), columns)


def taught_without(reader: Reader, presses: Presses, silent: Mask, stuck: Mask) -> list[str]:
    """In words, which channels a reader of these presses was taught without: those that some presses lack, with what
    that costs, and those that it does not know, silent (m,); stuck: (m,) those that stick, others are dead."""
    lacking, said = np.isnan(presses.signal), []
    some, rows = np.any(lacking, axis=0), np.flatnonzero(lacking.any(axis=1))
    if some.any():
        cost = "" if too_many(some) else "; " + errors_said(
            TELLING, _costs(reader, np.append(some, some[reader.signals.late])))
        said.append(f"{named(some, presses.columns)} {_state(some, stuck)} in {len(rows)} of {len(lacking)} labelled "
                    f"frames, the first of them frame {presses.index[rows[0]]}, and filled in from the others there"
                    f"{cost}.")
    return [*said, *silent_words(silent, stuck, presses.columns)]


def silent_words(silent: Mask, stuck: Mask, columns: Names) -> list[str]:
    """In words, which channels (m,) teach nothing; a sentence, or none."""
    return [f"{named(silent, columns)} {_state(silent, stuck)} and left out altogether, in frames that are read later "
            "as well; what that costs is unknown."] * bool(silent.any())


def _state(channels: Mask, stuck: Mask) -> str:
    states = {"dead": channels & ~stuck, "stuck": channels & stuck}
    return " or ".join(state for state, some in states.items() if some.any())


def _costs(reader: Reader, dead: Mask) -> Costs:
    """What a mask (m + late,) of dead readings costs on the training presses: held-out errors, and what filling in
    moves these presses by, taken as independent of them."""
    place, *others = without_channels(reader, dead.tobytes()).mean.tolist()
    moved = {"place": place} | dict(zip((one for one in reader.errors if one != "place"), others, strict=True))
    return {name: (float(np.hypot(error, moved[name])), error, "mm" if name == "place" else unit_of(name))
            for name, error in reader.errors.items()}
