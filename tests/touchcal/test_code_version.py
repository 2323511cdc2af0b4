"""The hash of the code follows what decides numbers, through all imports, and not where or under which layout it
stands."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

import pytest

from touchcal import code_version
from touchcal.code_version import MECHANICS, ROOT, SOLVERS, _code, _reached, code_hash, script_hash, source_hash


def modules_needed(modules: Iterable[str]) -> set[str]:
    """Names of `modules` and of those that hold a definition which they need, directly or not."""
    return {module for module, _ in _reached(_code(ROOT), modules)}


def test_solvers_count_and_what_describes_rows_does_not() -> None:
    found = modules_needed(SOLVERS)
    assert found > {"eitsim.simulation.simulate", "eitsim.electrics.mesh.symmetric_mesh",
                    "touchcal.parallel.checkpoint", "eitsim.electrics.forward.solve_forward",
                    "eitsim.mechanics.load_paths.rim_table", "touchcal.cache",
                    "eitsim.sweeps.design.card_draws", "eitsim.sweeps.design.design", "matcal.laws.hyperfoam",
                    "matcal.posterior.draws"}
    describing = {"cli.main", "cli.sweep_commands", "cli.display", "cli.progress", "sweeps.run.account",
                  "sweeps.run.sweep", "sweeps.run.omissions", "sweeps.sobol.sobol_indices",
                  "sweeps.sobol.sobol_summary", "sweeps.run.measure", "sweeps.measurement.noise_summary"}
    assert all((ROOT / "eitsim" / f"{name.replace('.', '/')}.py").is_file() for name in describing)
    assert not found & {f"eitsim.{name}" for name in describing}
    assert "eitsim.sweeps.run.measure" in modules_needed(["eitsim.sweeps.run.measure"])


# Two packages: rows imports its law, its mesh in a function, and the foam through its law; account imports rows.
CODE = {"eitsim/rows.py": "from eitsim.law import (\n    stress,\n)\ndef solve():\n    from eitsim import mesh\n"
                          "    return stress(mesh.SIZE)\n",
        "eitsim/law.py": "import matcal.foam\ndef stress(x):\n    return matcal.foam.scale(x)\n"
                         "def unused():\n    pass\n",
        "eitsim/mesh.py": "import numpy as np\nSIZE = 2\n", "matcal/foam.py": "def scale(x):\n    return 2 * x\n",
        "eitsim/account.py": "from eitsim.rows import solve\ndef told():\n    return solve()\n"}
MOVED = {"eitsim/rows.py": None, "eitsim/mesh.py": None, "eitsim/law.py": None,
         "eitsim/run/rows.py": "from eitsim.mechanics import law as the_law\ndef solve():\n    '''Solve.'''\n"
                               "    return the_law.stress(the_law.SIZE)  # a comment\n",
         "eitsim/mechanics/law.py": "import numpy as np\nfrom matcal.foam import scale as by\nSIZE = 2\ndef unused():\n"
                                    "    pass\ndef stress(x):\n    return by(x)\n",
         "eitsim/account.py": "from eitsim.run.rows import solve\ndef told():\n    return solve()\n"}


def written(root: Path, files: dict[str, str | None]) -> Path:
    for name, source in files.items():
        if source is not None:
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(source)
    return root


def hash_of(root: Path, files: dict[str, str | None], module: str = "eitsim.rows") -> str:
    return code_hash((module,), written(root, files))


def test_modules_that_count_are_there() -> None:
    assert [name for name in (*SOLVERS, *MECHANICS) if not (ROOT / f"{name.replace('.', '/')}.py").is_file()] == []


@pytest.mark.parametrize(("changed", "old", "new", "counts"), [
    ("eitsim/rows.py", "mesh.SIZE", "2 * mesh.SIZE", True), ("eitsim/law.py", "scale(x)", "scale(-x)", True),
    ("eitsim/mesh.py", "SIZE = 2", "SIZE = 3", True), ("matcal/foam.py", "2 * x", "3 * x", True),
    ("matcal/foam.py", "2 * x", "x.twice", True), ("eitsim/law.py", "pass", "return 1", False),
    ("eitsim/law.py", "import matcal", "print(1)\nimport matcal", True),
    ("eitsim/mesh.py", "SIZE = 2", "'''A mesh.'''\nSIZE = (2)  # mm", False),
    ("eitsim/account.py", "solve()", "2 * solve()", False)])
def test_the_hash_changes_with_what_is_needed(tmp_path: Path, changed: str, old: str, new: str, counts: bool) -> None:
    before = hash_of(tmp_path / "before", dict(CODE))
    assert hash_of(tmp_path / "same", dict(CODE)) == before
    after = hash_of(tmp_path / "after", CODE | {changed: CODE[changed].replace(old, new)})
    assert (after != before) == counts


def test_moved_and_merged_modules_have_the_hash_they_had(tmp_path: Path) -> None:
    law = CODE["eitsim/law.py"].replace("import matcal.foam", "from matcal.foam import scale")
    plain = CODE | {"eitsim/law.py": law.replace("matcal.foam.scale", "scale")}
    assert hash_of(tmp_path / "moved", CODE | MOVED, "eitsim.run.rows") == hash_of(tmp_path / "here", dict(plain))


def test_code_of_the_same_numbers_keeps_the_earlier_hash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = source_hash()
    here, other = (hash_of(tmp_path / name, CODE | {"matcal/foam.py": f"def scale(x):\n    return {name}\n"})
                   for name in ("x", "y"))
    monkeypatch.setattr(code_version, "SAME_NUMBERS", tmp_path / "same.json")
    (tmp_path / "same.json").write_text(json.dumps({here: "earlier"}))
    code_hash.cache_clear()
    assert [code_hash(("eitsim.rows",), tmp_path / name) for name in ("x", "y")] == ["earlier", other]
    assert source_hash() != before


def test_a_name_that_a_package_hands_on_is_followed(tmp_path: Path) -> None:
    caller = {"surrogate/train.py": "import matcal\ndef fit():\n    return matcal.scale(1)\n"}
    handed = {"matcal/__init__.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n"
                                     "    from matcal.foam import scale\n"}
    found = [hash_of(tmp_path / str(k), caller | handed | {"matcal/foam.py": f"def scale(x):\n    return {k} * x\n"},
                     "surrogate.train") for k in (2, 3)]
    assert found[0] != found[1]


@pytest.mark.parametrize(("name", "text", "changes"), [
    ("eitsim/law.py", '"""Another docstring."""\nTWO = 2  # a comment\n', False),
    ("eitsim/law.py", '"""A law."""\nTWO = 3\n', True), ("benchmarks/cases.py", "CASES = (2,)\n", True),
    ("benchmarks/conditions.py", "def quick():\n    pass\n", False)])
def test_the_hash_of_a_benchmark_is_that_of_what_it_measures(tmp_path: Path, name: str, text: str,
                                                             changes: bool) -> None:
    files = {"eitsim/law.py": '"""A law."""\nTWO = 2\n', "benchmarks/cases.py": "CASES = (1,)\n",
             "benchmarks/conditions.py": "",
             "benchmarks/bench.py": "from eitsim import law\nfrom cases import CASES\nfrom conditions import quick\n"
                                    "print(law.TWO, CASES, quick)\n"}
    found = [script_hash(written(tmp_path / str(k), given) / "benchmarks" / "bench.py", tmp_path / str(k))
             for k, given in enumerate((files, files | {name: text}))]
    assert (found[0] != found[1]) == changes
