"""The hash of the code follows what decides numbers, through all imports, and nothing that only tells of them."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from eitsim.code_hash import PACKAGES, ROOT, SOLVERS, code_hash, imported, needed_by


def parsed(source: str) -> Iterator[str]:
    """What a module imports, by Python's own parser."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom):
            yield from (str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_imports_are_those_of_the_parser() -> None:
    for path in (path for package in PACKAGES for path in (ROOT / package).glob("*.py")):
        assert set(imported(path.read_text())) == set(parsed(path.read_text())), path


def test_solvers_count_and_what_tells_of_rows_does_not() -> None:
    found = needed_by(SOLVERS)
    assert found > {"eitsim.simulate", "eitsim.contact_line", "eitsim.electrics", "eitsim.rim_table", "eitsim.cache",
                    "eitsim.materials", "eitsim.design", "eitsim.pieces", "matcal.hyperfoam", "matcal.draws"}
    tells = {"cli", "sweep_cli", "report_cli", "display", "sweep_account", "sweep_progress", "sweep_runs",
             "sweep_omissions", "indices", "indices_account", "measured_set", "measurement_account"}
    assert not found & {f"eitsim.{name}" for name in tells}
    assert "eitsim.measured_set" in needed_by(["eitsim.measured_set"])


# Two packages: rows imports its law, its mesh in a function, and the foam through its law; account imports rows.
CODE = {"eitsim/rows.py": "from eitsim.law import (\n    stress,\n)\ndef solve():\n    from eitsim import mesh\n",
        "eitsim/law.py": "import matcal.foam\n", "eitsim/mesh.py": "import numpy as np\n", "matcal/foam.py": "",
        "eitsim/account.py": "from eitsim.rows import solve\n"}


def hash_of(root: Path, files: dict[str, str]) -> str:
    for name, source in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(source)
    return code_hash(("eitsim.rows",), root)


@pytest.mark.parametrize(("changed", "counts"), [
    ("eitsim/rows.py", True), ("eitsim/law.py", True), ("eitsim/mesh.py", True), ("matcal/foam.py", True),
    ("eitsim/account.py", False)])
def test_the_hash_changes_with_what_is_imported(tmp_path: Path, changed: str, counts: bool) -> None:
    before = hash_of(tmp_path / "before", CODE)
    assert hash_of(tmp_path / "same", CODE) == before
    after = hash_of(tmp_path / "after", CODE | {changed: CODE[changed] + "x = 1\n"})
    assert (after != before) == counts
