"""A description says what a file holds and what kind of test it is taken for, as plain JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from matcal.errors import TestFileError
from matcal.inspect import describe

DATA = Path(__file__).parents[2] / "data_raw"


def test_machine_file() -> None:
    got = describe(DATA / "mts_cyclic.txt")
    assert json.loads(json.dumps(got, allow_nan=False)) == got
    assert (got["layout"], got["kind"], got["loadings"]) == ("mts_testsuite", "conductivity", 10)
    assert got["loading_speed_mm_per_min"] == pytest.approx(5.0, rel=1e-3)
    assert got["interval_s"] == pytest.approx(0.1, rel=1e-3)
    assert got["columns"]["force"]["unit"] == "N"
    assert "SYNTHETIC" in got["head"]["Test"]


def test_file_of_no_clear_kind_is_described_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "foam.csv").write_text("strain,stress (kPa)\n0,0\n0.1,1\n")
    got = describe(tmp_path / "foam.csv")
    assert got["kind"] is None
    assert "Write KIND=foam.csv" in got["kind_reason"]
    with pytest.raises(TestFileError, match="no such file"):
        describe(tmp_path / "absent.csv")
