"""A model as a folder: model.json says what it is, arrays.npz holds its numbers; nothing in it is ever executed."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from surrogate.data import outputs
from surrogate.data.sensor_ring import Ring
from surrogate.learners.registry import METHODS
from surrogate.model.trained import Calibration, Range, Rows, TrainedModel
from touchcal.array_store import Arrays, flat, rebuilt
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.json_file import write_json

SCHEMA = 8
DESCRIPTION, ARRAYS = "model.json", "arrays.npz"
EVALUATION, PREDICTIONS = "evaluation.json", "predictions.parquet"
M = TypeVar("M", bound=TrainedModel)


def save(model: TrainedModel, folder: Path) -> None:
    """Write a model; model.json comes last, so a folder that has it is whole, and scores of an earlier one go."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (DESCRIPTION, EVALUATION, PREDICTIONS):
        (folder / name).unlink(missing_ok=True)
    parts = {"ring": model.ring, "learner": model.learner, "calibration": model.calibration, "rows": model.rows,
             "trained": model.trained}
    arrays = {key: value for name, part in parts.items() for key, value in flat(part, name)}
    temporary = folder / f".{ARRAYS}.part"
    with open(temporary, "wb") as file:
        np.savez_compressed(file, allow_pickle=False, baseline_V=model.baseline_V, **arrays)
    os.replace(temporary, folder / ARRAYS)
    write_json({"schema": SCHEMA, "method": model.method,
                "outputs": [{"name": n, "unit": u} for n, u in zip(model.names, model.units, strict=True)],
                "seed": model.seed, "fit_s": model.fit_s, **model.record}, folder / DESCRIPTION)


def save_evaluation(folder: Path, scores: Mapping[str, Any], predictions: pd.DataFrame) -> None:
    """Write scores and the predictions behind them into a model's folder, for reports."""
    predictions.to_parquet(folder / PREDICTIONS, index=False)
    write_json(scores, folder / EVALUATION)


def histories(folder: Path, names: Sequence[str]) -> dict[str, Array]:
    """Training.history of the network of each output of these names; empty for a model of no such networks."""
    stored = _read_arrays(folder / ARRAYS) if (folder / ARRAYS).is_file() else {}
    found = {name: stored.get(f"learner.networks.trainings.{i}.history") for i, name in enumerate(names)}
    return {name: history for name, history in found.items() if history is not None}


def read(kind: type[M], folder: Path) -> M:
    """Read a model as this class; InputFileError where the folder is none, of another schema, or damaged."""
    path = folder / DESCRIPTION
    if not path.is_file():
        raise InputFileError(folder, f"not a model: it holds no {DESCRIPTION}. A model is the folder that "
                                     "`surrogate train --out` writes.")
    try:
        text = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise InputFileError(path, f"not JSON: {error.msg}.", line=error.lineno) from None
    if not isinstance(text, dict):
        raise InputFileError(path, "holds no JSON object. A model is the folder that `surrogate train --out` writes; "
                                   "train it again.")
    if text.get("schema") != SCHEMA or text.get("method") not in METHODS:
        raise InputFileError(path, f"model schema {text.get('schema')!r}, method {text.get('method')!r} is not one "
                                   f"that this version reads (schema {SCHEMA}; {', '.join(METHODS)}). Train it again.")
    try:
        return _assemble(kind, text, _read_arrays(folder / ARRAYS))
    except (KeyError, TypeError, ValueError, zipfile.BadZipFile, EOFError) as error:
        why = type(error).__name__ if "pickle" in str(error) else error
        raise InputFileError(folder, f"its {ARRAYS} and its {DESCRIPTION} do not belong together, or one is damaged "
                                     f"({why}). Train the model again.") from None


def _read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}


def _assemble(kind: type[M], text: dict[str, Any], arrays: Arrays) -> M:
    own = ("schema", "method", "outputs", "seed", "fit_s")
    names = tuple(outputs.of(output["name"]).name for output in text["outputs"])
    ring = rebuilt(Ring, "ring", arrays)
    if arrays["baseline_V"].shape != ring.read.shape:
        raise ValueError("baseline_V is not of the ring's readings")
    return kind(text["method"], ring, names,
                 rebuilt(METHODS[text["method"]].learner(), "learner", arrays),
                 rebuilt(Calibration, "calibration", arrays), rebuilt(Rows, "rows", arrays),
                 rebuilt(Range, "trained", arrays), arrays["baseline_V"], text["seed"], text["fit_s"],
                 {key: value for key, value in text.items() if key not in own})
