"""Signals for a page are those of the whole set, read part by part."""

from pathlib import Path

import numpy as np
import pytest

from eitsim.sweeps.dataset import parquet
from reports.sweep.sweep_report import rms_of
from touchcal.errors import InputFileError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three parts of two rows; the second part has no signal, scene 4 one reading fewer."""
    parquet.write_manifest(tmp_path, {"design": {"scenes": 6, "tables": {}}})
    plain = dict.fromkeys(parquet.FIXED, 0.5)
    for first in (0, 4):
        rows = [plain | {"scene": scene, "outcome": "ok"} | {f"dv_{i:03d}": float(scene + i) for i in range(3)}
                for scene in (first, first + 1)]
        parquet.write_part(tmp_path, [rows[0] | ({"dv_002": np.nan} if first == 4 else {}), rows[1]])
    parquet.write_part(tmp_path, [plain | {"scene": scene, "outcome": "refused"} for scene in (2, 3)])
    return tmp_path


def test_sizes_of_signals_are_those_of_the_rows(folder: Path) -> None:
    table = parquet.read_dataset(folder).table.set_index("scene")[["dv_000", "dv_001", "dv_002"]]
    scenes = np.array([5, 0, 4, 1])
    assert rms_of(folder, scenes).tolist() == np.sqrt((table.loc[scenes]**2).mean(axis=1)).tolist()
    with pytest.raises(InputFileError, match="no columns dv_000"):
        rms_of(folder, np.array([2]))


def test_a_set_is_read_in_the_columns_asked_for(folder: Path) -> None:
    assert set(parquet.read_dataset(folder, ["dv_001", "absent"]).table) == {*parquet.FIXED, "dv_001"}
    assert "dv_002" in parquet.read_dataset(folder).table
