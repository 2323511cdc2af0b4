"""A file is there whole or not at all, and what fails leaves nothing else behind."""

import errno
import os
from pathlib import Path

import pytest

from eitsim.sweeps.dataset.parquet import put
from eitsim.sweeps.run.folder import sole_writer
from touchcal.json_file import write_json
from touchcal.whole_file import lock_file, rows_written, written


def half_written(path: Path) -> None:
    before = path.read_bytes()
    with written(path) as file:
        file.write(b"half of it")
        assert path.read_bytes() == before
        raise RuntimeError


def test_a_block_that_raises_leaves_the_old_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "card.json"
    write_json({"a": 1}, path)
    before = path.read_bytes()
    with pytest.raises(RuntimeError):
        half_written(path)
    assert path.read_bytes() == before
    with pytest.raises(ValueError, match="Out of range float values"):
        write_json({"a": float("nan")}, path)
    assert [p.name for p in tmp_path.iterdir()] == ["card.json"]
    with written(path) as file:
        file.write(b"whole")
    assert path.read_bytes() == b"whole"


def test_rows_end_with_a_whole_one_where_the_disk_is_full(tmp_path: Path) -> None:
    def filled() -> None:
        with rows_written(tmp_path / "rows.csv") as file:
            file.write("a,b\n1,2\n3,")
            file.flush()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OSError, match="No space left") as full:
        filled()
    assert full.value.filename == str(tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text() == "a,b\n1,2\n"


def test_the_umask_says_who_may_read(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        write_json({"a": 1}, tmp_path / "card.json")
        put(tmp_path / "part-000000000.parquet", b"rows")
    finally:
        os.umask(before)
    assert [path.stat().st_mode & 0o777 for path in tmp_path.iterdir()] == [0o600, 0o600]


def test_a_full_disk_names_the_file(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No space left") as found, written(tmp_path / "card.json"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert found.value.filename == str(tmp_path / "card.json")
    assert not list(tmp_path.iterdir())


def test_a_lock_follows_no_link_and_cuts_nothing(tmp_path: Path) -> None:
    (tmp_path / "victim.txt").write_text("kept")
    (tmp_path / ".lock").symlink_to("victim.txt")
    with pytest.raises(OSError, match="link") as found, sole_writer(tmp_path):
        pass
    assert found.value.filename == str(tmp_path / ".lock")
    assert (tmp_path / "victim.txt").read_text() == "kept"
    lock_file(tmp_path / "victim.txt").close()
    assert (tmp_path / "victim.txt").read_text() == "kept"


def test_a_file_written_again_is_read_by_whom_it_was(tmp_path: Path) -> None:
    path = tmp_path / "card.json"
    for mode in (0o640, 0o600):
        path.touch()
        path.chmod(mode)
        write_json({"a": 1}, path)
        assert path.stat().st_mode & 0o777 == mode
