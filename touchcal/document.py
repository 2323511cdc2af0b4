"""What a document (JSON, TOML) may hold: text of a bounded size, plain values, and the shape that each part must have.

A shape is a type (`str`, `bool`, `dict`), None, a `Number`, a tuple of shapes (any of them), a list of one shape (a
list of any length) or of several (one value for each), a dictionary {str: shape} (any keys), or `Keys`.
"""

import math
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from touchcal.errors import InputFileError, unknown_key
from touchcal.input_file import regular

_MOST_BYTES = 64 * 2**20
# Levels of tables in tables, and the largest whole number (64 bits, as TOML has it).
_DEEPEST, _LARGEST = 32, 2**63
_NAMES = {str: "a text", bool: "true or false", dict: "an object of keys", None: "null"}


@dataclass(frozen=True)
class Number:
    """A finite number between two limits, both included."""

    least: float = -math.inf
    most: float = math.inf
    whole: bool = False

    def __str__(self) -> str:
        kind = "a whole number" if self.whole else "a finite number"
        low, high = (f"{end:,.0f}" if self.whole and math.isfinite(end) else f"{end:g}" for end in (self.least,
                                                                                                     self.most))
        if math.isinf(self.least) and math.isinf(self.most):
            return kind
        return f"{kind} from {low}" + (f" to {high}" if math.isfinite(self.most) else "")


@dataclass(frozen=True)
class Keys:
    """An object that must hold some keys and may hold others."""

    needed: Mapping[str, Any] = field(default_factory=dict)
    allowed: Mapping[str, Any] = field(default_factory=dict)
    further: bool = True  # whether it may hold keys that neither of them names


def is_number(value: Any) -> bool:
    """Whether a value is a finite number: no word, neither true nor false, no whole number too large for a float."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def check(value: Any, shape: Any, where: str = "") -> None:
    """ValueError that names the key whose value has not the shape that it must have; where: the keys that lead to it,
    none of a whole document."""
    if isinstance(shape, tuple):
        fitting = [one for one in shape if _of_kind(value, one)]
        if not fitting:
            raise _wrong(where, " or ".join(map(_words, shape)), value)
        shape = fitting[0]
    elif not _of_kind(value, shape):
        raise _wrong(where, _words(shape), value)
    if isinstance(shape, Keys):
        if missing := [key for key in shape.needed if key not in value]:
            raise ValueError(f"the key '{missing[0]}' is missing{where and f' in {where}'}.")
        known = {**shape.needed, **shape.allowed}
        for key, each in value.items():
            if key in known:
                check(each, known[key], f"{where}.{key}".lstrip("."))
            elif not shape.further:
                raise ValueError(unknown_key(key, known, where))
    elif isinstance(shape, dict):
        for key, each in value.items():
            check(each, shape[str], f"{where}.{key}".lstrip("."))
    elif isinstance(shape, list):
        for k, each in enumerate(value):
            check(each, shape[k] if len(shape) > 1 else shape[0], f"{where}[{k}]")


def check_keys(raw: Any, known: Collection[str], table: str = "") -> None:
    """ValueError where a table of a file, or the file, holds another key than those known, or is no table."""
    if not isinstance(raw, Mapping):
        raise ValueError(f"[{table}] must be a table of keys, got {raw!r:.80}.")
    if unknown := [key for key in raw if key not in known]:
        raise ValueError(unknown_key(unknown[0], known, table))


def _of_kind(value: Any, shape: Any) -> bool:
    """Whether a value fits the outermost part of a shape."""
    if isinstance(shape, Number):
        return is_number(value) and shape.least <= value <= shape.most and (not shape.whole or value == int(value))
    if isinstance(shape, list):
        return isinstance(value, list) and (len(shape) == 1 or len(value) == len(shape))
    return value is None if shape is None else isinstance(value, dict if isinstance(shape, Keys | dict) else shape)


def _words(shape: Any) -> str:
    if isinstance(shape, Number):
        return str(shape)
    if isinstance(shape, list):
        return "a list" if len(shape) == 1 else f"a list of {len(shape)} values"
    return _NAMES[dict if isinstance(shape, Keys | dict) else shape]


def _wrong(where: str, expected: str, value: Any) -> ValueError:
    return ValueError(f"{where or 'its content'} must be {expected}, got {value!r:.80}.")


def read_text(path: Path) -> str:
    """The text of a document, without a byte order mark; InputFileError where it is missing, too large or not UTF-8."""
    with regular(path).open("rb") as file:
        content = file.read(_MOST_BYTES + 1)
    if len(content) > _MOST_BYTES:
        raise InputFileError(path, f"larger than {_MOST_BYTES // 2**20} MB, which no such file is. Check the name.")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputFileError(path, f"not UTF-8 text: byte {content[error.start]:#04x} does not belong to it. Save it "
                                   "as UTF-8.", line=content.count(b"\n", 0, error.start) + 1) from None


def check_plain(path: Path, document: Any) -> None:
    """InputFileError where tables lie too deep in one another or a whole number is too large."""
    left: list[tuple[str, Any, int]] = [("", document, 0)]
    while left:
        where, value, depth = left.pop()
        if depth > _DEEPEST:
            raise too_deep(path)
        if isinstance(value, int) and abs(value) > _LARGEST:
            raise InputFileError(path, f"{where[1:]} is a whole number of {value.bit_length() * 0.30103:.0f} digits; "
                                       "at most 18 are read. Write it with a power of ten, as in 1.5e20.")
        if isinstance(value, dict):
            left += [(f"{where}.{key}", each, depth + 1) for key, each in value.items()]
        elif isinstance(value, list):
            left += [(f"{where}[{k}]", each, depth + 1) for k, each in enumerate(value)]


def reason(error: ValueError) -> str:
    """What a parser says of a text, without the advice that it has for programmers."""
    return str(error).split("; use sys.")[0].rstrip(".")


def too_deep(path: Path) -> InputFileError:
    """What a document says whose tables lie too deep in one another to be read."""
    return InputFileError(path, f"tables or lists lie in one another more than {_DEEPEST} deep, which no such file "
                                "has. Restore it from a copy, or make it again.")
