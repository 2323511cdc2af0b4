"""Data sets on disk: parts are whole or absent, rows come back sorted, damage is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from eitsim.dataset import FIXED, finished_scenes, read_dataset, voltage_columns, write_manifest, write_part
from matcal.errors import TestFileError


def row(scene: int, outcome: str = "ok") -> dict[str, object]:
    return dict.fromkeys(FIXED, 0.5) | {"scene": scene, "outcome": outcome} | dict.fromkeys(voltage_columns(4), 1.0)


def test_rows_come_back_sorted_and_filtered(tmp_path: Path) -> None:
    write_manifest(tmp_path, {"design": {"seed": 1}, "card": {}})
    write_part(tmp_path, [row(3), row(2, "refused")])
    write_part(tmp_path, [row(0), row(1)])
    data = read_dataset(tmp_path)
    assert data.table["scene"].tolist() == [0, 1, 2, 3]
    assert data.ok["scene"].tolist() == [0, 1, 3]
    assert finished_scenes(tmp_path) == {0, 1, 2, 3}
    assert not [p for p in tmp_path.iterdir() if p.name.endswith(".tmp")]


def test_a_failed_write_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyError):
        write_part(tmp_path, [{"outcome": "ok"}])
    with pytest.raises(Exception, match=r"(?i)convert|serialize|object"):
        write_part(tmp_path, [row(0) | {"x_mm": object()}])
    assert list(tmp_path.iterdir()) == []


def test_damage_is_named(tmp_path: Path) -> None:
    with pytest.raises(TestFileError, match="not a data set"):
        read_dataset(tmp_path)
    write_manifest(tmp_path, {"design": {}, "card": {}})
    with pytest.raises(TestFileError, match="no rows"):
        read_dataset(tmp_path)
    write_part(tmp_path, [row(0)])
    write_part(tmp_path, [row(0), row(1)])
    with pytest.raises(TestFileError, match="scene 0 stands in it twice"):
        read_dataset(tmp_path)
