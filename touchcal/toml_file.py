"""Reading TOML files, with errors that name the file."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from touchcal.errors import InputFileError


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file; InputFileError where it is missing or not TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputFileError(path, "no such file. Check the name and the folder.") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputFileError(path, f"not TOML: {error}.") from None
