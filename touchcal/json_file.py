"""JSON files: written in one step, read with errors that name the file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from touchcal.errors import InputFileError
from touchcal.input_file import read_text
from touchcal.whole_file import written


def write_json(value: Mapping[str, Any], path: Path | str) -> None:
    """Write JSON in one step; NaN is refused."""
    text = json.dumps(value, indent=1, allow_nan=False, default=_plain) + "\n"
    with written(Path(path)) as file:
        file.write(text.encode())


def read_json(path: Path, fix: str) -> dict[str, Any]:
    """The object of a JSON file; InputFileError where it holds none, with `fix` as its last sentence."""
    try:
        value = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InputFileError(path, f"not JSON: {error.msg}. {fix}", line=error.lineno) from None
    except InputFileError:
        raise
    except (ValueError, RecursionError):
        raise InputFileError(path, f"not JSON that can be read: a number of too many digits, or too deep. {fix}"
                             ) from None
    if not isinstance(value, dict):
        raise InputFileError(path, f"holds no JSON object. {fix}")
    return value


def digest(value: Mapping[str, Any]) -> str:
    """SHA-256 of a value as JSON, the same for what is written and for what is read again."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=_plain).encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")
