"""Input is a regular file that unpacks to what its size allows; anything else is refused before it is read."""

import os
from pathlib import Path

import numpy as np
import pytest

from eitsim.scene.drive import matrix_rows
from eitsim.sweeps.run.scene_table import read_scene_table
from matcal.card import read_card
from matcal.readers.decoding import read_bytes
from surrogate.data.frame_rows import read_lines
from touchcal.array_store import read_npz
from touchcal.csv_numbers import read_numbers
from touchcal.errors import InputFileError
from touchcal.input_file import check_unpacked
from touchcal.json_file import read_json
from touchcal.toml_file import read_toml

READERS = (read_numbers, matrix_rows, read_toml, read_card, read_bytes, read_npz, read_scene_table,
           lambda path: read_lines(path, 208), lambda path: read_json(path, "a card", "Fix it."))


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("kind", ["device", "pipe", "folder", "nothing"])
def test_only_regular_files_are_read(tmp_path: Path, read, kind: str) -> None:
    path = {"device": Path("/dev/zero"), "folder": tmp_path}.get(kind, tmp_path / "input")
    if kind == "pipe":
        os.mkfifo(path)
    with pytest.raises(InputFileError, match=f"{path}: (no such file|this is a (folder|pipe or a device))"):
        read(path)


def test_an_archive_that_unpacks_to_far_more_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arrays.npz"
    np.savez_compressed(path, a=np.zeros(15_000_000))
    with pytest.raises(InputFileError, match=r"arrays\.npz: its \d+ bytes would unpack to 1\.2e\+08"):
        read_npz(path)
    check_unpacked(path, 99e6)


def test_an_array_of_a_huge_stated_shape_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arrays.npz"
    np.savez(path, a=np.zeros(3))
    content = path.read_bytes().replace(b"'shape': (3,), }            ", b"'shape': (9999999999999,), }")
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=r"arrays\.npz: no npz file of arrays"):
        read_npz(path)


def test_a_pattern_number_of_any_size_takes_no_memory(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("pattern,a,b\n0,1,-1\n3000000000,1,-1\n")
    with pytest.raises(InputFileError, match="pattern 1 has no rows"):
        matrix_rows(tmp_path / "m.csv")
    (tmp_path / "m.csv").write_text("pattern,a,b\n0,1,-1\n1.5,1,-1\n")
    with pytest.raises(InputFileError, match=r"line 3: the pattern 1\.5 is no whole number"):
        matrix_rows(tmp_path / "m.csv")


@pytest.mark.parametrize("text", ["[1]", "{", "[" * 200_000, '{"a": ' + "9" * 5000 + "}"])
def test_what_is_no_object_of_json_is_said(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputFileError, match=r"a\.json.*(Fix it|make it again|power of ten|digits)"):
        read_json(tmp_path / "a.json", "a card", "Fix it.")
