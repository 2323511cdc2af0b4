"""Meshes are read, or refused with a reason and without a word on the terminal."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from eitsim.scene.mesh_file import read_mesh


def test_a_mesh_is_read_as_it_was_written(tmp_path: Path) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    meshio.write(tmp_path / "one.ply", meshio.Mesh(points, [("triangle", [[0, 1, 2]])]))
    np.testing.assert_array_equal(read_mesh(tmp_path / "one.ply").points, points)


@pytest.mark.parametrize(("name", "content", "reason"), [
    ("cut.ply", b"ply\nformat ascii 1.0\n", "header has no end"), ("a.vtu", b"junk", "."), ("a.msh", b"junk", "."),
    ("a.stl", b"words", "."), ("a.unknown", b"", ".")])
def test_what_is_no_mesh_is_refused_with_the_reason(tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str,
                                                    content: bytes, reason: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=reason):
        read_mesh(tmp_path / name)
    assert capfd.readouterr() == ("", "")
