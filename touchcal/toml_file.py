"""Reading TOML files, with errors that name the file."""

import tomllib
from pathlib import Path
from typing import Any

from touchcal.document import check_plain, read_text, reason, too_deep
from touchcal.errors import InputFileError


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file; InputFileError where it is missing, not TOML, or what no TOML file of ours holds."""
    try:
        tables = tomllib.loads(read_text(path))
    except InputFileError:
        raise
    except RecursionError:
        raise too_deep(path) from None
    except ValueError as error:
        raise InputFileError(path, f"not TOML: {reason(error)}.") from None
    check_plain(path, tables)
    return tables
