"""Arrays on disk by the hash of what they were made from; safe where several processes make the same at once.

The folder is $TOUCHCAL_CACHE, else touchcal in $XDG_CACHE_HOME, else in ~/.cache.
"""

import contextlib
import fcntl
import functools
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchcal.array_store import read_npz
from touchcal.code_version import SOLVERS, code_hash, source_hash
from touchcal.errors import InputFileError
from touchcal.provenance import versions
from touchcal.whole_file import lock_file, written

Arrays = Mapping[str, NDArray[Any]]

LIMIT = 1_000_000_000  # Bytes that the folder may hold; the files that were longest not in use give way.
_KEY, _HASH = "key", "sha256"  # Members of a file that hold its own key, and the hash of it and of the arrays.


@dataclass(frozen=True)
class Entry:
    """One file of the cache."""

    path: Path
    size_bytes: int
    used_s: float  # when it was last read or written, s since 1970


def folder() -> Path:
    """Where the cache lies."""
    if named := os.environ.get("TOUCHCAL_CACHE"):
        return Path(named)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "touchcal"


def key_of(content: Mapping[str, Any], modules: tuple[str, ...] = SOLVERS) -> str:
    """SHA-256 of JSON content, of the code of these modules and of all that they import, and of the versions of the
    libraries beneath."""
    text = json.dumps({"content": content, "code": _code(modules), "versions": versions()}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


@functools.cache
def _code(modules: tuple[str, ...]) -> str:
    """code_hash, which takes a second, from the folder where these very files were hashed before."""
    place, name, sources = folder() / "code.json", " ".join(modules), source_hash()
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        return json.loads(place.read_text())[sources][name]
    found = code_hash(modules)
    with contextlib.suppress(OSError, ValueError, AttributeError):
        place.parent.mkdir(parents=True, exist_ok=True)
        known = json.loads(place.read_text()).get(sources, {}) if place.is_file() else {}
        fresh = place.with_name(f"{place.name}.{os.getpid()}")
        fresh.write_text(json.dumps({sources: known | {name: found}}))
        fresh.replace(place)
    return found


def kept(key: str, make: Callable[[], Arrays]) -> tuple[Arrays, str]:
    """The arrays of a key, read or else made and stored, and a note where the folder or what stood in it cannot be
    used. A second process that wants the same waits for the first. A file that is cut off, damaged, changed or of
    another key is made again."""
    place, note = folder() / f"{key}.npz", ""
    if (found := _read(place, key)) is not None:
        return found, ""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        lock = lock_file(place.with_suffix(".lock"))
    except OSError as error:
        return make(), f"not kept: {error.strerror} at {place.parent}. Set TOUCHCAL_CACHE to a folder of your own."
    with lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if (found := _read(place, key)) is not None:
            return found, ""
        if place.exists():
            note = f"computed again, since {place} was damaged, changed, or stored by an earlier version"
        arrays = make()
        try:
            _write(place, key, arrays)
        except OSError as error:
            return arrays, f"not kept: {error.strerror} at {place.parent}. Set TOUCHCAL_CACHE to a folder of your own."
    _trim(place)
    return arrays, note


def stored(key: str) -> Arrays | None:
    """The arrays of a key, None where they are not there."""
    return _read(folder() / f"{key}.npz", key)


def store(key: str, arrays: Arrays) -> None:
    """Keep the arrays of a key; OSError where the folder cannot be used."""
    folder().mkdir(parents=True, exist_ok=True)
    _write(folder() / f"{key}.npz", key, arrays)


def forget(key: str) -> None:
    """Remove the arrays of a key, if they are there."""
    (folder() / f"{key}.npz").unlink(missing_ok=True)


def _read(place: Path, key: str) -> Arrays | None:
    try:
        arrays = read_npz(place)
    except InputFileError:
        return None
    if str(arrays.pop(_KEY, "")) != key or str(arrays.pop(_HASH, "")) != _hash(key, arrays):
        return None
    with contextlib.suppress(OSError):
        os.utime(place)
    return arrays


def _write(place: Path, key: str, arrays: Arrays) -> None:
    with written(place) as file:
        np.savez(file, **{**arrays, _KEY: np.array(key),  # pyright: ignore[reportArgumentType]
                          _HASH: np.array(_hash(key, arrays))})


def _hash(key: str, arrays: Arrays) -> str:
    found = hashlib.sha256(key.encode())
    for name, array in sorted(arrays.items()):
        value = np.ascontiguousarray(array)
        found.update(f"{name} {value.dtype} {np.shape(array)}".encode() + value.tobytes())
    return found.hexdigest()


def entries() -> list[Entry]:
    """Files of the cache, the last used first."""
    found = []
    for path in folder().glob("*.npz"):
        with contextlib.suppress(FileNotFoundError):
            state = path.stat()
            found.append(Entry(path, state.st_size, state.st_mtime))
    return sorted(found, key=lambda entry: entry.used_s, reverse=True)


def _trim(newest: Path) -> None:
    for entry in _beyond_limit():
        if entry.path != newest:
            entry.path.unlink(missing_ok=True)


def _beyond_limit() -> Iterator[Entry]:
    total = 0
    for entry in entries():
        total += entry.size_bytes
        if total > LIMIT:
            yield entry


def clear() -> int:
    """Remove every file of the cache; returns how many."""
    found = entries()
    for entry in found:
        entry.path.unlink(missing_ok=True)
    return len(found)
