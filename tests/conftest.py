"""What the tests of several packages share: a command line run in this process, without a second start of Python, and
benchmarks as modules."""

import gc
import importlib
from collections.abc import Callable
from pathlib import Path
from subprocess import CompletedProcess
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
Command = Callable[..., CompletedProcess[str]]


def pytest_collection_finish() -> None:
    """What is read by then lives to the end: the garbage collector, which figures call often, need not walk it again,
    and comes less often."""
    gc.collect()
    gc.freeze()
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
