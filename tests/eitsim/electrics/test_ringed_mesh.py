"""Rings about touches on skins with an outline: they fill their circles, follow the contact, and cost little."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import SkinMesh, dissection, gradients, impedance, quadrature_points
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.mesh.graded_mesh import Touches
from eitsim.electrics.mesh.p2_triangles import EDGES, uniform_refinement
from eitsim.electrics.outline.ringed_mesh import outlined_mesh
from eitsim.electrics.outline.touch_mesh import touch_mesh
from eitsim.scene.drive import read_out
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import touched_conductance
from matcal.laws.conductivity import Conductivity

LAW, SKIN = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)), Skin(strain="normal")
RECTANGLE = Body(Outline("rectangle", width_m=0.2, height_m=0.14))
GRID = Electrodes(kind="surface", count=6, x_m=(-0.04, 0, 0.04) * 2, y_m=(-0.02,) * 3 + (0.02,) * 3, width_m=0.01)
L = Body(Outline("polygon", holes_m=((0.035, 0.14, 0.01),), points_m=(
    (0.0, 0.0), (0.2, 0.0), (0.2, 0.08), (0.08, 0.08), (0.08, 0.2), (0.0, 0.2))))
LINES = Electrodes(count=24, width_m=0.008)


def pressed(least: float = 0.7) -> Touch:
    """A touch that squeezes the skin under a punch of 14 mm."""
    radius = np.linspace(0, 0.03, 121)
    normal, rest = 1 - (1 - least) / (1 + (radius / 0.007) ** 8), np.ones_like(radius)
    return Touch(radius, 0 * rest, 0 * rest, rest, rest, normal, 1e4 * (radius < 0.007), 0.007, *[0.0] * 9, 0, (), 0.0)


PAIR = ((Punch(0.05, 0.0078), pressed()), (Punch(0.035, 0.117), pressed(0.8)))


def outer_sides(cells: np.ndarray) -> np.ndarray:
    side = np.vstack([cells[:, list(nodes)] for nodes in EDGES])
    _, first, times = np.unique(side[:, 2], return_index=True, return_counts=True)
    assert times.max() == 2
    return side[first[times == 1]]


def test_rings_fill_their_circles_and_leave_no_gap() -> None:
    """Next to an edge, and between a hole and nothing: the area is that of the skin, its edges are the only ones."""
    mesh = outlined_mesh(L, LINES, 6e-4, PAIR)
    hole = np.pi * 0.01**2
    area = gradients(mesh, np.zeros((len(mesh.nodes_m), 1)))[1]
    assert area.min() > 0
    assert area.sum() == pytest.approx(0.2 * 0.08 + 0.12 * 0.08 - hole, rel=1e-9)
    ends = mesh.nodes_m[outer_sides(mesh.cells)[:, :2]]
    around = 2 * 72 * 0.01 * np.sqrt(np.tan(np.pi / 72) * np.pi / 72)
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(0.8 + around, rel=1e-3)


def test_rings_have_lines_at_the_edge_of_the_punch_and_the_start_of_its_fillet() -> None:
    mesh = outlined_mesh(RECTANGLE, LINES, 6e-4, ((Punch(0.03, 0.02), pressed()),))
    away = np.hypot(*(mesh.nodes_m - [0.03, 0.02]).T)
    for line in (0.007, 0.0065):
        assert np.sum(np.abs(away - line) < 1e-12) >= 24


def test_rings_end_at_the_samples_where_that_is_asked_for() -> None:
    """As far as the rings go."""
    punch, touch = Punch(0.03, 0.02), pressed()
    plain, found = (outlined_mesh(RECTANGLE, LINES, 6e-4, ((punch, touch),), at_samples=on) for on in (False, True))
    away = np.hypot(*(found.nodes_m - [0.03, 0.02]).T)
    assert all(np.sum(np.abs(away - radius) < 1e-9) >= 24 for radius in touch.radius_m[1:60])
    assert len(found.nodes_m) > len(plain.nodes_m)
    area = gradients(found, np.zeros((len(found.nodes_m), 1)))[1]
    assert area.min() > 0
    assert area.sum() == pytest.approx(0.2 * 0.14, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("touches", [PAIR[:1], PAIR], ids=["0.8 mm from an edge", "and next to a hole"])
def test_less_than_half_the_nodes_give_the_signal_as_exactly_as_estimated(touches) -> None:
    """Below the estimate and within a factor of 3, against the triangles on which the untouched readings are known to
    1e-4; closer to these than even triangles, more than twice as many."""
    found = solve(L, SKIN, LINES, Drive(), touches, LAW, method="mesh", signal=4e-3)
    fine, plain = outlined_mesh(L, LINES, 6e-4, touches, 1e-4), uniform_refinement(touch_mesh(L, LINES, 6e-4, touches))
    known, even = signal_on(fine, touches), signal_on(plain, touches)
    off, even_off = (np.linalg.norm(one - known) / np.linalg.norm(known) for one in (found.signal_V, even))
    print(f"{off:.1e}, estimated {found.signal_error:.1e}, {found.unknowns} unknowns; {even_off:.1e}, "
          f"{len(plain.nodes_m)} nodes")
    assert found.signal_error / 3 < off < found.signal_error < 4e-3
    assert off < even_off
    assert 2 * found.unknowns < len(plain.nodes_m)


def signal_on(mesh: SkinMesh, touches: Touches) -> np.ndarray:
    z, order = contact_impedances(LINES), dissection(mesh)
    sheet = touched_conductance(quadrature_points(mesh), touches, SKIN, LAW)
    return read_out(Drive(), impedance(mesh, sheet, z, order=order)
                    - impedance(mesh, np.full(len(mesh.cells), 6e-4), z, order=order))


def test_under_electrodes_on_the_surface_there_are_no_rings() -> None:
    over, clear = (((Punch(x, 0.0), pressed()),) for x in (0.035, 0.075))
    plain, ringed = (outlined_mesh(RECTANGLE, GRID, 6e-4, touches) for touches in (over, clear))
    np.testing.assert_array_equal(plain.cells, touch_mesh(RECTANGLE, GRID, 6e-4, over).cells)
    away = np.hypot(*(ringed.nodes_m - [0.075, 0.0]).T)
    assert np.sum(np.abs(away - 0.007) < 1e-12) >= 24
    a, b, c = np.moveaxis(ringed.nodes_m[ringed.under[:, :3]], 1, 0)
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    np.testing.assert_allclose([area[ringed.electrode == k].sum() for k in range(6)], np.pi * 0.005**2, rtol=1e-9)


def test_triangles_follow_the_end_of_a_contact_that_an_edge_cuts() -> None:
    """No ring does: rings stay on the skin all around."""
    punch = Punch(0.05, 0.0078)
    mesh = outlined_mesh(L, LINES, 6e-4, ((punch, replace(pressed(), contact_radius_m=0.0085)),))
    side = np.sqrt(gradients(mesh, np.zeros((len(mesh.nodes_m), 1)))[1].sum(axis=1) / 0.433)
    away = np.linalg.norm(mesh.nodes_m[mesh.cells[:, :3]].mean(axis=1) - [0.05, 0.0078], axis=1)
    at_end = side[np.abs(away - 0.0085) < 1e-4]
    assert at_end.max() < 3e-4
    assert np.median(side[np.abs(away - 0.011) < 2e-4]) > 3 * np.median(at_end)


def test_a_contact_that_reaches_over_an_edge_is_served_with_its_end_on_the_skin() -> None:
    """The punch stays on the skin, what it presses bulges over the edge."""
    punch = Punch(0.05, 0.0078)
    touches = ((punch, replace(pressed(), contact_radius_m=0.0085)),)
    mesh = outlined_mesh(L, LINES, 6e-4, touches)
    area = gradients(mesh, np.zeros((len(mesh.nodes_m), 1)))[1]
    assert area.min() > 0
    assert area.sum() == pytest.approx(0.2 * 0.08 + 0.12 * 0.08 - np.pi * 0.01**2, rel=1e-9)
    with pytest.raises(ValueError, match="a punch reaches an edge of the skin"):
        outlined_mesh(L, LINES, 6e-4, ((replace(punch, y_m=0.0069), pressed()),))
