"""Values made of arrays, numbers, words, None, lists, tuples and this package's dataclasses, as arrays alone: who reads
them from a folder that others write to runs nothing of theirs, as with pickles."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Name of the array that holds how the others make the value.
_TREE = "tree"


def arrays_of(value: Any) -> dict[str, NDArray[Any]]:
    """Arrays from which `value_of` makes the value again, bit for bit; TypeError for what is none of the above."""
    arrays: dict[str, NDArray[Any]] = {}
    return {_TREE: np.array(json.dumps(_tree(value, arrays))), **arrays}


def value_of(arrays: Mapping[str, NDArray[Any]]) -> Any:
    """The value that `arrays_of` made arrays of."""
    return _made(json.loads(str(arrays[_TREE])), arrays)


def _tree(value: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    if isinstance(value, np.ndarray | np.generic) and value.dtype != object:
        name = f"a{len(arrays)}"
        arrays[name] = np.asarray(value)
        return {"array": name, "number": isinstance(value, np.generic)}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list | tuple):
        return {type(value).__name__: [_tree(part, arrays) for part in value]}
    if is_dataclass(value) and _own(type(value).__module__):
        parts = {one.name: _tree(getattr(value, one.name), arrays) for one in fields(value)}
        return {"class": [type(value).__module__, type(value).__name__], "parts": parts}
    raise TypeError(f"{type(value).__name__} is not kept as arrays.")


def _made(tree: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        found = arrays[tree["array"]]
        return found[()] if tree["number"] else found
    if "class" in tree:
        return _class(*tree["class"])(**{name: _made(part, arrays) for name, part in tree["parts"].items()})
    ((kind, parts),) = tree.items()
    made = [_made(part, arrays) for part in parts]
    return tuple(made) if kind == "tuple" else made


def _class(module: str, name: str) -> type:
    found = getattr(importlib.import_module(module), name) if _own(module) else None
    if not isinstance(found, type) or not is_dataclass(found):
        raise TypeError(f"{module}.{name} is no dataclass of this package.")
    return found


def _own(module: str) -> bool:
    return module.split(".")[0] in ("eitsim", "matcal")
