"""Dataclasses of arrays as plain arrays with dotted names, and back; and what identifies their content."""

from __future__ import annotations

import dataclasses
import hashlib
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[Any]]


def flat(value: Any, name: str) -> Iterator[tuple[str, NDArray[Any]]]:
    """Arrays of a dataclass of arrays, numbers, words, dataclasses and tuples of dataclasses, by dotted names."""
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
    if isinstance(kind, type) and dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        return kind(**{field.name: rebuilt(hints[field.name], f"{name}.{field.name}", arrays)
                       for field in dataclasses.fields(kind)})
    if typing.get_origin(kind) is tuple:
        item = typing.get_args(kind)[0]
        return tuple(rebuilt(item, f"{name}.{i}", arrays) for i in range(int(arrays[f"{name}.count"])))
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
