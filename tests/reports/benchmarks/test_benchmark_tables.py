"""Tables of benchmarks tell under what conditions each row was measured; benchmarks use public names alone."""

import ast
import importlib
from pathlib import Path
from types import ModuleType

import pandas as pd
import pytest

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"


@pytest.fixture
def conditions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """benchmarks/conditions.py, with another folder of results."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    module = importlib.import_module("conditions")
    monkeypatch.setattr(module, "RESULTS", tmp_path / "results")
    return module


def test_every_row_tells_its_conditions_and_keeps_those_it_has(conditions: ModuleType, tmp_path: Path) -> None:
    conditions.written([{"x": 1.0}, {"x": 2.0, "date": "2026-01-01"}], "table")
    table = pd.read_csv(tmp_path / "results" / "table.csv")
    assert table["x"].tolist() == [1.0, 2.0]
    assert table[list(conditions.CONDITIONS)].notna().all(axis=None)
    assert table["date"].tolist() == [conditions.conditions()["date"], "2026-01-01"]
    assert "touchcal" in table["versions"][0]


def test_rows_kept_of_an_earlier_run_do_not_claim_the_conditions_of_this_one(conditions: ModuleType,
                                                                             tmp_path: Path) -> None:
    assert not len(conditions.earlier("table"))
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "table.csv").write_text("x,date\n1,2026-01-01\n2,\n")
    table = conditions.written(pd.concat([conditions.earlier("table"), pd.DataFrame({"x": [3]})]), "table")
    assert table["date"].tolist() == ["2026-01-01", "unknown", conditions.conditions()["date"]]
    assert table["code"].tolist()[:2] == ["unknown", "unknown"]


@pytest.mark.thorough
def test_benchmarks_use_public_names_alone_and_can_be_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    for path in sorted(BENCHMARKS.glob("*.py")):
        found = [alias.name for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
                 if isinstance(node, ast.Import | ast.ImportFrom) for alias in node.names]
        assert not [name for name in found if any(part.startswith("_") for part in name.split("."))], path.name
        assert importlib.import_module(path.stem).__doc__, path.name


def test_benchmarks_that_ask_for_files_are_given_them_or_run_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    whole = importlib.import_module("whole")
    asking = {path.stem for path in BENCHMARKS.glob("*.py") if "len(sys.argv)" in path.read_text(encoding="utf-8")}
    assert {"inversion_limit", "two_touches"} <= asking
    assert not asking - set(whole.GIVEN) - set(whole.APART)
