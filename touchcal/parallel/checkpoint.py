"""A map whose answers are kept on disk one by one until all are there, so that a stopped sweep loses little."""

import contextlib
import hashlib
import pickle
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from touchcal import cache
from touchcal.array_store import from_arrays, to_arrays
from touchcal.parallel.pool import Failed, PoolUnavailable, WorkerPool, answers

_TRIES = 4  # Workers that may be lost on a piece.


class CheckpointedMap:
    """A map of a function over arguments by a pool, whose answers are kept on disk until `forget`."""

    def __init__(self, pool: WorkerPool) -> None:
        self._pool = pool
        self._keys: set[str] = set()

    def __call__(self, task: Callable[[Any], Any], arguments: Iterable[Any]) -> list[Any]:
        """task(argument) of each argument, in order; what the task raises, or PoolUnavailable where workers were
        lost on one again and again."""
        items = list(arguments)
        whole = pickle.dumps(task)
        keys = [_key(whole, item) for item in items]
        self._keys.update(keys)
        found = {i: value[0] for i, key in enumerate(keys) if (value := _kept(key)) is not None}
        missing = [(i, item) for i, item in enumerate(items) if i not in found]
        for (i, _), value in answers(self._pool, partial(_second, task), missing, _TRIES):
            if isinstance(value, Failed):
                if not value.lost:
                    raise value.error
                raise PoolUnavailable(
                    f"a piece of the table of load paths was given up after {_TRIES} tries: {value.reason}. What is "
                    "finished is kept, and the same command goes on from there; fewer workers leave each more memory.")
            found[i] = value
            with contextlib.suppress(OSError):  # table_for says so where nothing can be kept
                cache.store(keys[i], to_arrays(value))
        return [found[i] for i in range(len(items))]

    def forget(self) -> None:
        """Remove what was kept, since the whole is."""
        for key in self._keys:
            cache.forget(key)
        self._keys.clear()


def _key(task: bytes, item: Any) -> str:
    return cache.key_of({"task": hashlib.sha256(task).hexdigest(),
                         "item": hashlib.sha256(pickle.dumps(item)).hexdigest()})


def _kept(key: str) -> tuple[Any] | None:
    """The value in a tuple of its own, since a value may be None; None for a value whose class is no longer there."""
    try:
        return None if (arrays := cache.stored(key)) is None else (from_arrays(arrays),)
    except (TypeError, AttributeError, ImportError):
        return None


def _second(task: Callable[[Any], Any], pair: tuple[int, Any]) -> Any:
    return task(pair[1])
