"""Compilation of the hot loops, and of functions of arrays that they call on single numbers.

Compiled loops are kept on disk. Numba compiles a loop again where its own file has changed; here also where the file of
a compiled function has changed that its module imports, directly or not. Numbers from other files are not followed.
What compilation takes, once, is no cost of a result: `cpu_s` leaves it out, and a terminal is told when it begins.
Without numba the same loops run as they are written: axisymmetric touches some 20 times slower, others over 100 times.
"""

import functools
import hashlib
import inspect
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator
from types import FunctionType, ModuleType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchcal.lazy import install, installed

Result = TypeVar("Result")

_WITH_LOOPS: set[str] = set()  # Modules with functions that are compiled.
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
    module = module or function.__module__
    _register_where()
    _compilation()
    try:
        kernel = njit(cache=True)(function)
    except RuntimeError:
        return njit(function)
    _WITH_LOOPS.add(function.__module__)
    if hasattr(kernel, "_cache"):
        index = kernel._cache._cache_file  # pyright: ignore[reportAttributeAccessIssue]
        own = _source(module) if module != function.__module__ else ""
        index._source_stamp = (index._source_stamp, own + imported_sources(module))
    return kernel


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
        _WITH_LOOPS.add(function.__module__)
        register_jitable(function)
        named = [function.__globals__.get(name) for name in function.__code__.co_names]
        named += [cell.cell_contents for cell in function.__closure__ or ()]
        compilable(*(other for other in named if isinstance(other, FunctionType)))


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


def imported_sources(module: str) -> str:
    """SHA-256 of the files of compiled functions that a module, as far as it has been read, imports."""
    found, ahead = {module}, [module]
    while ahead:
        fresh = set(_imported(ahead.pop())) - found
        found |= fresh
        ahead += fresh
    return hashlib.sha256("\0".join(_source(name) for name in sorted(found - {module})).encode()).hexdigest()


def _imported(module: str) -> Iterator[str]:
    for value in list(vars(sys.modules[module]).values()):
        origin = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
        if origin in _WITH_LOOPS:
            yield origin


@functools.cache
def _source(module: str) -> str:
    try:
        return inspect.getsource(sys.modules[module])
    except OSError:  # what is typed has no file; numba then tells functions by their content
        return ""
