"""Which code a benchmark measured: a hash of its statements and of all that it imports, so that old results show."""

from __future__ import annotations

import ast
import functools
import hashlib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
# what benchmarks measure
PACKAGES = ("matcal", "eitsim", "surrogate")
# modules beside a benchmark that tell of runs and decide no number
TELLERS = ("conditions",)
DIGITS = 12


def measured_code(benchmark: Path, root: Path = ROOT) -> str:
    """First hexadecimal digits of the SHA-256 of the statements of a benchmark and of every module that it imports,
    directly or not, inside functions too; comments, docstrings and layout do not count."""
    found: dict[str, str] = {}
    ahead = [benchmark]
    while ahead:
        path = ahead.pop()
        if str(path) in found:
            continue
        found[str(path)], names = _read(path)
        ahead += [module for name in names if (module := _module(name, benchmark.parent, root)) is not None]
    digest = hashlib.sha256()
    for _, statements in sorted(found.items(), key=lambda item: (Path(item[0]).name, item[1])):
        digest.update(statements.encode() + b"\0")
    return digest.hexdigest()[:DIGITS]


@functools.cache
def _read(path: Path) -> tuple[str, tuple[str, ...]]:
    """Statements of a module without its docstrings, and the names that it imports."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree), tuple(_imported(tree))


def _imported(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _module(name: str, beside: Path, root: Path) -> Path | None:
    """File of a module of the packages, or of one beside the benchmark; None for any other."""
    first, *rest = name.split(".")
    if first in PACKAGES:
        path = root.joinpath(first, *rest).with_suffix(".py") if rest else root / first / "__init__.py"
    else:
        path = beside / f"{first}.py"
    return path if path.is_file() and first not in TELLERS else None
