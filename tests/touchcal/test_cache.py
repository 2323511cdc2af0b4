"""The cache: one make for many processes, damage is seen and made good, a folder that cannot be written is said."""

import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from touchcal import cache


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def made(value: float = 1.0):
    return {"a": np.full(1000, value)}


def never():
    raise AssertionError("it was to be read")


def slowly(log: str):
    with open(log, "a") as file:
        file.write("made\n")
    time.sleep(1.0)
    return made()


def taken(log: str) -> float:
    arrays, note = cache.kept("k", lambda: slowly(log))
    assert note == ""
    return float(arrays["a"].sum())


def test_what_was_made_is_read() -> None:
    cache.kept("k", made)
    arrays, note = cache.kept("k", never)
    assert (arrays["a"] == 1.0).all()
    assert list(arrays) == ["a"]
    assert note == ""


def test_two_processes_make_once(tmp_path: Path) -> None:
    log = str(tmp_path / "log")
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        assert list(pool.map(taken, [log, log])) == [1000.0, 1000.0]
    assert Path(log).read_text() == "made\n"


@pytest.mark.parametrize("damage", ["cut", "bit", "empty", "other key"])
def test_damage_is_made_good(place: Path, damage: str) -> None:
    cache.kept("k", made)
    file = place / "k.npz"
    content = bytearray(file.read_bytes())
    if damage == "bit":
        content[len(content) // 2] ^= 1
    file.write_bytes({"cut": content[:len(content) // 2], "bit": content, "empty": b""}.get(damage, content))
    if damage == "other key":
        cache.kept("j", lambda: made(3.0))
        os.replace(place / "j.npz", file)
    arrays, _ = cache.kept("k", lambda: made(2.0))
    assert (arrays["a"] == 2.0).all()
    assert (cache.kept("k", never)[0]["a"] == 2.0).all()


@pytest.mark.parametrize("change", [
    lambda arrays: {"a": arrays["a"] * 1e-6}, lambda arrays: {"a": np.full(1000, np.nan)},
    lambda arrays: {"a": np.array(["word"] * 1000)}, lambda arrays: {}])
def test_an_edited_entry_is_made_again_with_a_note(place: Path, change) -> None:
    cache.kept("k", made)
    with np.load(place / "k.npz") as file:
        arrays = {name: file[name] for name in file.files}
    rest = {name: value for name, value in arrays.items() if name != "a"}
    np.savez(place / "k.npz", **rest, **change(arrays))
    assert cache.stored("k") is None
    arrays, note = cache.kept("k", made)
    assert (arrays["a"] == 1.0).all()
    assert "computed again" in note
    assert "k.npz" in note
    assert cache.kept("k", never)[1] == ""


def test_one_array_in_place_of_an_entry_is_made_again(place: Path) -> None:
    cache.kept("k", made)
    with open(place / "k.npz", "wb") as file:
        np.save(file, np.ones(1000))
    assert "computed again" in cache.kept("k", made)[1]


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path / "file"))
    arrays, note = cache.kept("k", made)
    assert (arrays["a"] == 1.0).all()
    assert "TOUCHCAL_CACHE" in note


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder_is_said(place: Path) -> None:
    place.mkdir()
    place.chmod(0o500)
    assert "Permission" in cache.kept("k", made)[1]
    place.chmod(0o700)


def test_a_maker_that_fails_leaves_nothing(place: Path) -> None:
    def fail():
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        cache.kept("k", fail)
    assert cache.entries() == []
    assert (cache.kept("k", made)[0]["a"] == 1.0).all()
    assert [path.suffix for path in place.iterdir() if path.suffix != ".lock"] == [".npz"]


def test_the_longest_unused_gives_way(monkeypatch: pytest.MonkeyPatch) -> None:
    for age, key in enumerate("abc"):
        cache.kept(key, made)
        os.utime(cache.folder() / f"{key}.npz", (1e9 - age, 1e9 - age))
    cache.kept("c", never)
    monkeypatch.setattr(cache, "LIMIT", 2.5 * (cache.folder() / "a.npz").stat().st_size)
    cache.kept("d", made)
    assert {entry.path.stem for entry in cache.entries()} == {"c", "d"}
    assert cache.clear() == 2
    assert cache.entries() == []


def test_keys_follow_the_content() -> None:
    assert cache.key_of({"a": 1.0, "b": [2]}) == cache.key_of({"b": [2], "a": 1.0})
    assert cache.key_of({"a": 1.0}) != cache.key_of({"a": 1.0 + 1e-15})
