"""A trained reader as a folder: model.json says what it is, arrays.npz holds its numbers; nothing is ever executed."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from surrogate.data.skin_from_above import SkinFromAbove
from surrogate.recordings.trained.press_reader import PressReader
from surrogate.recordings.trained.reader_scores import Tested
from surrogate.recordings.trained.train_reader import TrainedReader
from touchcal.array_store import flat, read_npz, rebuilt
from touchcal.document import Keys, Number, check
from touchcal.errors import InputFileError
from touchcal.json_file import digest, file_digest, read_json, write_json
from touchcal.whole_file import written

METHOD, SCHEMA = "recording", 4
DESCRIPTION, ARRAYS, PART, TESTED, SKIN = "model.json", "arrays.npz", "reader", "tested", "skin"
_HASH, _DESCRIBED = "arrays_sha256", "description_sha256"
_RETRAIN = "A model is the folder that `surrogate train --out` writes; train it again."
_COUNT = Number(0, 1e15, whole=True)
_SHAPE = Keys({"schema": _COUNT, "method": str, "kind": str, "presses": _COUNT, "frames": _COUNT,
               "seed": Number(0, whole=True), "fit_s": Number(0), "left_out": [str], "scores": list, _HASH: str})


def save_reader(model: TrainedReader, folder: Path) -> None:
    """Write a model; model.json comes last, so that a folder that has it is whole."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DESCRIPTION).unlink(missing_ok=True)
    text: dict[str, Any] = {"schema": SCHEMA, "method": METHOD, "kind": model.kind, "presses": model.presses,
                            "frames": model.frames, "seed": model.seed, "fit_s": model.fit_s,
                            "left_out": [*model.left_out],
                            "scores": [asdict(one.score) for one in model.tested]}
    with written(folder / ARRAYS) as file:
        np.savez_compressed(file, allow_pickle=False, **dict(flat(model.reader, PART)),
                            **dict(flat(model.tested, TESTED)), **dict(flat(model.skin, SKIN)),
                            **{_DESCRIBED: np.array(digest(text))})
    write_json(text | {_HASH: file_digest(folder / ARRAYS)}, folder / DESCRIPTION)


def is_reader(folder: Path) -> bool:
    """Whether a folder holds a model of this kind."""
    path = folder / DESCRIPTION
    return path.is_file() and read_json(path, "a model", _RETRAIN).get("method") == METHOD


def load_reader(folder: Path | str) -> TrainedReader:
    """Read a model; InputFileError where the folder is none, of another schema, damaged or changed."""
    folder = Path(folder)
    text = read_json(folder / DESCRIPTION, "a model", _RETRAIN)
    if text.get("method") != METHOD:
        raise InputFileError(folder, "a model of a sweep: read it with `surrogate predict`, or in Python with "
                                     "surrogate.load.")
    if text.get("schema") != SCHEMA:
        raise InputFileError(folder, f"a model of schema {text.get('schema')}, and this version reads schema {SCHEMA}. "
                                     "Train it again: `surrogate train RECORDING --labels touches.csv --out MODEL`.")
    try:
        check(text, _SHAPE)
        stated, arrays = text.pop(_HASH), read_npz(folder / ARRAYS)
        if stated != file_digest(folder / ARRAYS):
            raise ValueError(f"{ARRAYS} was changed, or is of another model")
        if str(arrays.pop(_DESCRIBED)) != digest(text):
            raise ValueError(f"{DESCRIPTION} was changed")
        return TrainedReader(rebuilt(PressReader, PART, arrays), text["kind"], text["presses"], text["frames"],
                             text["seed"], rebuilt(tuple[Tested, ...], TESTED, arrays), text["fit_s"],
                             tuple(text["left_out"]), rebuilt(SkinFromAbove | None, SKIN, arrays))
    except (LookupError, TypeError, ValueError) as error:
        raise InputFileError(folder, f"its {ARRAYS} and its {DESCRIPTION} do not belong together, or one is damaged "
                                     f"({error}). Train the model again.") from None
