"""Stored results are stale where the code or the libraries that they were measured with have changed."""

from importlib.metadata import version
from pathlib import Path

import pandas as pd
import pytest

from benchmarks.report.stored_tables import CURRENT, STALE, UNKNOWN, cautions, state
from eitsim.sweeps.dataset.code_history import other_code
from touchcal.cache import key_of
from touchcal.code_version import script_hash


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """benchmarks/bench.py."""
    place = tmp_path / "benchmarks"
    place.mkdir()
    (place / "bench.py").write_text("print(2)\n")
    return place


def test_old_code_old_versions_and_no_record_are_told_apart(folder: Path) -> None:
    here = {"code": script_hash(folder / "bench.py", folder.parent), "versions": f"numpy {version('numpy')} none 1"}
    tables = [({}, CURRENT, "current"), ({"code": "0" * 12}, STALE, "stale: the rows are of other code"),
              ({"code": [here["code"], "0" * 12]}, STALE, "stale: 1 of 2 rows are of other code"),
              ({"versions": "numpy 1.0"}, STALE, "stale: measured with numpy 1.0"),
              ({"code": [None, here["code"]]}, UNKNOWN, "unknown: its rows do not tell their code")]
    states = [state(pd.DataFrame({"x": [1, 2]}).assign(**here | other), f"{i}.csv", "bench", folder)
              for i, (other, _, _) in enumerate(tables)]
    assert [(one.kind, one.words) for one in states] == [(kind, words) for _, kind, words in tables]
    assert state(pd.DataFrame({"x": [1]}), "n.csv", "none", folder).kind == UNKNOWN
    stale, unknown = cautions(states)
    assert "1.csv, 2.csv, 3.csv." in stale
    assert unknown.endswith("4.csv.")


@pytest.mark.thorough
def test_sweeps_of_other_code_are_told_from_those_of_this() -> None:
    here, before = {"code": key_of({})}, {"code": "0" * 64}
    assert [other_code(one) for one in ({}, here, here | {"earlier_code": []})] == [""] * 3
    for manifest in (before, here | {"earlier_code": [before]}):
        assert other_code(manifest) == "other code or libraries than are here solved its rows"
