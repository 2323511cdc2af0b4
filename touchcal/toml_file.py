"""Reading TOML files, with errors that name the file."""

import re
import tomllib
from pathlib import Path
from typing import Any

from touchcal.document import check_plain, read_text, reason, too_deep
from touchcal.errors import InputFileError

_DECIMAL_COMMA = re.compile(r"=[ \t]*[-+]?\d+,\d+[ \t]*(#.*)?$", re.MULTILINE)


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a TOML file; InputFileError where it is missing, not TOML, or what no TOML file of ours holds."""
    text = read_text(path)
    try:
        tables = tomllib.loads(text)
    except RecursionError:
        raise too_deep(path) from None
    except ValueError as error:
        fix = " Write numbers with a point, not a comma." if _DECIMAL_COMMA.search(text) else ""
        raise InputFileError(path, f"not TOML: {reason(error)}.{fix}") from None
    check_plain(path, tables)
    return tables
