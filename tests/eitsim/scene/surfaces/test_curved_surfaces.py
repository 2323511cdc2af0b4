"""Curved surfaces: nearest places, coordinates there and back, lengths and curvatures at the origin."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from eitsim.scene.curved.curved_body import curved_body
from eitsim.scene.surfaces.curved_surface import CROSS, CurvedSurface, frames, second_form
from eitsim.scene.surfaces.cylinder import Cylinder
from eitsim.scene.surfaces.saddle import Saddle
from eitsim.scene.surfaces.sphere import Sphere
from eitsim.scene.surfaces.triangle_surface import TriangleSurface, triangle_surface
from eitsim.scene.triangles.solid import flat_nearest
from eitsim.scene.triangles.triangle_files import TriangleMesh

RADIUS = 0.04
SURFACES = [Sphere(RADIUS), Cylinder(RADIUS, 0.2), Saddle(RADIUS, -RADIUS), Saddle(0.1, 0.05)]
PLACES = [[0.0, 0.0, 0.05], [0.013, -0.02, 0.03]]


@pytest.mark.parametrize("surface", SURFACES, ids=str)
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_coordinates_are_found_again_and_normals_are_across_the_surface(surface: CurvedSurface, place: list[float]
                                                                        ) -> None:
    chart, rng = surface.chart_about(np.array(place)), np.random.default_rng(0)
    uv = 0.025 * rng.uniform(-1, 1, (50, 2))
    points, normals = chart.place(uv)
    assert chart.find(points) == pytest.approx(uv, abs=1e-9)
    assert chart.find(points + 1e-4 * normals) == pytest.approx(uv, abs=1e-8)
    again, across = surface.nearest(points + 3e-3 * normals)
    assert again == pytest.approx(points, abs=1e-9)
    assert across == pytest.approx(normals, abs=1e-7)
    turns = frames(chart, uv, 1e-6)
    assert np.linalg.det(turns) == pytest.approx(np.ones(50), abs=1e-9)
    way = np.array([1e-6, 0])
    slope = (chart.place(uv + way)[0] - chart.place(uv - way)[0]) / 2e-6
    assert np.abs(np.sum(slope * normals, axis=1)).max() < 1e-5


@pytest.mark.parametrize("surface", SURFACES, ids=str)
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_lengths_at_the_origin_are_those_of_the_surface(surface: CurvedSurface, place: list[float]) -> None:
    chart, step = surface.chart_about(np.array(place)), 1e-5
    at, normal = chart.place(np.zeros(2))
    assert at == pytest.approx(surface.nearest(np.array([place]))[0][0], abs=1e-12)
    assert normal == pytest.approx(chart.frame[2], abs=1e-12)
    along = (chart.place(step * CROSS[::2])[0] - chart.place(step * CROSS[1::2])[0]) / (2 * step)
    assert along == pytest.approx(chart.frame[:2], abs=1e-6)


@pytest.mark.parametrize(("surface", "expected"), [
    (Sphere(RADIUS), [25, 25]), (Cylinder(RADIUS, 0.2), [0, 25]), (Saddle(RADIUS, -RADIUS), [25, -25])], ids=str)
def test_curvatures_are_those_of_the_radii(surface: CurvedSurface, expected: list[float]) -> None:
    chart = surface.chart_about(np.array([0, 0, 0.05]))
    form = second_form(*chart.place(1e-5 * CROSS), chart.frame[2])
    assert form == pytest.approx(np.diag(expected), abs=1e-3)


def _ball_of_triangles(side: int) -> TriangleSurface:
    """A cube's faces of so many squares a side, put onto a sphere."""
    t = np.tan(np.linspace(-np.pi / 4, np.pi / 4, side + 1))
    a, b = (part.ravel() for part in np.meshgrid(t, t, indexing="ij"))
    one, nodes, cells = np.ones_like(a), [], []
    number = np.arange(len(a)).reshape(side + 1, side + 1)
    square = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 4)
    for face in (np.stack([one, a, b]), np.stack([a, one, -b]), np.stack([a, b, one])):
        for sign in (1, -1):
            nodes.append(sign * face.T)
            quads = square if sign > 0 else square[:, ::-1]
            cells.append(np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) + len(a) * len(cells))
    points = np.vstack(nodes)
    place, number = np.unique((RADIUS * points / np.linalg.norm(points, axis=1, keepdims=True)).round(12), axis=0,
                              return_inverse=True)
    return TriangleSurface(place, number.ravel()[np.vstack(cells)])


@pytest.mark.parametrize(("side", "off", "turned"), [(8, 2e-4, 1e-3), (16, 2e-5, 1e-4)])
def test_triangles_of_a_sphere_are_bent_into_it(side: int, off: float, turned: float) -> None:
    rng = np.random.default_rng(1)
    way = rng.normal(size=(300, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    at, normal = _ball_of_triangles(side).nearest(1.03 * RADIUS * way)
    assert np.linalg.norm(at, axis=1) == pytest.approx(np.full(300, RADIUS), rel=off)
    assert np.linalg.norm(normal - way, axis=1).max() < turned


def test_coordinates_on_triangles_are_found_again() -> None:
    ball = _ball_of_triangles(16)
    chart = ball.chart_about(np.array([0.01, 0.02, 0.05]))
    assert ball.rim.size == 0
    uv = 0.02 * np.random.default_rng(2).uniform(-1, 1, (50, 2))
    points, _ = chart.place(uv)
    assert chart.find(points) == pytest.approx(uv, abs=1e-7)
    assert chart.form == pytest.approx(np.eye(2) / RADIUS, rel=1e-3, abs=1e-3 / RADIUS)


def test_coordinates_end_before_an_open_edge() -> None:
    ball = _ball_of_triangles(16)
    up = ball.nodes_m[ball.cells].mean(axis=1)[:, 2] > 0
    bowl = TriangleSurface(ball.nodes_m, ball.cells[up])
    assert np.abs(bowl.nodes_m[bowl.rim, 2]).max() < 0.1 * RADIUS
    there = np.array([0.03, 0, 0.03])
    chart = bowl.chart_about(there)
    assert chart.limit_m < RADIUS * np.pi / 4
    opened = chart.open_m
    assert opened is not None
    assert np.isclose(np.linalg.norm(opened - bowl.nearest(there[None])[0][0]), chart.limit_m)
    # far from the edge the bend sets the limit
    assert _ball_of_triangles(16).chart_about(there).open_m is None


def test_a_body_of_a_file_has_the_file_s_surface(tmp_path: Path) -> None:
    ball = _ball_of_triangles(8)
    mixed = np.where(np.random.default_rng(3).random((len(ball.cells), 1)) < 0.7, ball.cells[:, ::-1], ball.cells)
    meshio.Mesh(1e2 * ball.nodes_m, [("triangle", mixed)]).write(tmp_path / "ball.ply")
    body = curved_body({"surface": "ball.ply", "unit_mm": 10.0, "thickness_mm": 5}, tmp_path)
    assert body.size_m == pytest.approx(2 * RADIUS, rel=0.01)
    middles = body.triangles.nodes_m
    assert np.linalg.norm(middles, axis=1) == pytest.approx(np.full(len(middles), RADIUS), rel=1e-3)
    _, normals = body.surface.nearest(middles)
    assert np.sum(normals * middles, axis=1) == pytest.approx(np.full(len(middles), RADIUS), rel=1e-3)
    with pytest.raises(ValueError, match="surface in"):
        curved_body({"surface": "torus"}, tmp_path)


@pytest.mark.parametrize("given", [1, -1])
def test_an_open_surface_faces_the_way_its_triangles_turn_and_a_closed_one_outwards(given: int) -> None:
    ball = _ball_of_triangles(4)
    top = RADIUS * np.array([[0.1, 0.1, 1.0]])
    up = ball.nodes_m[ball.cells].mean(axis=1)[:, 2] > 0
    for cells, faces in ((ball.cells, 1), (ball.cells[up], given)):
        turned = cells[:, ::given].copy()
        turned[:3] = turned[:3, ::-1]  # a few of a careless file
        read = triangle_surface(TriangleMesh("ball", ball.nodes_m, turned, {}))
        assert read.nearest(top)[1][0, 2] * faces > 0.9


@pytest.mark.parametrize("height", [1.0, 1e-3, 1e-9])
def test_the_nearest_place_of_a_triangle_is_that_of_many_places_on_it(height: float) -> None:
    rng = np.random.default_rng(23)
    corners = rng.normal(size=(20, 3, 3))
    corners[:, 2] = corners[:, 0] + rng.uniform(size=(20, 1)) * (corners[:, 1] - corners[:, 0]) + height * corners[:, 2]
    points = 2 * rng.normal(size=(20, 3))
    first, second = np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 1, 401))
    share = np.column_stack([first.ravel(), second.ravel()])[(first + second).ravel() <= 1]
    found, square = flat_nearest(corners, points)
    for corner, point, one, least in zip(corners, points, found, square, strict=True):
        there = corner[0] + share @ (corner[1:] - corner[0])
        seen = np.sum((there - point) ** 2, axis=1).min()
        assert least <= seen * (1 + 1e-12)
        assert np.sqrt(least) > np.sqrt(seen) - 0.02
        assert one.min() >= 0
        assert one.sum() <= 1 + 1e-12
        assert np.isclose(np.sum((corner[0] + one @ (corner[1:] - corner[0]) - point) ** 2), least)
