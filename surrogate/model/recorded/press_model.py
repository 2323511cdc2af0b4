"""A trained model of recorded presses as users have it: it reads recordings and is kept in a folder."""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Self, get_type_hints

import pandas as pd

from eitsim.sensors.labels import PLACE, unit_of
from eitsim.sensors.recording import Recording
from surrogate.data.outputs import lowest
from surrogate.data.skin_from_above import SkinFromAbove
from surrogate.learners.registry import method_of
from surrogate.model import store
from surrogate.model.recorded.lost_channels import lost_words, without_stuck
from surrogate.model.recorded.plain_reader import PlainReader
from surrogate.model.recorded.reader_scores import Tested
from surrogate.recordings.press_reader import PressReader, read
from surrogate.recordings.presses import Presses, presses_in_time_of
from surrogate.recordings.touch_reader import TouchReader
from touchcal.array_store import Arrays, flat, rebuilt
from touchcal.arrays import Array
from touchcal.document import Keys, Number

OUTPUTS = {"x_mm": "x0_mm", "y_mm": "y0_mm"}  # labels whose outputs have another name
COORDINATES = (*PLACE, "z_mm")  # labels that may be below 0
BY_FAMILIES = "families"  # the method that recorded presses alone have
_COUNT = Number(0, 1e15, whole=True)
_SHAPE = store.shape_of({"kind": str, "presses": _COUNT, "frames": _COUNT, "left_out": [str], "scores": list})


@dataclass(frozen=True, eq=False)
class PressModel:
    """A reader of presses, and what is known of how well it reads; made by `learn` or `load`."""

    reader: PressReader | PlainReader
    kind: str  # of the readings, one of eitsim.sensors.recording.KINDS
    presses: int  # that it was trained on
    frames: int  # of these presses
    seed: int
    tested: tuple[Tested, ...]  # by readers of four fifths, a split after the other; none where these are too few
    fit_s: float  # CPU time of the reader, s
    left_out: tuple[str, ...] = ()  # which presses are not used and which splits not tested, and why, a sentence each
    skin: SkinFromAbove | None = None  # the sensor's, where that has an outline
    method: str = BY_FAMILIES

    LEARNT_FROM: ClassVar[str] = "presses"
    SHAPE: ClassVar[Keys] = _SHAPE

    @property
    def of_places(self) -> tuple[PressReader, TouchReader]:
        """Its families and their reader of places, which streams and pages need; ValueError where it has none."""
        if not isinstance(self.reader, PressReader) or self.reader.place is None:
            raise ValueError(f"a stream or a page needs a model that reads x_mm and y_mm by the method {BY_FAMILIES}, "
                             f"and this one reads {', '.join(self.labels)} by {self.method}. Learn it so; files of "
                             "frames are read by this one too.")
        return self.reader, self.reader.place

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the labels that are read, with their units."""
        return self.reader.labels

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return tuple(OUTPUTS.get(label, label).rpartition("_")[0] for label in self.labels)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each output."""
        return tuple(unit_of(label) for label in self.labels)

    @property
    def readings(self) -> int:
        """Readings of a frame."""
        return self.reader.signals.channels

    def predict(self, recording: Recording, say: Callable[[str], object] = warnings.warn) -> pd.DataFrame:
        """Read the touched frames of a recording, against its untouched ones, tracked to their times.

        Returns a row a touched frame: `touch`, or `index` where no touch is named, each label that is learnt, as x0_mm,
        y0_mm, d_mm, F_N, depth_mm or z_mm, with the ends of its 90 % interval, as x0_lo90_mm and x0_hi90_mm, and a
        flag. Of a place, x0_y0_correlation and x0_y0_ellipse90 make its 90 % ellipse, as surrogate.statistics.conformal
        says. `say` is called once where channels are dead, with what reading without them costs. ValueError where the
        model knows the cost of age in seconds and the recording has no clock; of one that knows it in frames, the
        recording's clock is left out.
        """
        presses = self.presses_of(recording)
        found = read(self.reader, presses)
        if words := lost_words(self.reader, presses):
            say(words)
        named = bool((presses.name != "").any())
        table = pd.DataFrame({"touch": presses.name} if named else {"index": presses.index})
        if found.place:
            for axis, name in enumerate(PLACE):
                _add(table, name, found.place.value[:, axis], found.place.bounds.half_width[:, axis])
            table["x0_y0_correlation"] = found.place.bounds.correlation
            table["x0_y0_ellipse90"] = found.place.bounds.ellipse
        for one in found.scalars:
            _add(table, one.name, one.value, one.half_width)
        return table.assign(flag=found.flag)

    def presses_of(self, recording: Recording) -> Presses:
        """The presses of a recording with ages as the model knows them, stuck channels dead; ValueError as of
        `predict`."""
        signals = self.reader.signals
        return presses_in_time_of(without_stuck(recording, signals), signals.clocked)

    def save(self, folder: Path | str) -> None:
        """Write the model as a folder that `load` reads; nothing in it is ever executed."""
        store.save(self, Path(folder))

    def described(self) -> dict[str, Any]:
        """What model.json says."""
        return {"kind": self.kind, "presses": self.presses, "frames": self.frames, "left_out": [*self.left_out],
                "scores": [asdict(one.score) for one in self.tested]}

    def arrays(self) -> Arrays:
        """What arrays.npz holds."""
        parts: dict[str, Any] = {"reader": self.reader, "tested": self.tested, "skin": self.skin}
        return {key: value for name, part in parts.items() for key, value in flat(part, name)}

    @classmethod
    def assembled(cls, text: Mapping[str, Any], arrays: Arrays) -> Self:
        """The inverse of both."""
        if text["method"] == BY_FAMILIES:
            reader = rebuilt(PressReader, "reader", arrays)
        else:
            parts = {name: rebuilt(kind, f"reader.{name}", arrays) for name, kind in get_type_hints(PlainReader).items()
                     if name != "learner"}
            learner = method_of(text["method"]).learner()
            reader = PlainReader(**parts, learner=rebuilt(learner, "reader.learner", arrays))
        return cls(reader, text["kind"], text["presses"], text["frames"], text["seed"],
                   rebuilt(tuple[Tested, ...], "tested", arrays), text["fit_s"], tuple(text["left_out"]),
                   rebuilt(SkinFromAbove | None, "skin", arrays), text["method"])


def _add(table: pd.DataFrame, label: str, value: Array, half_width: Array) -> None:
    name = OUTPUTS.get(label, label)
    stem, _, unit = name.rpartition("_")
    table[name], table[f"{stem}_lo90_{unit}"] = value, lowest(value, half_width, label not in COORDINATES)
    table[f"{stem}_hi90_{unit}"] = value + half_width
