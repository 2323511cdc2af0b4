"""What every command line here shares: exit status, plain errors, progress, one JSON object."""

from __future__ import annotations

import importlib.metadata
import json
import os
import re
import select
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from touchcal.errors import NotConverged
from touchcal.lazy import missing, needed

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

BAD_INPUT, NOT_CONVERGED, READER_LEFT = 2, 3, 141

JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, max=2**63 - 1, help="Seed of all that is drawn.")]


def application(help_text: str) -> typer.Typer:
    """A Typer application with plain (unboxed) errors and help, and `--version`."""
    made = typer.Typer(help=help_text, no_args_is_help=True, pretty_exceptions_enable=False,
                       rich_markup_mode=None, add_completion=False)
    made.callback()(_options)
    return made


def _print_version(asked: bool) -> None:
    if asked:
        print(f"touchcal {importlib.metadata.version('touchcal')}")
        raise typer.Exit


def _options(version: Annotated[bool, typer.Option("--version", is_eager=True, callback=_print_version,
                                                   help="Print the version and exit.")] = False) -> None:
    """Options of a program itself."""


def run(app: typer.Typer, name: str, arguments_of: Mapping[str, str] = MappingProxyType({})) -> None:
    """Run `app`; exit 0 done, 2 bad usage or input, 3 not converged, 141 (no word) where a pipe's reader left.
    `--debug` anywhere shows the traceback. Errors name arguments in backticks, which are printed as the options of the
    commands: those of their names, and `arguments_of`, argument -> option."""
    if sys.stdout is None:
        print(f"{name}: standard output is closed. Open it, or send it to a file or /dev/null.", file=sys.stderr)
        sys.exit(BAD_INPUT)
    arguments = [a for a in sys.argv[1:] if a != "--debug"]
    debug = len(arguments) != len(sys.argv) - 1
    try:
        try:
            app(args=arguments, prog_name=name)
        except SystemExit as end:
            if isinstance(getattr(end.__context__, "__cause__", None), KeyboardInterrupt):
                print(f"{name}: stopped by Ctrl-C; files are written whole or not at all.", file=sys.stderr)
            if isinstance(end.__context__, BrokenPipeError):
                _end_of_pipe()
            raise
        finally:
            sys.stdout.flush()
    except (ValueError, OSError, NotConverged, ModuleNotFoundError) as error:
        if debug or (isinstance(error, ModuleNotFoundError) and missing(error) is error):
            raise
        if isinstance(error, BrokenPipeError) and _reader_left():
            _end_of_pipe()
        print(f"{name}: {_with_options(_sentence(error), app, arguments_of)}", file=sys.stderr)
        sys.exit(NOT_CONVERGED if isinstance(error, NotConverged) else BAD_INPUT)


def _with_options(text: str, app: typer.Typer, arguments_of: Mapping[str, str]) -> str:
    """A message with `argument` as the --option of a command that takes it."""
    from typer.main import get_command

    options = {**_options_of(get_command(app)), **arguments_of}
    return re.sub(r"`(\w+)`", lambda found: options.get(found[1].lower(), found[0]), text)


def _options_of(command: Any) -> dict[str, str]:
    """Parameter -> option, of a command and those below it."""
    below = [_options_of(each) for each in getattr(command, "commands", {}).values()]
    own = {str(param.name).lower(): option for param in command.params for option in param.opts
           if option.startswith("--")}
    return {name: option for options in (*below, own) for name, option in options.items()}


def _reader_left() -> bool:
    """Whether standard output is a pipe that nothing reads any more."""
    pipe = select.poll()
    pipe.register(1, 0)
    return any(event & select.POLLERR for _, event in pipe.poll(0))


def _end_of_pipe() -> NoReturn:
    """End as a program does that SIGPIPE stops; what is still buffered goes nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    sys.exit(READER_LEFT)


def _sentence(error: BaseException) -> str:
    if isinstance(error, ModuleNotFoundError):
        return str(missing(error))
    if isinstance(error, FileNotFoundError) and error.filename:
        return f"{error.filename}: no such file. Check the name and the folder."
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}."
    if isinstance(error, OSError) and error.strerror:
        return f"standard output cannot be written: {error.strerror}."
    return str(error)


def print_json(value: Any) -> None:
    """Print one JSON value, and nothing else, on standard output; NaN is refused, never written."""
    print(json.dumps(value, indent=1, default=_plain, allow_nan=False))


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{type(value).__name__} has no JSON form")


def numbers(text: str, flag: str, example: str) -> list[float]:
    """Numbers of a comma-separated command-line value; ValueError names the flag, the offending cell and an example."""
    out = []
    for cell in text.split(","):
        try:
            out.append(float(cell))
        except ValueError:
            raise ValueError(f"{flag}: '{cell}' is not a number. Give numbers separated by commas, "
                             f"for example {flag}={example}.") from None
    return out


def check_out(out: Path, flag: str = "--out", *, folder: bool = False) -> None:
    """Before any work: ValueError where a file (or `folder`) cannot be written at `out`, or what a PDF is drawn with is
    not installed; folders are never made above it."""
    for package in ("matplotlib", "typst", "pyarrow") if out.suffix == ".pdf" else ():
        needed(package, "reports")
    what = "folder" if folder else "file"
    if above := next((place for place in out.parents if place.is_file()), None):
        raise ValueError(f"{flag} {out}: {above} is a file, and nothing can be written below it. Choose another place.")
    if not out.parent.is_dir():
        raise ValueError(f"{flag} {out}: the folder {out.parent} does not exist. Create it first, or choose another.")
    if out.exists() and out.is_dir() != folder:
        raise ValueError(f"{flag} {out} is a {'file' if folder else 'folder'}, and a {what} is to be written there. "
                         "Choose another name.")
    if out.exists() and not (out.is_file() or out.is_dir()):
        raise ValueError(f"{flag} {out} is a pipe or a device, and a regular file is to be written. Choose another "
                         "name.")
    try:
        with tempfile.TemporaryFile(dir=out if folder and out.exists() else out.parent) as file:
            file.write(b"0")  # permissions alone do not say whether a file can be made in a folder
        if out.is_file():
            open(out, "ab").close()
    except OSError as error:
        raise ValueError(f"{flag} {out} cannot be written: {error.strerror}. Choose another place.") from None


def check_apart(outs: Mapping[str, Path | None], inputs: Iterable[Path]) -> None:
    """Before any work: ValueError where a file to be written (option -> place) is one that is read, or another one."""
    taken = {path.resolve(): f"{path} is read" for path in inputs}
    for flag, place in outs.items():
        if place is None:
            continue
        if place.resolve() in taken:
            raise ValueError(f"{flag} {place} would be overwritten: {taken[place.resolve()]}. Choose another name.")
        taken[place.resolve()] = f"{flag} {place} is written"


def foremost(cautions: Sequence[str], verbose: bool, most: int = 3) -> tuple[Sequence[str], str]:
    """The cautions that one screen has room for, the gravest first, all where verbose; and how many more there are, in
    words, empty where there are none.

    >>> foremost(["a", "b", "c", "d", "e"], False)
    (['a', 'b', 'c'], '2 more cautions')
    """
    left = 0 if verbose else max(len(cautions) - most, 0)
    return cautions[:len(cautions) - left], f"{left} more caution{'s' * (left != 1)}" if left else ""


def print_table(table: Table) -> None:
    """Print a table on standard output, wider than a narrow terminal or a pipe of 80 columns where its cells would be
    cut else."""
    from rich.console import Console
    from rich.measure import Measurement

    wide = Console(width=10_000)
    Console(width=max(Console().width, Measurement.get(wide, wide.options, table).maximum)).print(table)


@cache
def _terminal() -> Console:
    """Standard error, the same console for all, so that what is counted stands below what it is part of."""
    from rich.console import Console

    return Console(stderr=True)


@contextmanager
def waiting(words: str) -> Iterator[None]:
    """Shows on a terminal what is done meanwhile, and since when; silent in a pipe."""
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    with Progress(SpinnerColumn(), TextColumn(words), TimeElapsedColumn(), console=_terminal(),
                  disable=not _terminal().is_terminal, transient=True) as sign:
        sign.add_task(words, total=None)
        yield


@contextmanager
def counter(total: int, label: str) -> Iterator[Callable[..., None]]:
    """A function that takes the number done so far, and words on it if there are any, and shows them on a terminal with
    the time left; silent in a pipe."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn(label), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
               TextColumn("{task.fields[words]}"))
    with Progress(*columns, console=_terminal(), disable=not _terminal().is_terminal, transient=True) as bar:
        task = bar.add_task(label, total=total, words="")
        yield lambda done, words="": bar.update(task, completed=done, words=words)


def counted(label: str) -> Callable[[Iterable[Any]], Iterator[Any]]:
    """Goes through items and shows on a terminal how many are done."""
    def each(items: Iterable[Any]) -> Iterator[Any]:
        listed = list(items)
        with counter(len(listed), label) as advance:
            for done, item in enumerate(listed, start=1):
                yield item
                advance(done)

    return each
