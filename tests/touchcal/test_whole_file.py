"""A file is there whole or not at all, and what fails leaves nothing else behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from touchcal.json_file import write_json
from touchcal.whole_file import written


def _half_written(path: Path) -> None:
    with written(path) as file:
        file.write(b"half of it")
        raise RuntimeError("stopped")


def test_a_block_that_raises_leaves_the_old_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "card.json"
    write_json({"a": 1}, path)
    before = path.read_bytes()
    with pytest.raises(RuntimeError, match="stopped"):
        _half_written(path)
    assert path.read_bytes() == before
    with pytest.raises(ValueError, match="Out of range float values"):
        write_json({"a": float("nan")}, path)
    assert [p.name for p in tmp_path.iterdir()] == ["card.json"]
    with written(path) as file:
        file.write(b"whole")
    assert path.read_bytes() == b"whole"
