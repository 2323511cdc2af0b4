"""JSON files, written in one step."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from touchcal.whole_file import written


def write_json(value: Mapping[str, Any], path: Path | str) -> None:
    """Write JSON in one step; NaN is refused."""
    text = json.dumps(value, indent=1, allow_nan=False, default=_plain) + "\n"
    with written(Path(path)) as file:
        file.write(text.encode())


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")
