"""What the tests of several packages share: a command line run in this process, without a second start of Python, and
benchmarks as modules."""

import ast
import collections
import dataclasses
import functools
import gc
import importlib
import inspect
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess
from types import ModuleType
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
Command = Callable[..., CompletedProcess[str]]
# Shapes that dataclasses state in comments, `# (n, 3) ...` behind a field or above it, are checked as instances are
# made, the first so many of each class in a test: numbers, and names that come twice in an instance.
CHECKED, PACKAGES = 25, ("matcal", "eitsim", "surrogate", "touchcal", "reports")
_STATED = re.compile(r"#\s*\(([^()]*(?:\([^()]*\)[^()]*)*)\)")
_OR = re.compile(r"\bor \(([^()]*)\)")
_MADE_OF: collections.Counter[type] = collections.Counter()


@functools.cache
def stated_shapes(kind: type) -> dict[str, list[list[str]]]:
    """Field -> the dimensions that its comment states, and those behind an `or (`."""
    try:
        lines, found = textwrap.dedent(inspect.getsource(kind)).split("\n"), {}
    except OSError:  # typed in an example
        return {}
    for field in ast.parse("\n".join(lines)).body[0].body:  # pyright: ignore[reportAttributeAccessIssue]
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            first = last = field.lineno - 1
            while lines[first - 1].lstrip().startswith("#"):
                first -= 1
            above = "# " + " ".join(line.strip()[1:].strip() for line in lines[first:last])
            end = field.end_lineno or field.lineno
            for comment in (lines[end - 1][field.end_col_offset:].strip(), above):
                if stated := _STATED.match(comment):
                    ways = [stated[1], *_OR.findall(comment)]
                    found[field.target.id] = [[part.strip() for part in way.split(",") if part.strip()] for way in ways]
                    break
    return found


def check_shapes(made: Any) -> None:
    """AssertionError where an array of an instance has not the shape that its class states."""
    sizes: dict[str, int] = {}
    for name, ways in stated_shapes(type(made)).items():
        value = getattr(made, name, None)
        if isinstance(value, np.ndarray) and value.size:  # an empty one stands for none
            fit = [found for way in ways if (found := fitting(value.shape, way, sizes)) is not None]
            assert fit, f"{type(made).__name__}.{name}: {value.shape} is stated as {ways}, with {sizes}"
            sizes = fit[0]


def fitting(shape: tuple[int, ...], stated: list[str], sizes: dict[str, int]) -> dict[str, int] | None:
    """The sizes of names with those of a shape; None where it is not as stated."""
    dimensions = stated[1:] if stated[:1] == ["..."] else stated
    there = shape[len(shape) - len(dimensions):] if len(dimensions) < len(stated) else shape
    if len(there) != len(dimensions):
        return None
    known = dict(sizes)
    for size, dimension in zip(there, dimensions, strict=True):
        expected = int(dimension) if dimension.isdigit() else size
        if dimension.isidentifier():
            expected = known.setdefault(dimension, size)
        if size != expected:
            return None
    return known


def checking(make: Callable[..., Any]) -> Callable[..., Any]:
    """`dataclass`, of the packages' classes one whose instances are checked."""

    def checked(kind: type, **options: Any) -> type:
        made = make(kind, **options)
        if made.__module__.split(".")[0] not in PACKAGES or "__init__" not in vars(made):
            return made
        init = made.__init__

        @functools.wraps(init)
        def __init__(self: Any, *given: Any, **named: Any) -> None:
            init(self, *given, **named)
            if (before := _MADE_OF[type(self)]) < CHECKED:
                _MADE_OF[type(self)] = before + 1
                check_shapes(self)

        made.__init__ = __init__
        return made

    return lambda kind=None, /, **options: checked(kind, **options) if kind else lambda kind: checked(kind, **options)


dataclasses.dataclass = checking(dataclasses.dataclass)  # pyright: ignore[reportAttributeAccessIssue]


def pytest_runtest_setup() -> None:
    _MADE_OF.clear()


def pytest_collection() -> None:
    """What is read now lives to the end, so that no garbage is sought in it."""
    gc.disable()


def pytest_collection_finish() -> None:
    """The garbage collector, which figures call often, need not walk what was read, and comes less often."""
    gc.collect()
    gc.freeze()
    gc.enable()
    gc.set_threshold(20_000, 20, 20)


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """(program, words, folder) -> exit status, standard output and standard error of a command run in that folder.

    What main() does not turn into an exit status is raised here.
    """

    def run(program: str, *words: object, cwd: Path | None = None) -> CompletedProcess[str]:
        arguments = [program, *map(str, words)]
        with monkeypatch.context() as patch:
            patch.setattr("sys.argv", arguments)
            if cwd is not None:
                patch.chdir(cwd)
            capsys.readouterr()
            status = 0
            try:
                importlib.import_module(f"{program}.cli.main").main()
            except SystemExit as end:
                status = int(end.code or 0)
        out, err = capsys.readouterr()
        return CompletedProcess(arguments, status, out, err)

    return run


@pytest.fixture(scope="session")
def benchmark_module() -> Callable[[str], ModuleType]:
    """Name -> the benchmark of that name as a module."""

    def load(name: str) -> ModuleType:
        with pytest.MonkeyPatch.context() as patch:
            patch.syspath_prepend(BENCHMARKS)
            return importlib.import_module(name)

    return load
