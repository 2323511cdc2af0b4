"""Values made of arrays, numbers, words, None, lists, tuples and this package's dataclasses, as arrays alone: who reads
them from a folder that others write to runs nothing of theirs, as with pickles. And npz files, read with care."""

import dataclasses
import hashlib
import importlib
import json
import types
import typing
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchcal.errors import InputFileError
from touchcal.input_file import check_unpacked, regular

# Name of the array that holds how the others make the value.
_TREE = "tree"
Arrays = Mapping[str, NDArray[Any]]


def read_npz(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an npz file; InputFileError where it is none or damaged, or would unpack to far more than it is."""
    try:
        with zipfile.ZipFile(regular(path)) as archive:
            check_unpacked(path, sum(member.file_size for member in archive.infolist()))
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except InputFileError:
        raise
    except (OSError, ValueError, EOFError, KeyError, MemoryError, NotImplementedError, RuntimeError,
            zipfile.BadZipFile, zlib.error) as error:
        why = type(error).__name__ if "pickle" in str(error) else error
        raise InputFileError(path, f"no npz file of arrays, or a damaged one ({why}).") from None


def to_arrays(value: Any) -> dict[str, NDArray[Any]]:
    """Arrays from which `from_arrays` makes the value again, bit for bit; TypeError for what is none of the above."""
    arrays: dict[str, NDArray[Any]] = {}
    return {_TREE: np.array(json.dumps(_tree(value, arrays))), **arrays}


def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> Any:
    """The value that `to_arrays` made arrays of."""
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
    if dataclasses.is_dataclass(value) and _own(type(value).__module__):
        parts = {one.name: _tree(getattr(value, one.name), arrays) for one in dataclasses.fields(value)}
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
    if not isinstance(found, type) or not dataclasses.is_dataclass(found):
        raise TypeError(f"{module}.{name} is no dataclass of this package.")
    return found


def _own(module: str) -> bool:
    return module.split(".")[0] in ("eitsim", "matcal")


def flat(value: Any, name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays of a dataclass of arrays, numbers, words, dataclasses, None and tuples of these, by dotted names."""
    if value is None:
        return
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from flat(getattr(value, field.name), f"{name}.{field.name}")
    elif isinstance(value, tuple):
        yield f"{name}.count", np.array(len(value))
        for i, item in enumerate(value):
            yield from flat(item, f"{name}.{i}")
    else:
        yield name, np.asarray(value)


def rebuilt(kind: Any, name: str, arrays: Arrays) -> Any:
    """The inverse of flat for a field of this type."""
    if isinstance(kind, types.UnionType):
        (there,) = (one for one in typing.get_args(kind) if one is not type(None))
        return rebuilt(there, name, arrays) if any(f"{one}.".startswith(f"{name}.") for one in arrays) else None
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        return kind(**{field.name: rebuilt(hints[field.name], f"{name}.{field.name}", arrays)
                       for field in dataclasses.fields(kind)})
    if typing.get_origin(kind) is tuple:
        item = typing.get_args(kind)[0]
        return tuple(rebuilt(item, f"{name}.{i}", arrays) for i in range(int(arrays.get(f"{name}.count", 0))))
    if isinstance(kind, types.GenericAlias) or typing.get_origin(kind) is np.ndarray:
        return arrays[name]
    return kind(arrays[name].item())


def fingerprint(*values: Any) -> str:
    """SHA-256 of the names, types, shapes and numbers of dataclasses of arrays."""
    found = hashlib.sha256()
    for k, value in enumerate(values):
        for name, array in flat(value, str(k)):
            found.update(f"{name} {array.dtype} {array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    return found.hexdigest()
