"""The mutation test: mutants are one change each, of the mathematics alone, and the same at every run."""

import ast
import importlib
from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
SOURCE = '''"""Text 1.5 + 2."""
WIDTH, TINY = 2.5, 1e-9


def area(x: float, fine: float = 3.0) -> float:
    """Text 1.5 + 2."""
    if x < 0:
        raise ValueError(f"{x + 1} is negative: " + "give 2.0")
    return 2 * x + search(x, xtol=0.5)[x - 1]
'''


@pytest.fixture
def mutants(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """benchmarks/mutants.py."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module("mutants")


def test_mutants_change_the_mathematics_alone(mutants: ModuleType, tmp_path: Path,
                                              monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "area.py").write_text(SOURCE, encoding="utf-8")
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    found = mutants.mutants("area.py")
    assert {(m.line, m.mutation) for m in found} == {
        (2, "2.5 -> 2.75"), (7, "x < 0 -> x >= 0"),
        (9, "2 * x + search(x, xtol=0.5)[x - 1] -> 2 * x"),
        (9, "2 * x + search(x, xtol=0.5)[x - 1] -> 2 * x - search(x, xtol=0.5)[x - 1]"),
        (9, "2 * x -> 2 / x"), (9, "2 * x -> 2.2 * x")}
    for mutant in found:
        ast.parse(mutant.source)
        assert sum(a != b for a, b in zip(mutant.source.splitlines(), SOURCE.splitlines(), strict=True)) == 1


def test_every_module_of_the_core_has_tests(mutants: ModuleType) -> None:
    found = mutants.modules([])
    assert len(found) > 40
    assert all((mutants.ROOT / room).exists() for room in (*mutants.TESTS, *mutants.ROOMS))
    assert all((mutants.ROOT / test).exists() for tests in found.values() for test in tests)
    with pytest.raises(SystemExit, match="no module of the core at nowhere"):
        mutants.modules(["nowhere"])
