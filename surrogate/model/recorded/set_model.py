"""A trained model of several touches at once: which of its places are pressed, in recordings, with probabilities."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd

from eitsim.sensors.recording import Recording
from eitsim.sensors.touch_sets import TouchSets
from surrogate.data.dead_readings import too_many
from surrogate.data.flags import Flag, in_words
from surrogate.model import store
from surrogate.model.recorded.lost_channels import lost_of_sets, without_stuck
from surrogate.recordings.presses import Presses, presses_in_time_of
from surrogate.recordings.several.press_means import first_frames, means, press_numbers
from surrogate.recordings.several.set_reader import SetReader, SetReading, read, set_numbers
from touchcal.array_store import Arrays, flat, rebuilt
from touchcal.arrays import Array, Index, Mask
from touchcal.document import Keys, Number

SUPERPOSITION = "superposition"  # the method of these models
_COUNT = Number(0, 1e15, whole=True)
_SHAPE = store.shape_of({"kind": str, "places": [str], "presses": _COUNT, "frames": _COUNT, "readings": _COUNT,
                         "clocked": bool, "left_out": [str], "scores": list})


@dataclass(frozen=True)
class SetScore:
    """What was read of presses that did not train; shares of the tested presses, and means over them."""

    split: str
    trained: int  # presses
    tested: int  # presses
    all_right: float  # share whose likeliest set of places is the true one
    count_right: float  # share whose likeliest count is the true one
    count_probability: float  # mean probability that the likeliest count was given
    true_probability: float  # mean probability that the true set was given


@dataclass(frozen=True, eq=False)
class SetModel:
    """A reader of sets of places, and how well it reads; made by `learn_sets` or `load`."""

    reader: SetReader
    places: tuple[str, ...]
    at_mm: Array | None  # (k, 2) x and y of the places, mm, where they are known
    kind: str  # of the readings, one of eitsim.sensors.recording.KINDS
    presses: int  # that it was trained on
    frames: int  # of these presses
    clocked: bool  # whether its times are seconds, and not frames
    fit_s: float
    scores: tuple[SetScore, ...]
    mean_force_N: Array | None = None  # (k,) of each place in training, where forces are labelled
    left_out: tuple[str, ...] = ()
    seed: int = 0
    method: str = SUPERPOSITION

    LEARNT_FROM: ClassVar[str] = "sets"
    SHAPE: ClassVar[Keys] = _SHAPE

    @property
    def readings(self) -> int:
        """Readings of a frame."""
        return len(self.reader.used)

    def predict(self, recording: Recording, say: Callable[[str], object] = warnings.warn) -> pd.DataFrame:
        """Read which places the presses of a recording press, each by its touched frames, against the untouched ones.

        Frames of one press have one `touch`. Returns a row a press: `touch`, or a row a touched frame and its `index`
        where no touch is named; `count`, the likeliest number of
        touches, and `count_probability`; `places`, the likeliest set, and `places_probability`; p_NAME, the probability
        that a place is pressed; where places are known in mm, x0_mm, y0_mm, x1_mm ... of the likeliest set; where
        forces were labelled, F_NAME_N with the ends of its 90 % interval; and a flag. `say` is called once where
        channels are dead.
        """
        presses = self._presses_of(recording)
        if words := lost_of_sets(np.isnan(presses.signal) & self.reader.used, presses.columns):
            say(words)
        press = press_numbers(presses)
        found, first = read(self.reader, presses, press), first_frames(presses, press)
        count, down = found.count, found.down
        named = bool((first.name != "").any())
        table = pd.DataFrame({"touch": first.name} if named else {"index": first.index})
        table["count"], table["count_probability"] = count.argmax(axis=1) + 1, count.max(axis=1)
        table["places"] = ["; ".join(np.array(self.places)[row]) for row in down]
        table["places_probability"] = found.probability.max(axis=1)
        for name, probability in zip(self.places, found.place.T, strict=True):
            table[f"p_{name}"] = probability
        if self.at_mm is not None:
            table = table.assign(**_in_order(self.at_mm, down))
        if self.mean_force_N is not None:
            for column, name in enumerate(self.places):
                pressed = np.where(down[:, column], self.mean_force_N[column], np.nan)
                for end, sign in (("", 0.0), ("_lo90", -1.0), ("_hi90", 1.0)):
                    value = found.amount[:, column] + sign * found.half_width[:, column]
                    table[f"F_{name}{end}_N"] = pressed * np.maximum(value, 0.0)
        table["flag"] = _flags(self.reader, means(press, presses.signal), found)
        return table

    def score(self, recording: Recording, sets: TouchSets) -> SetScore:
        """How well the labelled frames of a recording are read; ValueError where their places are not the model's, or
        no touch is one of the recording's."""
        if odd := [name for name in sets.places if name not in self.places]:
            raise ValueError(f"the labels name the place '{odd[0]}', and the model knows {', '.join(self.places)}. "
                             "Give labels of these.")
        presses = self._presses_of(recording)
        press = press_numbers(presses)
        rows, of = labelled_rows(first_frames(presses, press), sets)
        down = np.zeros((len(rows), len(self.places)), bool)
        down[:, [self.places.index(name) for name in sets.places]] = sets.down[of]
        found = read(self.reader, presses, press)
        return set_score("all", self.presses, found.some(rows), down)

    def _presses_of(self, recording: Recording) -> Presses:
        return presses_in_time_of(without_stuck(recording), self.clocked)

    def save(self, folder: Path | str) -> None:
        """Write the model as a folder that `load` reads; nothing in it is ever executed."""
        store.save(self, Path(folder))

    def described(self) -> dict[str, Any]:
        """What model.json says."""
        return {"kind": self.kind, "places": [*self.places], "presses": self.presses, "frames": self.frames,
                "readings": self.readings, "clocked": self.clocked, "left_out": [*self.left_out],
                "scores": [asdict(one) for one in self.scores]}

    def arrays(self) -> Arrays:
        """What arrays.npz holds."""
        parts: dict[str, Any] = {"reader": self.reader, "at_mm": self.at_mm, "mean_force_N": self.mean_force_N}
        return {key: value for name, part in parts.items() for key, value in flat(part, name)}

    @classmethod
    def assembled(cls, text: Mapping[str, Any], arrays: Arrays) -> Self:
        """The inverse of both."""
        reader = rebuilt(SetReader, "reader", arrays)
        if len(text["places"]) != reader.places:
            raise ValueError("places and patterns differ in number")
        return cls(reader, tuple(text["places"]), rebuilt(Array | None, "at_mm", arrays), text["kind"],
                   text["presses"], text["frames"], text["clocked"], text["fit_s"],
                   tuple(SetScore(**one) for one in text["scores"]), rebuilt(Array | None, "mean_force_N", arrays),
                   tuple(text["left_out"]), text["seed"])


def labelled_rows(presses: Presses, sets: TouchSets) -> tuple[Index, Index]:
    """Frames that have labels, and the number of the touch of each; ValueError where there is none."""
    row = {name: number for number, name in enumerate(sets.touch.tolist())}
    rows = np.array([number for number, name in enumerate(presses.name.tolist()) if name in row], np.intp)
    if not len(rows):
        raise ValueError(f"none of the {len(row)} labelled touches is one of the recording's, which begin with "
                         f"{', '.join(presses.name[:3].tolist())}. Name touches as the recording does.")
    return rows, np.array([row[name] for name in presses.name[rows].tolist()], np.intp)


def set_score(split: str, trained: int, found: SetReading, down: Mask) -> SetScore:
    """The score of what was read of presses whose places (n, k) are known."""
    count = found.count
    return SetScore(split, trained, len(down), float(np.mean((found.down == down).all(axis=1))),
                    float(np.mean(count.argmax(axis=1) + 1 == down.sum(axis=1))), float(count.max(axis=1).mean()),
                    float(found.probability[np.arange(len(down)), set_numbers(down)].mean()))


def _in_order(at_mm: Array, down: Mask) -> dict[str, Array]:
    """Columns x0_mm, y0_mm, x1_mm ... of the places (k, 2) of sets (n, k), NaN after the last."""
    most = int(down.sum(axis=1).max(initial=1))
    place = np.full((len(down), most, 2), np.nan)
    for row, pressed in enumerate(down):
        place[row, :pressed.sum()] = at_mm[pressed]
    return {f"{axis}{number}_mm": place[:, number, column] for number in range(most)
            for column, axis in enumerate("xy")}


def _flags(reader: SetReader, signal: Array, found: SetReading) -> list[str]:
    """Why not to trust each press of these mean signals (p, m), in words."""
    dead = np.isnan(signal[:, reader.used])
    return [too_many(gone) or in_words(int(Flag.OTHER_PATTERN) * odd) for gone, odd in
            zip(dead, (found.misfit > reader.odd).tolist(), strict=True)]
