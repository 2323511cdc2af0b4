"""Punches of any shape: distances to a solid's triangles, files, and touches next to those of profiles."""

from collections.abc import Sequence
from pathlib import Path

import meshio
import numpy as np
import pytest

import eitsim
from eitsim.mechanics.contact.punch_shape import shapes_of
from eitsim.mechanics.general.meshing.levels import COARSE, ROUGH
from eitsim.mechanics.general.solve_general import solve_general
from eitsim.scene.edges.disc import Disc
from eitsim.scene.mesh_file import read_mesh
from eitsim.scene.scene import Body, Punch, scene_from, scene_tables
from eitsim.scene.triangles.punch_files import punch_surface, with_shapes
from eitsim.scene.triangles.solid import Solid
from matcal.laws.hyperfoam import Hyperfoam
from touchcal.arrays import Array
from touchcal.errors import InputFileError

LAW = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
EDGE = [(6.3 + 0.7 * np.sin(a), 0.7 - 0.7 * np.cos(a)) for a in np.linspace(0, np.pi / 2, 16)]
FLAT = [(0.0, 0.0), *EDGE, (7.0, 15.0), (0.0, 15.0)]
BALL = [(7 * np.sin(a), 7 - 7 * np.cos(a)) for a in np.linspace(0, np.pi, 41)]


def revolved(path: Path, outline: Sequence[tuple[float, float]], turn: Array | None = None, sides: int = 96) -> Path:
    """Write the triangles of a solid of revolution, mm, its outline (r, z) from the axis to the axis."""
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = [np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(sides, z)]) for r, z in outline[1:-1]]
    nodes = np.vstack([*rings, [(0, 0, outline[0][1]), (0, 0, outline[-1][1])]])
    here = np.arange(sides)
    ahead, last = (here + 1) % sides, (len(rings) - 1) * sides
    cells = [np.column_stack([here, ahead, np.full(sides, len(nodes) - 2)]),
             np.column_stack([last + here, last + ahead, np.full(sides, len(nodes) - 1)])]
    for k in range(0, last, sides):
        cells += [np.column_stack([k + here, k + ahead, k + sides + ahead]),
                  np.column_stack([k + here, k + sides + ahead, k + sides + here])]
    meshio.write(path, meshio.Mesh(nodes if turn is None else nodes @ turn.T, [("triangle", np.concatenate(cells))]))
    return path


def box(path: Path, low: Sequence[float], high: Sequence[float]) -> Path:
    nodes = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    cells = [tri for a, b, c, d in quads for tri in ((a, b, c), (a, c, d))]
    meshio.write(path, meshio.Mesh(nodes, [("triangle", np.array(cells))]))
    return path


def shaped(path: Path, **keys: float | str) -> Punch:
    """The punch of a scene file's table."""
    return eitsim.read_scene(scene_file(path, **keys)).punches[0]


def scene_file(path: Path, **keys: float | str) -> Path:
    held = [f"{key} = {value!r}".replace("'", '"') for key, value in {"shape": path.name, **keys}.items()]
    file = path.with_suffix(".toml")
    file.write_text("\n".join(["[[punch]]", *held]))
    return file


def test_distances_to_a_box_are_exact_inside_and_out(tmp_path: Path) -> None:
    solid = Solid(*punch_surface(box(tmp_path / "box.stl", (-4, -3, 0), (4, 3, 5))), 5e-4)
    points = np.random.default_rng(3).uniform([-6, -5, -2], [6, 5, 7], (4000, 3))
    beyond = np.abs(points - [0, 0, 2.5]) - [4, 3, 2.5]
    exact = -np.where((beyond < 0).all(axis=1), beyond.max(axis=1), np.linalg.norm(np.maximum(beyond, 0), axis=1))
    assert solid.distance(points / 1e3) * 1e3 == pytest.approx(exact, abs=1e-4)  # the file has single precision


@pytest.mark.thorough
def test_a_shape_is_round_where_its_file_is(tmp_path: Path) -> None:
    (shape,) = shapes_of([shaped(revolved(tmp_path / "ball.stl", BALL))], 0.005)
    assert shape is not None
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-5, 5, (500, 2)), rng.uniform(-1, 4, 500)])
    away = points - [0, 0, 7]
    exact = 7 - np.linalg.norm(away, axis=1)
    near = np.abs(exact) < 1.5
    assert 1e3 * shape.penetration(points[near] / 1e3) == pytest.approx(exact[near], abs=0.012)  # its triangles' sag
    slope = shape.derivatives(points[near] / 1e3)[0]
    assert slope == pytest.approx(-away[near] / np.linalg.norm(away[near], axis=1, keepdims=True), abs=0.06)


@pytest.mark.thorough
def test_a_shape_lies_as_its_file_does(tmp_path: Path) -> None:
    turn = np.array([[0.96, 0.0, 0.28], [0.0, 1.0, 0.0], [-0.28, 0.0, 0.96]])
    file = revolved(tmp_path / "leaning.stl", FLAT, turn)
    (shape,) = shapes_of([shaped(file)], 0.003)
    assert shape is not None
    nodes, cells = punch_surface(file)
    points = np.random.default_rng(1).uniform([-4e-3, -4e-3, -1e-3], [6e-3, 4e-3, 2e-3], (400, 3))
    exact = Solid(nodes, cells, 5e-4).distance(points + np.array([0, 0, nodes[:, 2].min()]))
    near = np.abs(exact) < 5e-4
    assert np.median(np.abs(shape.penetration(points[near]) - exact[near])) < 1e-6


def test_the_profile_that_is_about_a_shape_is_found(tmp_path: Path) -> None:
    ball, flat = (shaped(revolved(tmp_path / f"{name}.stl", of)) for name, of in (("ball", BALL), ("flat", FLAT)))
    assert (ball.profile, flat.profile) == ("ellipse", "flat")
    assert [ball.diameter_m, ball.fillet_m, flat.diameter_m] == pytest.approx([0.014, 0.007, 0.014], rel=1e-3)
    tables = scene_tables(eitsim.read_scene(tmp_path / "ball.toml"))
    assert scene_from(with_shapes(tables, tmp_path)).punches == (ball,)
    assert "shape" not in scene_tables(eitsim.Scene())["punch"][0]


def test_what_is_no_punch_is_refused_with_what_to_do(tmp_path: Path) -> None:
    good = box(tmp_path / "good.stl", (-4, -3, 0), (4, 3, 5))
    for keys, words in (({"friction": "stick"}, "friction in .punch.* leave it out where shape"),
                        ({"diameter_mm": 3.0}, "diameter_mm in .punch. has no effect with shape"),
                        ({"tilt_deg": 3.0, "conductor": 1}, "conductor"), ({"shape": 3}, "must name one file")):
        with pytest.raises(InputFileError, match=words):
            eitsim.read_scene(scene_file(good, **keys))
    mesh = read_mesh(good)
    meshio.write(tmp_path / "open.stl", meshio.Mesh(mesh.points, [("triangle", mesh.cells[0].data[:-1])]))
    box(tmp_path / "aside.stl", (4, -3, 0), (8, 3, 5))
    box(tmp_path / "metres.stl", (-4e-3, -3e-3, 0), (4e-3, 3e-3, 5e-3))
    for name, words in (("open", r"a punch is closed, .* Fill its holes"), ("metres", "Save it in mm"),
                        ("aside", "misses it: x goes from 4 to 8 mm"), ("absent", "no such file")):
        with pytest.raises(InputFileError, match=words):
            eitsim.read_scene(scene_file(tmp_path / f"{name}.stl"))
    with pytest.raises(InputFileError, match="no such file"):
        shapes_of([Punch(shape="absent.stl")], 0.01)
    with pytest.raises(ValueError, match="give that diameter"):
        shapes_of([Punch(shape=str(good), diameter_m=0.004)], 0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("outline", "same"), [(BALL, Punch(force_N=0.5, profile="sphere")),
                                               (FLAT, Punch(force_N=0.5, fillet_m=7e-4))])
def test_triangles_press_as_the_profile_does(tmp_path: Path, outline: list[tuple[float, float]], same: Punch) -> None:
    body = Body(Disc(0.1))
    punch = shaped(revolved(tmp_path / "punch.stl", outline), force_N=0.5)
    (touch,) = solve_general(LAW, body, [punch], level=COARSE, coarser=ROUGH,
                             shapes=shapes_of([punch], body.thickness_m)).touches
    (exact,) = solve_general(LAW, body, [same], level=COARSE, coarser=ROUGH).touches
    assert touch.depth_m == pytest.approx(exact.depth_m, rel=0.01)
    assert touch.contact_area_m2 == pytest.approx(exact.contact_area_m2, rel=0.02)


@pytest.mark.slow
def test_a_punch_that_leans_in_its_file_is_one_that_leans_in_the_scene(tmp_path: Path) -> None:
    body, tilt = Body(Disc(0.1)), np.deg2rad(5)
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    punch = shaped(revolved(tmp_path / "leaning.stl", FLAT, turn), force_N=0.5)
    (touch,) = solve_general(LAW, body, [punch], level=COARSE, coarser=ROUGH,
                             shapes=shapes_of([punch], body.thickness_m)).touches
    leaning = Punch(force_N=0.5, fillet_m=7e-4, tilt_rad=tilt)
    (exact,) = solve_general(LAW, body, [leaning], level=COARSE, coarser=ROUGH).touches
    assert touch.depth_m == pytest.approx(exact.depth_m, rel=0.02)
