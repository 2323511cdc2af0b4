"""A data set opens in other libraries by the very lines that the documentation gives, where these are installed."""

import glob
import importlib
import re
from pathlib import Path
from typing import Any

import pytest

from eitsim.sweeps.dataset import parquet
from touchcal.errors import InputFileError

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "data-sets.md"
ROWS = 40
MODULES = {"pandas": {"pd": "pandas"}, "Arrow": {"pyarrow": "pyarrow"}, "Dask": {"dask": "dask"},
           "polars": {"pl": "polars"}}


@pytest.fixture
def beside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sweep").mkdir()
    parquet.write_manifest(tmp_path / "sweep", {"design": {"scenes": ROWS, "tables": {}}})
    for first in range(0, ROWS, 16):
        parquet.write_part(tmp_path / "sweep", [dict.fromkeys(parquet.FIXED, 0.5) | {"scene": scene, "outcome": "ok"}
                                                for scene in range(first, min(first + 16, ROWS))])
    monkeypatch.chdir(tmp_path)


def line_of(library: str) -> str:
    (line,) = re.findall(rf"^\| {library} \| `([^`]*)`", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return line


@pytest.mark.parametrize("library", MODULES)
def test_the_line_of_the_documentation_reads_the_set(library: str, beside: None) -> None:
    line, names = line_of(library), {name: pytest.importorskip(module) for name, module in MODULES[library].items()}
    for module in re.findall(r"(?:pyarrow|dask)\.\w+", line):
        importlib.import_module(module)
    found: Any = eval(line, {"glob": glob, **names})
    assert (found.count_rows() if library == "Arrow" else len(found)) == ROWS


def test_duckdb_reads_the_set(beside: None) -> None:
    duckdb = pytest.importorskip("duckdb")
    assert len(duckdb.sql(line_of("DuckDB")).fetchall()) == ROWS


def test_a_manifest_cut_short_says_how_to_mend_it(beside: None) -> None:
    path = Path("sweep") / parquet.MANIFEST
    path.write_text(path.read_text()[:-9])
    with pytest.raises(InputFileError, match=r"design\.json, line .* not JSON.*restore it from a copy"):
        parquet.read_manifest(Path("sweep"))
