"""The staircase of imports: a module imports only from packages below its own."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
STAIRS = ("touchcal", "matcal", "eitsim", "surrogate", "reports")
DRAWING = {"matplotlib", "typst", "corner"}


def modules() -> list[Path]:
    return [path for package in STAIRS for path in sorted((ROOT / package).rglob("*.py"))]


def imported(path: Path) -> set[str]:
    """Top-level names of everything that a module imports, inside functions too; relative imports are refused."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            names.add((node.module or "").split(".")[0])
    return names


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_go_downstairs(path: Path) -> None:
    package = path.relative_to(ROOT).parts[0]
    if path.name.endswith("cli.py") or path.name == "__main__.py":
        return
    above = set(STAIRS[STAIRS.index(package) + 1:])
    assert not imported(path) & above
    if package != "reports":
        assert not imported(path) & DRAWING


def test_command_lines_do_not_draw() -> None:
    for path in ROOT.glob("*/*cli.py"):
        assert not imported(path) & DRAWING


def test_packages_are_docstrings() -> None:
    for package in STAIRS:
        body = ast.parse((ROOT / package / "__init__.py").read_text(encoding="utf-8")).body
        assert len(body) == 1
        assert isinstance(body[0], ast.Expr)


def test_reading_a_card_is_light() -> None:
    code = "import sys, matcal.card; print(*sorted(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    heavy = {"emcee", "torch", "skfem", "matplotlib", "scipy", "pandas", "numba", "arviz", "lmfit"}
    assert not heavy & set(loaded.split())


def test_no_module_is_named_after_nothing() -> None:
    assert not [p for p in modules() if p.stem in {"utils", "util", "helpers", "helper", "common", "misc", "manager"}]
