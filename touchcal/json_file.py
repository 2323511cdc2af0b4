"""JSON files, written in one step and read with errors that name the file."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from touchcal.document import check, check_plain, read_text, reason, too_deep
from touchcal.errors import InputFileError
from touchcal.whole_file import written


def write_json(value: Mapping[str, Any], path: Path | str) -> None:
    """Write JSON in one step; NaN is refused."""
    text = json.dumps(value, indent=1, allow_nan=False, default=_plain) + "\n"
    with written(Path(path)) as file:
        file.write(text.encode())


def read_json(path: Path, name: str, fix: str, shape: Any = dict) -> dict[str, Any]:
    """The object of a JSON file that is to be `name`; InputFileError, which ends with `fix`, where it is none or has
    not the shape."""
    try:
        value = json.loads(read_text(path), parse_constant=_refused, parse_float=_finite)
    except InputFileError:
        raise
    except RecursionError:
        raise too_deep(path) from None
    except json.JSONDecodeError as error:
        raise InputFileError(path, f"not JSON: {error.msg}. {fix}", line=error.lineno) from None
    except ValueError as error:
        raise InputFileError(path, f"not JSON: {reason(error)}. {fix}") from None
    check_plain(path, value)
    try:
        check(value, shape)
    except ValueError as error:
        raise InputFileError(path, f"not {name}: {error} {fix}") from None
    return value


def _finite(text: str) -> float:
    value = float(text)
    return value if np.isfinite(value) else _refused(text)


def _refused(text: str) -> NoReturn:
    raise ValueError(f"the number {text:.40} is not finite")


def digest(value: Mapping[str, Any]) -> str:
    """SHA-256 of a value as JSON, the same for what is written and for what is read again."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=_plain).encode()).hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of the bytes of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")
