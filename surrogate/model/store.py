"""A model as a folder: model.json says what it is, arrays.npz holds its numbers; nothing in it is ever executed."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self

import numpy as np
import pandas as pd

from surrogate.recordings.suggestion.next_presses import SUGGESTED
from touchcal.array_store import Arrays, read_npz
from touchcal.arrays import Array
from touchcal.document import Keys, Number, check
from touchcal.errors import InputFileError
from touchcal.json_file import digest, file_digest, read_json, write_json
from touchcal.whole_file import written

SCHEMA = 15
RECORDED = ("presses", "sets")  # kinds of models that are learnt from a recording
DESCRIPTION, ARRAYS = "model.json", "arrays.npz"
EVALUATION, PREDICTIONS = "evaluation.json", "predictions.parquet"
# What ties both files: the key of model.json with the hash of arrays.npz, and the array with the hash of the other keys
# of model.json.
HASH = "arrays_sha256"
DESCRIBED = "description_sha256"
_HASHES = "sha256"  # key of evaluation.json: hashes of what was scored, of the predictions, and of its other keys
_RETRAIN = "A model is the folder that `surrogate train --out` writes; train it again."


class Stored(Protocol):
    """What a kind of model says of itself to be kept."""

    LEARNT_FROM: ClassVar[str]  # word in model.json
    SHAPE: ClassVar[Keys]  # what model.json holds

    @property
    def method(self) -> str: ...
    @property
    def seed(self) -> int: ...
    @property
    def fit_s(self) -> float: ...

    def described(self) -> dict[str, Any]:
        """What model.json says of this kind alone."""
        ...

    def arrays(self) -> Arrays:
        """What arrays.npz holds."""
        ...

    @classmethod
    def assembled(cls, text: Mapping[str, Any], arrays: Arrays) -> Self:
        """The inverse of both, tried out; an error of any kind where parts do not fit each other."""
        ...


def shape_of(needed: Mapping[str, Any], allowed: Mapping[str, Any] | None = None) -> Keys:
    """What model.json of a kind holds: these keys next to those of all kinds."""
    return Keys({HASH: str, "schema": Number(0, whole=True), "learnt_from": str, "method": str,
                 "seed": Number(0, whole=True), "fit_s": Number(0), **needed}, allowed or {})


def save(model: Stored, folder: Path) -> None:
    """Write a model; model.json comes last, so a folder that has it is whole, and scores of an earlier one go.
    InputFileError as check_own."""
    check_own(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DESCRIPTION).unlink(missing_ok=True)
    forget_scores(folder)
    text = {"schema": SCHEMA, "learnt_from": model.LEARNT_FROM, "method": model.method, "seed": model.seed,
            "fit_s": model.fit_s, **model.described()}
    with written(folder / ARRAYS) as file:
        np.savez_compressed(file, allow_pickle=False, **model.arrays(), **{DESCRIBED: np.array(digest(text))})
    write_json(text | {HASH: file_digest(folder / ARRAYS)}, folder / DESCRIPTION)


def check_own(folder: Path) -> None:
    """InputFileError where a folder holds something that is no model, which training into it would mix up with one."""
    if (folder / DESCRIPTION).exists():
        return
    own = (ARRAYS, EVALUATION, PREDICTIONS, SUGGESTED)
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


def read(folder: Path, kinds: Sequence[type[Stored]], methods: Sequence[str]) -> Any:
    """Read a model as what it is; InputFileError where the folder is none, of another schema, damaged or changed."""
    path = folder / DESCRIPTION
    if not path.exists():
        raise InputFileError(folder, f"not a model: it holds no {DESCRIPTION}. A model is the folder that "
                                     "`surrogate train` and `surrogate learn` write.")
    stored = read_json(path, "a model", _RETRAIN)
    text = _today(stored)
    kind = next((one for one in kinds if text.get("learnt_from") == one.LEARNT_FROM), None)
    if kind is None or text["schema"] != SCHEMA or text.get("method") not in [*methods]:
        raise InputFileError(path, f"model schema {stored.get('schema')!r}, method {stored.get('method')!r} is not one "
                                   f"that this version reads (schema {SCHEMA}; {', '.join(methods)}). Train it again.")
    try:
        check(text, kind.SHAPE)
    except ValueError as error:
        raise InputFileError(path, f"not a model: {error} {_RETRAIN}") from None
    try:
        arrays = read_npz(folder / ARRAYS)
        if text.pop(HASH) != file_digest(folder / ARRAYS):
            raise ValueError(f"{ARRAYS} was changed, or is of another model")
        if str(arrays.pop(DESCRIBED)) != digest({key: value for key, value in stored.items() if key != HASH}):
            raise ValueError(f"{DESCRIPTION} was changed")
        return kind.assembled(text, arrays)
    except (ArithmeticError, AssertionError, AttributeError, LookupError, MemoryError, RuntimeError, TypeError,
            ValueError) as error:
        raise InputFileError(folder, f"its {ARRAYS} and its {DESCRIPTION} do not belong together, or one is damaged "
                                     f"({error}). Train the model again.") from None


def of_recording(folder: Path) -> bool:
    """Whether a folder holds a model that was learnt from a recording, whole or not."""
    path = folder / DESCRIPTION
    return path.is_file() and _today(read_json(path, "a model", _RETRAIN)).get("learnt_from") in RECORDED


def _today(text: dict[str, Any]) -> dict[str, Any]:
    """What model.json of an earlier schema says in today's words, of today's schema where its arrays are today's."""
    match text.get("schema"), text.get("method"):
        case 4, "recording":
            return text | {"learnt_from": "presses", "method": "families"}
        case 13, method if method != "recording":
            return text | {"schema": SCHEMA, "learnt_from": "sweep"}
        case 14, method if method != "families":
            return text | {"schema": SCHEMA}
    return text if "learnt_from" in text and "schema" in text else {"schema": None}
