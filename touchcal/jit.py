"""Compilation of the hot loops, and of functions of arrays that they call on single numbers.

Compiled loops are kept on disk. Numba compiles a loop again where its own file has changed; here also where the file of
a function has changed that it calls, directly or not. Numbers from other files are not followed.
What compilation takes, once, is no cost of a result: `cpu_s` leaves it out, and a terminal is told when it begins.
Without numba the same loops run as they are written: axisymmetric touches some 20 times slower, others over 100 times.
"""

import functools
import hashlib
import inspect
import multiprocessing
import sys
import time
from collections.abc import Callable
from types import FunctionType, ModuleType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchcal.lazy import install, installed

Result = TypeVar("Result")

_COMPILABLE: set[Callable[..., Any]] = set()
COMPILING = "compiling, once after an installation or a change of the code: some 10 CPU seconds"
UNCOMPILED = "numba is not installed, so that touches take 20 to over 100 times longer"


def where(condition: ArrayLike, yes: ArrayLike, no: ArrayLike) -> NDArray[np.float64]:
    """`yes` where the condition holds, else `no`: of arrays, and of numbers inside compiled loops."""
    if isinstance(condition, bool | np.bool_):
        return yes if condition else no  # pyright: ignore[reportReturnType]
    return np.where(condition, yes, no)


def compiled(function: Callable[..., Result], module: str = "") -> Callable[..., Result]:
    """Compile a loop over arrays; kept on disk where there is a place to write, else compiled by each process. `module`
    has the functions that a loop made anew for each such module calls: each is kept by itself."""
    if not compiles():
        return function
    from numba import njit

    if module:
        function.__qualname__ = f"{function.__name__}_{module.replace('.', '_')}"
    _register_where()
    _compilation()
    try:
        kernel = njit(cache=True)(function)
    except RuntimeError:
        return njit(function)
    if hasattr(kernel, "_cache"):
        _follow_calls(kernel._cache, function)  # pyright: ignore[reportAttributeAccessIssue]
    return kernel


def _follow_calls(cache: Any, function: Callable[..., Any]) -> None:
    """Let what is kept of a loop be good as long as all that it calls is as it was. That is looked up when it is first
    called, since by then all that it names is there."""
    index, load = cache._cache_file, cache.load_overload
    stamp = index._source_stamp

    def load_overload(*asked: Any) -> Any:
        index._source_stamp = (stamp, called_sources(function))
        return load(*asked)

    cache.load_overload = load_overload


def compilable(*functions: Callable[..., Any]) -> None:
    """Let compiled loops call functions of arrays, which stay as they are, on single numbers, with those that they
    call."""
    if not compiles():
        return
    from numba.extending import register_jitable

    for function in functions:
        if function in _COMPILABLE or function is where:
            continue
        _COMPILABLE.add(function)
        register_jitable(function)
        compilable(*(other for other in _named(function) if isinstance(other, FunctionType)))


def _named(function: FunctionType) -> list[Any]:
    """What a function's code names of its module, and of what it was made in."""
    return [*map(function.__globals__.get, function.__code__.co_names),
            *(cell.cell_contents for cell in function.__closure__ or ())]


def cpu_s() -> float:
    """CPU seconds of this process without those that compilation took."""
    return time.process_time() - compilation_s()


def compilation_s() -> float:
    """CPU seconds that compilation took in this process so far."""
    return _compilation().cpu_s if compiles() else 0.0


@functools.cache
def compiles() -> bool:
    """Whether numba is there; where it is not, standard error says so once."""
    if not (there := installed("numba")) and multiprocessing.parent_process() is None:
        print(f"{UNCOMPILED}; {install('numba')}", file=sys.stderr)
    return there


@functools.cache
def _compilation() -> Any:
    from numba.core import event

    class Compilation(event.Listener):
        """CPU seconds between the outermost beginnings and ends of compilation; loops compile those that they call."""

        def __init__(self) -> None:
            self.cpu_s, self._depth, self._begun = 0.0, 0, 0.0

        def on_start(self, event: Any) -> None:
            if self._depth == 0:
                self._begun = time.process_time()
                if self.cpu_s == 0 and sys.stderr.isatty() and multiprocessing.parent_process() is None:
                    print(COMPILING, file=sys.stderr)
            self._depth += 1

        def on_end(self, event: Any) -> None:
            self._depth -= 1
            if self._depth == 0:
                self.cpu_s += time.process_time() - self._begun

    listener = Compilation()
    event.register("numba:compile", listener)
    return listener


@functools.cache
def _register_where() -> None:
    from numba import types
    from numba.extending import overload

    @overload(where, strict=False)
    def _(condition: Any, yes: Any, no: Any) -> Callable[..., Any] | None:
        if isinstance(condition, types.Boolean):
            return lambda condition, yes, no: yes if condition else no
        return None


def called_sources(function: Callable[..., Any]) -> str:
    """SHA-256 of the files of all functions that one calls, directly or not, but for its own."""
    found, ahead = set(), [function]
    while ahead:
        one = ahead.pop()
        one = getattr(one, "py_func", one)
        if isinstance(one, FunctionType) and one not in found:
            found.add(one)
            named = _named(one)
            ahead += named + [vars(module).get(name) for module in named if isinstance(module, ModuleType)
                              for name in one.__code__.co_names]
    modules = sorted({one.__module__ for one in found} - {function.__module__})
    return hashlib.sha256("\0".join(map(_source, modules)).encode()).hexdigest()


@functools.cache
def _source(module: str) -> str:
    try:
        return inspect.getsource(sys.modules[module])
    except OSError:  # what is typed has no file; numba then tells functions by their content
        return ""
