"""A model as a folder: model.json says what it is, arrays.npz holds its numbers; nothing in it is ever executed."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from surrogate.data import outputs
from surrogate.data.sensor_ring import Ring
from surrogate.learners.registry import METHODS
from surrogate.model.trained import Calibration, Range, Rows, TrainedModel
from touchcal.array_store import Arrays, flat, read_npz, rebuilt
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.json_file import digest, read_json, write_json
from touchcal.whole_file import written

SCHEMA = 9
DESCRIPTION, ARRAYS = "model.json", "arrays.npz"
EVALUATION, PREDICTIONS = "evaluation.json", "predictions.parquet"
# What ties both files: the key of model.json with the hash of arrays.npz, and the array with the hash of the other keys
# of model.json. Models that were trained earlier have neither.
HASH = "arrays_sha256"
DESCRIBED = "description_sha256"
_RETRAIN = "A model is the folder that `surrogate train --out` writes; train it again."
M = TypeVar("M", bound=TrainedModel)


def save(model: TrainedModel, folder: Path) -> None:
    """Write a model; model.json comes last, so a folder that has it is whole, and scores of an earlier one go.
    InputFileError as check_own."""
    check_own(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name in (DESCRIPTION, EVALUATION, PREDICTIONS):
        (folder / name).unlink(missing_ok=True)
    parts = {"ring": model.ring, "learner": model.learner, "calibration": model.calibration, "rows": model.rows,
             "trained": model.trained}
    arrays = {key: value for name, part in parts.items() for key, value in flat(part, name)}
    text = {"schema": SCHEMA, "method": model.method,
            "outputs": [{"name": n, "unit": u} for n, u in zip(model.names, model.units, strict=True)],
            "seed": model.seed, "fit_s": model.fit_s, **model.record}
    with written(folder / ARRAYS) as file:
        np.savez_compressed(file, allow_pickle=False, baseline_V=model.baseline_V,
                            **arrays, **{DESCRIBED: np.array(digest(text))})
    write_json(text | {HASH: _file_hash(folder / ARRAYS)}, folder / DESCRIPTION)


def check_own(folder: Path) -> None:
    """InputFileError where a folder holds something that is no model, which training into it would mix up with one."""
    if (folder / DESCRIPTION).exists():
        return
    own = (ARRAYS, EVALUATION, PREDICTIONS)
    for path in sorted(folder.iterdir()) if folder.exists() else []:
        if not path.name.startswith(".") and path.name not in own:
            raise InputFileError(folder, f"it holds {path.name} and no model. Choose an empty folder for the model.")


def _file_hash(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def save_evaluation(folder: Path, scores: Mapping[str, Any], predictions: pd.DataFrame) -> None:
    """Write scores and the predictions behind them into a model's folder, for reports."""
    with written(folder / PREDICTIONS) as file:
        predictions.to_parquet(file, index=False)
    write_json(scores, folder / EVALUATION)


def histories(folder: Path, names: Sequence[str]) -> dict[str, Array]:
    """Training.history of the network of each output of these names; empty for a model of no such networks."""
    stored = read_npz(folder / ARRAYS) if (folder / ARRAYS).is_file() else {}
    found = {name: stored.get(f"learner.networks.trainings.{i}.history") for i, name in enumerate(names)}
    return {name: history for name, history in found.items() if history is not None}


def read(kind: type[M], folder: Path) -> M:
    """Read a model as this class; InputFileError where the folder is none, of another schema, damaged or changed."""
    path = folder / DESCRIPTION
    if not path.exists():
        raise InputFileError(folder, f"not a model: it holds no {DESCRIPTION}. A model is the folder that "
                                     "`surrogate train --out` writes.")
    text = read_json(path, "a model", _RETRAIN)
    if text.get("schema") != SCHEMA or text.get("method") not in METHODS:
        raise InputFileError(path, f"model schema {text.get('schema')!r}, method {text.get('method')!r} is not one "
                                   f"that this version reads (schema {SCHEMA}; {', '.join(METHODS)}). Train it again.")
    try:
        stated, arrays = text.pop(HASH, None), read_npz(folder / ARRAYS)
        found = digest(text)
        described = str(arrays.pop(DESCRIBED, found))
        model = _assemble(kind, text, arrays)
        if described != found:
            raise ValueError(f"{DESCRIPTION} was changed")
        if stated not in (None, _file_hash(folder / ARRAYS)):
            raise ValueError(f"{ARRAYS} was changed")
        return model
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputFileError(folder, f"its {ARRAYS} and its {DESCRIPTION} do not belong together, or one is damaged "
                                     f"({error}). Train the model again.") from None


def _assemble(kind: type[M], text: dict[str, Any], arrays: Arrays) -> M:
    own = ("schema", "method", "outputs", "seed", "fit_s")
    names = tuple(outputs.of(output["name"]).name for output in text["outputs"])
    ring = rebuilt(Ring, "ring", arrays)
    if arrays["baseline_V"].shape != ring.read.shape or arrays["baseline_V"].dtype.kind != "f":
        raise ValueError("baseline_V is not of the ring's readings")
    return kind(text["method"], ring, names,
                 rebuilt(METHODS[text["method"]].learner(), "learner", arrays),
                 rebuilt(Calibration, "calibration", arrays), rebuilt(Rows, "rows", arrays),
                 rebuilt(Range, "trained", arrays), arrays["baseline_V"], text["seed"], text["fit_s"],
                 {key: value for key, value in text.items() if key not in own})
