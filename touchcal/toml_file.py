"""Reading TOML files, with errors that name the file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from touchcal.errors import InputFileError
from touchcal.input_file import read_text


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file; InputFileError where it is missing or not TOML."""
    try:
        return tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise InputFileError(path, f"not TOML: {error}.") from None
