"""A model as a folder: model.json says what it is, arrays.npz holds its numbers; nothing in it is ever executed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from surrogate.data import outputs
from surrogate.data.sensor_ring import Ring
from surrogate.learners.registry import METHODS
from surrogate.model.holding_time import holding_caution
from surrogate.model.trained import Calibration, Range, Rows, TrainedModel, estimate
from surrogate.recordings.trained.reader_store import METHOD as RECORDING
from touchcal.array_store import Arrays, flat, read_npz, rebuilt
from touchcal.arrays import Array
from touchcal.document import Keys, Number, check
from touchcal.errors import InputFileError
from touchcal.json_file import digest, file_digest, read_json, write_json
from touchcal.whole_file import written

SCHEMA = 13
DESCRIPTION, ARRAYS = "model.json", "arrays.npz"
EVALUATION, PREDICTIONS = "evaluation.json", "predictions.parquet"
# What ties both files: the key of model.json with the hash of arrays.npz, and the array with the hash of the other keys
# of model.json.
HASH = "arrays_sha256"
DESCRIBED = "description_sha256"
_HASHES = "sha256"  # key of evaluation.json: hashes of what was scored, of the predictions, and of its other keys
_RETRAIN = "A model is the folder that `surrogate train --out` writes; train it again."
_COUNT = Number(0, 1e15, whole=True)
_ROWS = Keys(allowed={"rows": _COUNT, "cards": _COUNT, "measurement": dict, "split": {str: _COUNT}})
_SHAPE = Keys({HASH: str, "outputs": [Keys({"name": str})], "seed": Number(0, whole=True), "fit_s": Number(0),
               "dataset": _ROWS, "training": dict}, {"calibration": _ROWS, "relaxation": dict, "versions": {str: str}})
M = TypeVar("M", bound=TrainedModel)


def save(model: TrainedModel, folder: Path) -> None:
    """Write a model; model.json comes last, so a folder that has it is whole, and scores of an earlier one go.
    InputFileError as check_own."""
    check_own(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DESCRIPTION).unlink(missing_ok=True)
    forget_scores(folder)
    parts = {"ring": model.ring, "learner": model.learner, "calibration": model.calibration, "rows": model.rows,
             "trained": model.trained}
    arrays = {key: value for name, part in parts.items() for key, value in flat(part, name)}
    text = {"schema": SCHEMA, "method": model.method,
            "outputs": [{"name": n, "unit": u} for n, u in zip(model.names, model.units, strict=True)],
            "seed": model.seed, "fit_s": model.fit_s, **model.record}
    with written(folder / ARRAYS) as file:
        np.savez_compressed(file, allow_pickle=False, baseline_V=model.baseline_V,
                            **arrays, **{DESCRIBED: np.array(digest(text))})
    write_json(text | {HASH: file_digest(folder / ARRAYS)}, folder / DESCRIPTION)


def check_own(folder: Path, further: Sequence[str] = ()) -> None:
    """InputFileError where a folder holds something that is no model, which training into it would mix up with one.
    further: names of files that may be there."""
    if (folder / DESCRIPTION).exists():
        return
    own = (ARRAYS, EVALUATION, PREDICTIONS, *further)
    for path in sorted(folder.iterdir()) if folder.exists() else []:
        if not path.name.startswith(".") and path.name not in own:
            raise InputFileError(folder, f"it holds {path.name} and no model. Choose an empty folder for the model.")


def forget_scores(folder: Path) -> None:
    """Delete the scores of an earlier model, and the predictions behind them."""
    for name in (EVALUATION, PREDICTIONS):
        (folder / name).unlink(missing_ok=True)


def save_evaluation(folder: Path, scores: Mapping[str, Any], predictions: pd.DataFrame) -> None:
    """Write scores and the predictions behind them into a model's folder, for reports."""
    with written(folder / PREDICTIONS) as file:
        predictions.to_parquet(file, index=False)
    write_json({**scores, _HASHES: _scored_hashes(folder, scores)}, folder / EVALUATION)


def read_evaluation(folder: Path) -> tuple[dict[str, Any], dict[str, Any], pd.DataFrame]:
    """Description, scores and predictions in a model's folder; InputFileError where one is missing or was changed."""
    for name in (DESCRIPTION, EVALUATION, PREDICTIONS):
        if not (folder / name).is_file():
            raise InputFileError(folder, f"it holds no {name}. {_RETRAIN}")
    scores = read_json(folder / EVALUATION, "scores of a model", _RETRAIN, Keys({_HASHES: {str: str}}))
    stated = scores.pop(_HASHES)
    for name, found in _scored_hashes(folder, scores).items():
        if stated.get(name) != found:
            raise InputFileError(folder / name, f"it was changed after the model was scored. {_RETRAIN}")
    return read_json(folder / DESCRIPTION, "a model", _RETRAIN), scores, pd.read_parquet(folder / PREDICTIONS)


def _scored_hashes(folder: Path, scores: Mapping[str, Any]) -> dict[str, str]:
    return {name: file_digest(folder / name) for name in (DESCRIPTION, PREDICTIONS)} | {EVALUATION: digest(scores)}


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
    if text.get("method") == RECORDING:
        raise InputFileError(folder, "a model of a recording: read it with `surrogate predict`, or in Python with "
                                     "surrogate.load_reader; `surrogate report` has its scores.")
    if text.get("schema") != SCHEMA or text.get("method") not in [*METHODS]:
        raise InputFileError(path, f"model schema {text.get('schema')!r}, method {text.get('method')!r} is not one "
                                   f"that this version reads (schema {SCHEMA}; {', '.join(METHODS)}). Train it again.")
    try:
        check(text, _SHAPE)
    except ValueError as error:
        raise InputFileError(path, f"not a model: {error} {_RETRAIN}") from None
    try:
        stated, arrays = text.pop(HASH), read_npz(folder / ARRAYS)
        if stated != file_digest(folder / ARRAYS):
            raise ValueError(f"{ARRAYS} was changed, or is of another model")
        if str(arrays.pop(DESCRIBED)) != digest(text):
            raise ValueError(f"{DESCRIPTION} was changed")
        model = _assemble(kind, text, arrays)
        _try_out(model)
        return model
    except (ArithmeticError, AssertionError, AttributeError, LookupError, MemoryError, RuntimeError, TypeError,
            ValueError) as error:
        raise InputFileError(folder, f"its {ARRAYS} and its {DESCRIPTION} do not belong together, or one is damaged "
                                     f"({error}). Train the model again.") from None


def _assemble(kind: type[M], text: dict[str, Any], arrays: Arrays) -> M:
    own = ("schema", "method", "outputs", "seed", "fit_s")
    names = tuple(output["name"] for output in text["outputs"])
    if not names or names != outputs.chosen(names):
        raise ValueError(f"its outputs {', '.join(names)} are not some of {', '.join(outputs.NAMES)}, in that order")
    return kind(text["method"], rebuilt(Ring, "ring", arrays), names,
                 rebuilt(METHODS[text["method"]].learner(), "learner", arrays),
                 rebuilt(Calibration, "calibration", arrays), rebuilt(Rows, "rows", arrays),
                 rebuilt(Range, "trained", arrays), arrays["baseline_V"], text["seed"], text["fit_s"],
                 {key: value for key, value in text.items() if key not in own})


def _try_out(model: TrainedModel) -> None:
    """An error of any kind where the parts of a model do not fit each other: their shapes are checked, and one of its
    calibrating rows is read."""
    ring, rows, span = model.ring, model.calibration, model.trained
    readings, each, count = ring.read.shape, (len(model.names),), len(rows.target)
    for name, part, shape in (("baseline_V", model.baseline_V, readings),
                              ("signals", rows.signal_V, (max(count, 1), *readings)),
                              ("targets", rows.target, (max(count, 1), *each)),
                              ("lowest", span.lowest, each), ("highest", span.highest, each),
                              ("weakest", np.array(span.weakest_V), ()), ("misfit", np.array(span.misfit), ())):
        if part.shape != shape or part.dtype.kind != "f" or not np.isfinite(part).all():
            raise ValueError(f"{name} holds {part.dtype} {part.shape} and not finite numbers {shape}")
    for ends in (ring.source, ring.sink, ring.read, ring.ground):
        if ends.shape != readings or ends.dtype.kind != "i" or not np.isin(ends, np.arange(len(ring.angle_rad))).all():
            raise ValueError("its readings are not of its electrodes")
    with np.errstate(all="ignore"):
        found = estimate(model, rows.signal_V[:1])
    if {part.shape for part in (found.value, found.sd, found.below, found.above)} != {(1, *each)}:
        raise ValueError("its learner has other outputs")
    holding_caution(model, None)
