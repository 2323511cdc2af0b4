"""Mutation test of the numerical core: one wrong operator, constant or term at a time, and whether quick tests see it.

    python benchmarks/mutants.py [--count N | --total N] [--seed S] [--again] [MODULE or FOLDER ...]

Of each module, or of all of them together, N mutants are drawn at random, the same at one seed; each is run in a copy
of the tree until a test fails: of the quick ones that TESTS names, and in ROOMS of those that import the module; if
none sees it, of those that import a module that imports it. Left alone are texts, messages, types, counters of loops,
and tolerances. `--again` runs those that survived in the table. Writes results/mutants.csv: outcome `killed`,
`survived` or `timeout`, which counts as killed. A survivor may be equivalent: the mutant may change no number.
"""

import argparse
import ast
import functools
import importlib
import multiprocessing
import os
import random
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import pytest
from conditions import earlier, quick, shown, written

from touchcal.code_version import PACKAGES

ROOT = Path(__file__).parents[1]
# module, or folder of modules -> its quick tests, the likeliest to fail first
TESTS = {
    "matcal/laws": ["tests/matcal/laws"],
    "matcal/statistics": ["tests/matcal/statistics"],
    "matcal/fitting/uncertainty": [f"tests/matcal/fitting/test_{name}.py" for name in ("interval_formulas", "two_nu")],
    "matcal/fitting/relaxation": [f"tests/matcal/fitting/test_{name}.py" for name in (
        "relaxation_formulas", "relaxation_fit", "rates", "dynamic_and_creep")],
    **{f"matcal/reduction/{name}": [f"tests/matcal/reduction/test_{one}.py" for one in (
        "reduction_formulas", "known_answers", "geometry", "reductions", "settling", "protocols", "conductors")]
       for name in ("reduce.py", "load_frame.py", "specimen.py", "electric", "holds")},
    "eitsim/mechanics/solid": [f"tests/eitsim/mechanics/test_{name}.py" for name in (
        "grid", "solid", "spatial_response", "one_law", "volume", "curved_touches", "small_fillets")],
    "eitsim/mechanics/contact": [f"tests/eitsim/mechanics/test_{name}.py" for name in (
        "springs", "punch", "friction", "touch")],
    "eitsim/electrics/cem": [f"tests/eitsim/electrics/test_{name}.py" for name in (
        "multipole", "cem", "floating", "sensitivity", "rim", "uneven_sheet")],
    "eitsim/sheet": [f"tests/eitsim/electrics/test_{name}.py" for name in ("dipole", "skin")],
    "surrogate/statistics": ["tests/surrogate/statistics"],
    "surrogate/forward_map/multipole_series.py": ["tests/surrogate/forward_map/test_multipole.py"],
}
# rooms whose modules are tested by the files that import them
ROOMS = ("matcal/fitting/hyperfoam", "eitsim/electrics/forward", "eitsim/electrics/outline", "eitsim/electrics/curved",
         "eitsim/mechanics/axisymmetric", "eitsim/mechanics/harmonics", "eitsim/mechanics/rim",
         "eitsim/mechanics/load_paths", "eitsim/mechanics/general", "surrogate/model")
COPIED = ("touchcal", "matcal", "eitsim", "surrogate", "reports", "tests", "benchmarks", "examples", "data_raw",
          "docs", "pyproject.toml", "README.md")
OTHER = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
         ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
# what every run of tests would import again
LOADED = ("scipy.optimize", "scipy.linalg", "scipy.special", "scipy.interpolate", "scipy.sparse.linalg", "scipy.stats",
          "scipy.signal", "numba", "skfem", "lmfit")
# what is no mathematics, and keywords that are tolerances; numbers this small or large are tolerances or guards
SKIPPED = (ast.JoinedStr, ast.Raise, ast.Assert, ast.Slice, ast.arguments)
TOLERANCES = {"tol", "xtol", "ftol", "gtol", "rtol", "atol", "rcond", "maxiter", "max_nfev"}
SMALL, LARGE = 1e-4, 1e6
_FARTHER_S = 1800.0  # limit of a run of tests farther away


@dataclass(frozen=True)
class Mutant:
    """One change of one module."""

    module: str  # path below the root
    line: int
    mutation: str  # what became of it
    source: str  # the module with it


def places(node: ast.AST) -> Iterator[ast.AST]:
    """Expressions of the mathematics below a node, in the order of the text."""
    if isinstance(node, SKIPPED) or (isinstance(node, ast.keyword) and node.arg in TOLERANCES):
        return
    yield node
    for name, value in ast.iter_fields(node):
        if name not in ("annotation", "returns", "decorator_list", "slice"):
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from places(child)


def changes(node: ast.AST) -> Iterator[ast.expr]:
    """What a node may become."""
    if isinstance(node, ast.BinOp) and type(node.op) in OTHER:
        yield ast.BinOp(node.left, OTHER[type(node.op)](), node.right)
        if (left := _changed(node.left, node.op)) is not None:
            yield ast.BinOp(left, node.op, node.right)
        if not isinstance(node.op, ast.Pow) and (right := _changed(node.right, node.op)) is not None:
            yield ast.BinOp(node.left, node.op, right)
    elif isinstance(node, ast.Compare) and type(node.ops[0]) in OTHER:
        yield ast.Compare(node.left, [OTHER[type(node.ops[0])](), *node.ops[1:]], node.comparators)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        yield node.operand
    elif isinstance(node, ast.Constant) and isinstance(node.value, float) and SMALL < abs(node.value) < LARGE:
        yield ast.Constant(1.1 * node.value)
    elif isinstance(node, ast.Return) and isinstance(node.value, ast.BinOp) and type(node.value.op) in OTHER:
        yield node.value.left


def _changed(number: ast.expr, operation: ast.operator) -> ast.Constant | None:
    """Another whole number, for one that is an operand; None for what is none, and for a factor of 0, which stays."""
    factor = isinstance(operation, ast.Mult | ast.Div)
    if not isinstance(number, ast.Constant) or not isinstance(number.value, int) or (factor and not number.value):
        return None
    return ast.Constant(number.value * 1.1 if factor else number.value + 1)


def mutants(module: str) -> list[Mutant]:
    """All mutants of a module."""
    text = (ROOT / module).read_bytes()
    starts = [0, *(k + 1 for k, byte in enumerate(text) if byte == ord("\n"))]
    found = []
    for node in places(ast.parse(text)):
        for new in changes(node):
            old = node.value if isinstance(node, ast.Return) else node
            assert isinstance(old, ast.expr)
            assert old.end_lineno is not None
            assert old.end_col_offset is not None
            begin, end = starts[old.lineno - 1] + old.col_offset, starts[old.end_lineno - 1] + old.end_col_offset
            source = (text[:begin] + f"({ast.unparse(new)})".encode() + text[end:]).decode()
            found.append(Mutant(module, old.lineno, f"{ast.unparse(old)} -> {ast.unparse(new)}", source))
    return found


def importing(module: str) -> list[str]:
    """Files of tests that import a module by its name."""
    return _naming(module, test_files())


def farther(module: str, near: list[str]) -> list[str]:
    """Files of tests, but for those at these names, that import a module of the product's that imports this one."""
    found = sorted({name for user in _naming(module, product_files()) for name in _naming(user, test_files())})
    return [name for name in found if not any(name == one or name.startswith(f"{one}/") for one in near)]


def _naming(module: str, files: dict[str, str]) -> list[str]:
    """Of these files those that import a module by its name."""
    folder, _, name = module.removesuffix(".py").replace("/", ".").rpartition(".")
    words = (f"from {folder}.{name} import", f"from {folder} import {name}", f"{folder}.{name} as ")
    return [file for file, text in files.items() if any(word in text for word in words)]


@functools.cache
def product_files() -> dict[str, str]:
    """File of the packages -> its text."""
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
            for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))}


@functools.cache
def test_files() -> dict[str, str]:
    """Test file -> its text."""
    return {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
            for path in sorted((ROOT / "tests").rglob("test_*.py"))}


def modules(names: list[str]) -> dict[str, list[str]]:
    """Modules of the core at or below these names, all without a name -> their tests; of ROOMS those that have any."""
    found = {}
    for room in (*TESTS, *ROOMS):
        paths = [ROOT / room] if room.endswith(".py") else sorted((ROOT / room).rglob("*.py"))
        for module in (path.relative_to(ROOT).as_posix() for path in paths if path.name != "__init__.py"):
            if (not names or any(module.startswith(name.rstrip("/")) for name in names)) and (
                    tests := TESTS.get(room) or importing(module)):
                found[module] = tests
    if not found:
        raise SystemExit(f"no module of the core at {', '.join(names)}; known: {', '.join(TESTS)}.")
    return found


def tested(tree: Path, tests: list[str], limit_s: float) -> tuple[str, float]:
    """Outcome of the tests in a copy of the tree, by a copy of this process, and how long they took."""
    begun = time.perf_counter()
    run = multiprocessing.get_context("fork").Process(target=_run, args=(tree, tests))
    run.start()
    run.join(limit_s)
    if run.exitcode is None:
        run.kill()
        run.join()
        return "timeout", time.perf_counter() - begun
    return "killed" if run.exitcode else "survived", time.perf_counter() - begun


def _run(tree: Path, tests: list[str]) -> None:
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    os.chdir(tree)
    os.environ |= {"PYTHONPATH": str(tree), "TOUCHCAL_CACHE": str(tree / "cache")}
    sys.path.insert(0, str(tree))
    for name in [name for name in sys.modules if name.split(".")[0] in PACKAGES]:
        del sys.modules[name]
    sys.dont_write_bytecode = True
    os._exit(pytest.main(["-q", "-x", "-m", "not slow", "-p", "no:cacheprovider", *tests]))


def rows(tree: Path, chosen: dict[str, list[Mutant]], tests: dict[str, list[str]]) -> Iterator[dict[str, object]]:
    """One row a mutant, run in a copy of the tree whose tests pass without it; what tests farther away see counts only
    where they pass without it."""
    limits: dict[tuple[str, ...], float] = {}
    for module, some in chosen.items():
        key = tuple(tests[module])
        if key not in limits and some:
            outcome, seconds = tested(tree, tests[module], 600)
            if outcome != "survived":
                raise SystemExit(f"{' '.join(key)}: fail without a mutant ({outcome}). Repair them first.")
            limits[key] = 60 + 5 * seconds
        whole = (tree / module).read_text(encoding="utf-8")
        for mutant in some:
            (tree / module).write_text(mutant.source, encoding="utf-8")
            outcome, seconds = tested(tree, tests[module], limits[key])
            if outcome == "survived" and (more := farther(module, tests[module])):
                outcome, longer = tested(tree, more, _FARTHER_S)
                seconds += longer
                if outcome != "survived":
                    (tree / module).write_text(whole, encoding="utf-8")
                    outcome = outcome if tested(tree, more, _FARTHER_S)[0] == "survived" else "survived"
            print(f"{outcome:9}{seconds:6.1f} s  {module}:{mutant.line}  {mutant.mutation}", flush=True)
            yield {"module": module, "line": mutant.line, "mutation": mutant.mutation, "outcome": outcome,
                   "seconds": round(seconds, 1)}
        (tree / module).write_text(whole, encoding="utf-8")


def score(table: pd.DataFrame) -> pd.DataFrame:
    """Share of mutants that tests see, by room."""
    room = table["module"].str.rpartition("/")[0].rename("room")
    seen = (table["outcome"] != "survived").groupby(room).agg(["size", "sum"])
    seen.columns = ["mutants", "killed"]
    seen.loc["all"] = seen.sum()
    return seen.assign(score=seen["killed"] / seen["mutants"]).reset_index()


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("modules", nargs="*")
    asked.add_argument("--count", type=int, default=quick(12, 1))
    asked.add_argument("--total", type=int, default=0)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--again", action="store_true")
    given = asked.parse_args()
    tests, before = modules(given.modules), earlier("mutants")
    for library in LOADED:
        importlib.import_module(library)
    chosen = {}
    for module in tests:
        every = mutants(module)
        if given.again:
            left = before[(before["module"] == module) & (before["outcome"] == "survived")]
            again = set(zip(left["line"], left["mutation"], strict=True))
            chosen[module] = [m for m in every if (m.line, m.mutation) in again]
        else:
            chosen[module] = random.Random(f"{given.seed} {module}").sample(every, min(given.count, len(every)))
    if given.total:
        every = [mutant for module in tests for mutant in mutants(module)]
        drawn = random.Random(given.seed).sample(every, min(given.total, len(every)))
        chosen = {module: [m for m in drawn if m.module == module] for module in tests}
    with tempfile.TemporaryDirectory() as place:
        for name in COPIED:
            copied = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copied(ROOT / name, Path(place) / name)
        table = before
        for row in rows(Path(place), chosen, tests):
            if len(table):
                key = ["module", "line", "mutation"]
                table = table[(table[key] != [row[name] for name in key]).any(axis=1)]
            table = written(pd.concat([table, pd.DataFrame([row])], ignore_index=True), "mutants")
    shown(score(table))


if __name__ == "__main__":
    main()
