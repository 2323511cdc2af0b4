"""Scenes on bodies that are not flat: triangles lie on the surface, tables give scenes back, slips are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from skfem import ElementTriP2
from skfem.quadrature import get_quadrature

from eitsim.electrics.curved.facets import slopes
from eitsim.scene.curved.curved_body import curved_body
from eitsim.scene.curved.curved_scene import CurvedScene, curved_scene, curved_tables, read_any_scene
from eitsim.scene.scene import Scene, read_scene
from eitsim.scene.triangles.triangle_files import TriangleMesh
from touchcal.errors import InputFileError

ROOT = Path(__file__).parents[3]
FOREARM = ROOT / "examples/forearm.toml"


def area_m2(mesh: TriangleMesh) -> float:
    points, weights = get_quadrature(ElementTriP2(), 6)
    tangents = np.einsum("tkx,pkb->tpbx", mesh.nodes_m[mesh.cells], slopes(points.T))
    return float((np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1) @ weights).sum())


def open_edges(mesh: TriangleMesh) -> NDArray[np.int64]:
    """Nodes (n, 2) of the edges that one triangle alone has."""
    edges = np.sort(np.vstack([mesh.cells[:, [0, 1]], mesh.cells[:, [1, 2]], mesh.cells[:, [0, 2]]]), axis=1)
    found, times = np.unique(edges, axis=0, return_counts=True)
    assert times.max() <= 2
    return found[times == 1]


def test_triangles_of_bodies_by_numbers_have_their_area_and_their_edges() -> None:
    cylinder = curved_body({"surface": "cylinder", "radius_mm": 45, "length_mm": 180}, Path())
    assert area_m2(cylinder.triangles) == pytest.approx(2 * np.pi * 0.045 * 0.18, rel=1e-5)
    ends = cylinder.triangles.nodes_m[open_edges(cylinder.triangles)]
    np.testing.assert_allclose(np.abs(ends[..., 0]), 0.09)
    sphere = curved_body({"surface": "sphere", "radius_mm": 40}, Path())
    assert area_m2(sphere.triangles) == pytest.approx(4 * np.pi * 0.04**2, rel=1e-5)
    assert not len(open_edges(sphere.triangles))
    saddle = curved_body({"surface": "saddle", "radius_mm": 60, "radius_2_mm": -80, "length_mm": 40}, Path())
    for body in (cylinder, sphere, saddle):
        nodes = body.triangles.nodes_m
        np.testing.assert_allclose(body.surface.nearest(nodes)[0], nodes, atol=1e-12)


def test_the_tables_of_a_scene_give_the_scene() -> None:
    scene = read_any_scene(FOREARM)
    assert isinstance(scene, CurvedScene)
    again = curved_scene(curved_tables(scene), FOREARM.parent)
    assert (again.punches, again.drive, again.skin) == (scene.punches, scene.drive, scene.skin)
    for name in ("places_m", "widths_m", "contact_impedance_Ohm_m2"):
        assert getattr(again.sheet(1.0), name) == getattr(scene.sheet(1.0), name)
    np.testing.assert_allclose(again.places_m, scene.places_m)
    places = np.array(scene.sheet(1.0).places_m)
    np.testing.assert_allclose(np.hypot(places[:, 1], places[:, 2]), 0.045)
    assert isinstance(read_any_scene(ROOT / "examples/scene.toml"), Scene)
    with pytest.raises(InputFileError, match="curved body, which `eitsim run` and `eitsim plan` take"):
        read_scene(FOREARM)


@pytest.mark.parametrize(("old", "new", "message"), [
    ('"cylinder"', '"cone"', "must be one of cylinder, sphere, saddle, or name a file of triangles"),
    ("length_mm = 180", "", r"length_mm in \[body\] is missing"),
    ("radius_mm = 45", "radius_mm = -45", r"radius_mm in \[body\] must be a positive number, got -45"),
    ("thickness_mm = 8", "thicknes_mm = 8", "Did you mean 'thickness_mm'"),
    ("at_mm = [10, 12, 45]", "", r"at_mm in \[punch\] must hold x, y and z"),
    ("at_mm = [10, 12, 45]", "x_mm = 10", r"x_mm in \[punch\] has no effect on a curved body; give at_mm"),
    ("force_N = 1", "force_N = 1\nx_mm = 3", r"x_mm in \[punch\] has no effect on a curved body; give at_mm"),
    ("force_N = 1", "force_N = 1\nconductor = true", "conducting punches are not built on curved bodies"),
    ("force_N = 1", "force_N = -1", r"force_N in \[punch\] must be positive"),
    ("width_mm = 8", "width_mm = 8\nx_mm = [1]", r"x_mm in \[electrodes\] has no effect with at_mm"),
    ('"adjacent"', '"opposit"', "'opposit' is unknown"),
    ("[drive]", "[channels]\ngains = [1]\n[drive]", "channels"),
    ("radius_mm = 45", "radius_mm = 1e12", "must be from 0.001 to 10000 mm"),
    ("at_mm = [10, 12, 45]", "at_mm = [10, 12, 60]", "lies 16.2 mm off the surface"),
    ("[-63, 31.82, 31.82]", "[-60, 3, 45]", r"electrodes 0 and 1 \(from 0\) overlap"),
    ("length_mm = 180", "length_mm = 9000", "at most 100 times the lesser radius"),
])
def test_slips_are_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = FOREARM.read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "scene.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputFileError, match=message):
        read_any_scene(tmp_path / "scene.toml")


def test_a_curved_scene_without_electrodes_asks_for_their_places(tmp_path: Path) -> None:
    text = FOREARM.read_text(encoding="utf-8").split("[electrodes]")[0]
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputFileError, match=r"\[electrodes\] of a skin that is not flat needs at_mm, a list"):
        read_any_scene(tmp_path / "scene.toml")
