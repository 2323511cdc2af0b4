"""Errors that reach a user, each saying what was wrong, where, and how to fix it."""

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any


def unknown_key(key: str, known: Iterable[str], table: str = "", what: str = "key") -> str:
    """Sentence on a key that is none of `known`, with the one that it may be a slip of; table: where it stands; what:
    what such a name is called there."""
    names = list(known)
    near = get_close_matches(key, names, 1)
    meant = f" Did you mean '{near[0]}'?" if near else ""
    return f"unknown {what} '{key}'{f' in [{table}]' if table else ''}; known: {', '.join(names)}.{meant}"


class InputFileError(ValueError):
    """A measurement file cannot be used; the message names the file, the line where known, and the fix."""

    __test__ = False  # pytest: not a test class

    def __init__(self, path: Path | str, problem: str, *, line: int | None = None) -> None:
        self.path, self.line, self.problem = Path(path), line, problem
        where = f"{path}, line {line}" if line is not None else f"{path}"
        super().__init__(f"{where}: {problem}")


class NotConverged(RuntimeError):
    """A solver or sampler stopped short; carries the best estimate it reached and how it got there."""

    def __init__(self, message: str, *, estimate: Any = None, residuals: tuple[float, ...] = (),
                 load_fraction: float | None = None) -> None:
        self.estimate, self.residuals, self.load_fraction = estimate, residuals, load_fraction
        super().__init__(message)
