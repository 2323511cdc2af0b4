"""Meshes of a layer: volumes, conformity, edges and holes followed, gaps refused."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.mechanics.general.meshing.bodies import bodies_of
from eitsim.mechanics.general.meshing.edge_path import edge_path, pieces
from eitsim.mechanics.general.meshing.levels import ROUGH, Level, layer_mesh
from eitsim.mechanics.general.meshing.section import Grading, Zone, core_radius, heights, size
from eitsim.mechanics.general.meshing.surface_places import inside
from eitsim.mechanics.general.meshing.wedge import gauss_points, shapes
from eitsim.mechanics.general.meshing.wedge_mesh import WedgeMesh
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body

WHOLE = replace(ROUGH, reach=10.0)
ZONE = Zone(0.4, 0.5, 0.5)
HOLED = Outline("rectangle", width_m=0.06, height_m=0.05, corner_radius_m=0.01, holes_m=((0.015, 0.0, 0.004),))


def _mesh(body: Body, centres: list[list[float]], level: Level = WHOLE) -> WedgeMesh:
    count = len(centres)
    return layer_mesh(body, np.array(centres, dtype=float), (ZONE,) * count, (0.05,) * count, level)


@pytest.mark.parametrize(("edge", "centres"), [
    (Disc(0.03), [[0, 0]]), (Disc(0.03), [[2.2, 0.4]]), (HOLED, [[-0.5, 0.6]]), (HOLED, [[-1.5, 1.2], [0, -1.2]])])
def test_a_mesh_of_a_small_body_fills_it(edge: Disc | Outline, centres: list[list[float]]) -> None:
    mesh, area = _mesh(Body(edge), centres), edge.area_m2 / 1e-4
    assert mesh.weight.sum() == pytest.approx(area, rel=2e-3)
    assert mesh.around.weight.sum() + mesh.flat.weight.sum() == pytest.approx(mesh.weight.sum(), rel=1e-12)
    assert not mesh.plan.cut.any()


def test_faces_inside_are_shared_by_two_elements() -> None:
    mesh = _mesh(Body(HOLED), [[-0.5, 0.6]])
    sides = np.concatenate([mesh.elements[:, [a, b, a + 12, b + 12]] for a, b in ((0, 1), (1, 2), (0, 2))]
                           + [np.column_stack([e := mesh.elements[:, [a, a + 1, a + 2]], e[:, :1]]) for a in (0, 12)])
    _, seen = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    assert seen.max() == 2


@pytest.mark.parametrize(("edge", "centres"), [(Disc(0.03), [[2.2, 0.4]]), (HOLED, [[-1.5, 1.2], [0, -1.2]])])
def test_values_of_a_mesh_are_found_at_its_own_nodes_and_between_those(edge: Disc | Outline, centres: list[list[float]]
                                                                       ) -> None:
    mesh = _mesh(Body(edge), centres)
    element, reference = inside(mesh, mesh.coordinates)
    value, _ = shapes(reference)
    assert np.allclose(np.einsum("na,nai->ni", value, mesh.coordinates[mesh.elements[element]]), mesh.coordinates)

    at, _ = gauss_points()
    value, _ = shapes(at)
    points = np.einsum("qa,eai->eqi", value, mesh.coordinates[mesh.elements]).reshape(-1, 3)
    element, reference = inside(mesh, points)
    value, _ = shapes(reference)
    found = np.einsum("na,nai->ni", value, mesh.coordinates[mesh.elements[element]])
    assert np.abs(found - points).max() < 0.02
    assert np.mean(element == np.repeat(np.arange(len(mesh.elements)), len(at))) > 0.99


def test_no_wedge_is_found_where_the_mesh_has_ended() -> None:
    mesh = _mesh(Body(Disc(0.2)), [[3.0, 1.0]], ROUGH)
    element, _ = inside(mesh, np.array([[3.0, 1.0, -0.5], [9.0, 1.0, -0.5]]))
    assert element[0] >= 0
    assert element[1] == -1


def test_the_mesh_ends_where_the_far_field_does() -> None:
    mesh = _mesh(Body(Disc(0.2)), [[3.0, 1.0]], ROUGH)
    away = np.linalg.norm(mesh.nodes[:, :2] - [3.0, 1.0], axis=1)
    assert 2.5 < away.max() < 4.5
    assert np.all(mesh.unknown[away > away.max() - 1e-9] == -1)


@pytest.mark.parametrize("place", [2.49, 2.6])
def test_a_punch_at_an_edge_is_refused(place: float) -> None:
    with pytest.raises(ValueError, match="edge of punch 0"):
        _mesh(Body(Disc(0.03)), [[place, 0]])


def test_pieces_of_an_edge_keep_its_corners_and_turn_little() -> None:
    square = edge_path(np.array([[1, 1], [-1, 1], [-1, -1], [1, -1.0]]))
    ends = square.at(pieces(square, lambda p: np.full(p.shape[:-1], 0.7)))
    assert all(np.min(np.linalg.norm(ends - corner, axis=1)) < 1e-12 for corner in square.corners)
    assert np.linalg.norm(np.diff(ends, axis=0), axis=1).max() <= 0.7
    angle = np.linspace(0, 2 * np.pi, 101)[:-1]
    circle = edge_path(np.column_stack([np.cos(angle), np.sin(angle)]))
    assert len(pieces(circle, lambda p: np.full(p.shape[:-1], 10.0))) - 1 in (8, 9)


def test_sizes_grow_from_the_end_of_the_contact() -> None:
    grading = Grading(0.02, 0.5)
    assert size(grading, ZONE, np.array([0.45, 0.4, 0.7]), np.zeros(3)) == pytest.approx([0.02, 0.02, 0.12])
    layers = heights(grading, ZONE, 0.7)
    assert (layers[0], layers[-1]) == (-1, 0)
    assert layers[-1] - layers[-2] <= 0.13
    assert 0.05 < core_radius(grading, ZONE) < 0.4
    assert core_radius(grading, Zone(0.4, 0.5, 0.5, tip=True)) < 0.02


def test_shapes_of_a_wedge_hold_what_is_quadratic() -> None:
    at, weight = gauss_points()
    value, slope = shapes(at)
    corners = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]])
    nodes = np.column_stack([np.tile(corners, (3, 1)), np.repeat([-1.0, 0, 1], 6)])
    s, t, w = nodes.T
    field = 1 + s - 2 * t * w + s * t + w**2
    assert value @ field == pytest.approx(1 + at[:, 0] - 2 * at[:, 1] * at[:, 2] + at[:, 0] * at[:, 1] + at[:, 2] ** 2)
    assert slope[..., 0].T.T @ field == pytest.approx(1 + at[:, 1])
    assert weight.sum() == pytest.approx(1)


def test_plates_hold_the_side_where_line_electrodes_lie_and_soft_ones_nothing() -> None:
    body, lines = Body(Disc(0.03)), Electrodes(count=8, width_m=0.004)
    none, least = np.empty((0, 2)), np.empty(0)
    assert not len(bodies_of(body, replace(lines, soft=True), none, least).plates)
    bodies = bodies_of(body, lines, none, least)
    mesh = layer_mesh(body, np.zeros((1, 2)), (ZONE,), (0.05,), WHOLE, bodies=bodies)
    side = (np.linalg.norm(mesh.nodes[:, :2], axis=1) > 3 - 1e-3) & (mesh.nodes[:, 2] > -0.9)
    angle = np.arctan2(mesh.nodes[side, 1], mesh.nodes[side, 0])
    away = np.abs(angle - np.round(angle / (np.pi / 4)) * np.pi / 4) * 30
    held = mesh.unknown[side, 0] < 0
    assert 2 - 0.01 < away[held].max() < 2 + 0.01 < away[~held].min()


@pytest.mark.parametrize(("body", "pads", "expected"), [
    (Body(HOLED), Electrodes(kind="surface", count=4, width_m=0.004, x_m=(-0.02, 0.0, 0.01, -0.01),
                             y_m=(0.01, 0.015, -0.015, -0.015)), 4 * np.pi * 0.2**2),
    (Body(Disc(0.03)), Electrodes(kind="patch", count=8, width_m=0.004, length_m=0.005), 8 * 0.4 * 0.5 * 55 / 60)])
def test_pads_are_followed_by_the_mesh_and_stand_on_it(body: Body, pads: Electrodes, expected: float) -> None:
    centre = np.array([[-0.5, 0.0]])
    bodies = bodies_of(body, pads, centre * body.thickness_m, np.array([0.005]))
    mesh = layer_mesh(body, centre, (ZONE,), (0.05,), WHOLE, bodies=bodies)
    corners = mesh.plan.nodes[mesh.plan.cells[mesh.plan.padded][:, :3]]
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    assert np.sum(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2 == pytest.approx(expected, rel=0.08)  # chords
    assert mesh.nodes[:, 2].max() > 0.1
    assert np.abs(mesh.nodes[mesh.flat.nodes][..., 2]).max() < 1e-9
    assert mesh.flat.weight.sum() + mesh.around.weight.sum() == pytest.approx(body.edge.area_m2 / 1e-4, rel=2e-3)
