"""Hash of the code that decides numbers: a module and all that it imports, directly or not, of these packages."""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

PACKAGES = ("eitsim", "matcal")
# Folder that holds the packages.
ROOT = Path(__file__).parents[1]
# What solves the rows of a sweep, and what solves tables of load paths. What tells of rows is imported by neither.
SOLVERS = ("eitsim.solved_parts", "eitsim.sweep_table")
# An import, wherever it stands in a module; names may be modules too, in parentheses over several lines.
_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]*(?:\(([^)]*)\)|([^\n#]*))|import[ \t]+([\w.]+))",
                     re.MULTILINE)


@functools.cache
def code_hash(modules: tuple[str, ...] = SOLVERS, root: Path = ROOT) -> str:
    """SHA-256 of the files of `modules` and of all that they import, as they are when this process first asks."""
    found = hashlib.sha256()
    for name, content in sorted(_sources(modules, root).items()):
        found.update(name.encode() + b"\0" + content)
    return found.hexdigest()


def needed_by(modules: Iterable[str], root: Path = ROOT) -> set[str]:
    """Names of `modules` and of all that they import, directly or not, inside functions too."""
    return set(_sources(modules, root))


def _sources(modules: Iterable[str], root: Path) -> dict[str, bytes]:
    found: dict[str, bytes] = {}
    ahead = list(modules)
    while ahead:
        name = ahead.pop()
        if name in found or name.split(".")[0] not in PACKAGES:
            continue
        path = root.joinpath(*name.split(".")).with_suffix(".py")
        if path.is_file():
            found[name] = path.read_bytes()
            ahead += imported(found[name].decode())
    return found


def imported(source: str) -> Iterator[str]:
    """Names of what a module imports, and of those from packages, as `package.name`."""
    for package, several, one, whole in _IMPORT.findall(source):
        yield package or whole
        yield from (f"{package}.{name.split()[0]}" for name in (several or one).split(",") if name.strip())
