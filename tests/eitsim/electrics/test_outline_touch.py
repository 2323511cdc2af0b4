"""Touches on skins with an outline: equal to the disc's, with an estimate that holds, over electrodes too."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.forward.sheet_fields import skin_fields
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.imaging.images import reconstruct
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.outline.touch_mesh import touch_mesh
from eitsim.scene.edges.outline import Outline
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Scene, Skin
from matcal.laws.conductivity import Conductivity

LAW, SKIN = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)), Skin(strain="normal")
TURN = 2 * np.pi * np.arange(400) / 400
# The disc's area: corners as far outside its rim as chords lie inside.
POLYGON = Body(Outline("polygon", points_m=0.1 * np.sqrt(TURN[1] / np.sin(TURN[1])) * np.column_stack(
    [np.cos(TURN), np.sin(TURN)])))
EVEN = Scene(POLYGON).electrodes
RECTANGLE = Body(Outline("rectangle", width_m=0.2, height_m=0.14))
GRID = Electrodes(kind="surface", count=6, x_m=(-0.04, 0, 0.04) * 2, y_m=(-0.02,) * 3 + (0.02,) * 3, width_m=0.01)


def pressed(least: float = 0.7, pressure_Pa: float = 1e4) -> Touch:
    """A touch that squeezes the skin under a punch of 14 mm."""
    radius = np.linspace(0, 0.03, 121)
    normal = 1 - (1 - least) / (1 + (radius / 0.007) ** 8)
    rest = np.ones_like(radius)
    pressure = np.where(radius < 0.007, pressure_Pa, 0.0)
    return Touch(radius, 0 * rest, 0 * rest, rest, rest, normal, pressure, 0.007, *[0.0] * 9, 0, (), 0.0)


@pytest.mark.thorough
@pytest.mark.parametrize(("x_m", "y_m", "conductor"), [(0.03, 0.02, False), (-0.05, 0.01, False), (0.0, 0.04, True)])
def test_a_touch_on_a_polygon_of_400_corners_is_that_on_the_disc(x_m, y_m, conductor):
    punch = Punch(x_m, y_m, conductor=conductor)
    disc, found = (solve(body, SKIN, electrodes, Drive(), ((punch, pressed()),), LAW, signal=signal)
                   for body, electrodes, signal in ((Body(), Electrodes(), 1e-4), (POLYGON, EVEN, 2e-3)))
    off = np.linalg.norm(found.signal_V - disc.signal_V) / np.linalg.norm(disc.signal_V)
    assert off < 1e-3
    assert found.signal_error < 2e-3
    assert off < found.signal_error + disc.signal_error
    assert np.linalg.norm(found.baseline_V - disc.baseline_V) < 1e-4 * np.linalg.norm(disc.baseline_V)


def test_two_touches_are_those_of_the_disc_together():
    touches = ((Punch(0.03, 0.02), pressed()), (Punch(-0.03, 0.0), pressed(0.8)))
    disc, found = (solve(body, SKIN, electrodes, Drive(), touches, LAW, signal=2e-3).signal_V
                   for body, electrodes in ((Body(), Electrodes()), (POLYGON, EVEN)))
    assert np.linalg.norm(found - disc) < 1e-3 * np.linalg.norm(disc)


@pytest.mark.slow
@pytest.mark.parametrize(("x_m", "y_m", "conductor"), [(0.09, 0.045, False), (0.03, 0.02, True)])
def test_rings_on_an_l_with_a_hole_and_a_mesh_agree_within_their_estimates(x_m, y_m, conductor):
    """Far from all edges, and, conducting, two punches away from two of them."""
    body = Body(Outline("polygon", holes_m=((0.035, 0.14, 0.01),), points_m=(
        (0.0, 0.0), (0.2, 0.0), (0.2, 0.08), (0.08, 0.08), (0.08, 0.2), (0.0, 0.2))))
    touches, lines = ((Punch(x_m, y_m, conductor=conductor), pressed()),), Electrodes(count=24, width_m=0.008)
    rings, mesh = (solve(body, SKIN, lines, Drive(), touches, LAW, method=method, signal=4e-4)
                   for method in ("multipole", "mesh"))
    off = np.linalg.norm(rings.signal_V - mesh.signal_V) / np.linalg.norm(mesh.signal_V)
    assert rings.signal_error < 1e-3
    assert off < rings.signal_error + mesh.signal_error
    assert solve(body, SKIN, lines, Drive(), touches, LAW).method == "multipole"


def test_a_touch_may_lie_across_an_electrode_whose_area_stays():
    punch = Punch(0.033, 0.018)
    mesh = touch_mesh(RECTANGLE, GRID, 6e-4, ((punch, pressed()),))
    a, b, c = np.moveaxis(mesh.nodes_m[mesh.under[:, :3]], 1, 0)
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    np.testing.assert_allclose([area[mesh.electrode == k].sum() for k in range(6)], np.pi * 0.005**2, rtol=1e-9)
    found = solve(RECTANGLE, SKIN, GRID, Drive(), ((punch, pressed()),), LAW, signal=2e-3)
    finer = solve(RECTANGLE, SKIN, GRID, Drive(), ((punch, pressed()),), LAW, signal=2e-4)
    assert finer.unknowns > 3 * found.unknowns
    assert np.linalg.norm(found.signal_V - finer.signal_V) < found.signal_error * np.linalg.norm(finer.signal_V)


def test_a_turned_skin_has_the_same_signal():
    """A rectangle with a hole as a polygon, turned by an odd angle with all that lies on it."""
    angle = 0.7
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    corners = np.array([[0.1, 0.07], [-0.1, 0.07], [-0.1, -0.07], [0.1, -0.07]])
    hole, place = np.array([-0.05, 0.03]), np.array([0.02, 0.01])
    signals = []
    for q in (np.eye(2), turn):
        body = Body(Outline("polygon", points_m=corners @ q, holes_m=((*(hole @ q).tolist(), 0.01),)))
        first = 0.0 if q is not turn else angle
        electrodes = Scene(body, electrodes=Electrodes(count=12, first_angle_rad=first)).electrodes
        punch = Punch(*(place @ q).tolist())
        signals.append(solve(body, SKIN, electrodes, Drive(), ((punch, pressed()),), LAW, signal=1e-3).signal_V)
    assert np.linalg.norm(signals[1] - signals[0]) < 1e-3 * np.linalg.norm(signals[0])


def test_rings_under_electrodes_on_the_surface_and_contacts_that_reach_an_edge_are_refused():
    with pytest.raises(ValueError, match="'multipole' is built for line electrodes"):
        solve(RECTANGLE, SKIN, GRID, Drive(), ((Punch(), pressed()),), LAW, method="multipole")
    with pytest.raises(ValueError, match=r"reaches .* outside the nearest edge"):
        solve(POLYGON, SKIN, EVEN, Drive(), ((Punch(0.095), pressed()),), LAW, method="multipole")
    with pytest.raises(ValueError, match="reaches an edge of the skin, or its contact another one"):
        touch_mesh(POLYGON, EVEN, 6e-4, ((Punch(0.095), pressed()),))


def test_fields_conserve_current_on_the_mesh_of_the_touch():
    scene = Scene(RECTANGLE, (Punch(0.02, 0.01),), electrodes=Electrodes(count=12), skin=SKIN)
    points, (cell, numbers), fields = skin_fields(scene, (pressed(),), LAW, patterns=[0])
    assert cell == "triangle6"
    assert np.abs(points[:, 0]).max() == pytest.approx(0.1)
    assert np.ptp(fields["potential_V_00"]) > 0
    # the power put in by the electrodes is what the sheet, j . S^-1 j at the middles of sides, and their contacts take
    corners = points[numbers[:, :3]][..., :2]
    a, b, c = np.moveaxis(corners, 1, 0)
    area = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    current = fields["current_density_A_per_m_00"][:, :2].reshape(len(numbers), 6, 2)[:, 3:]
    sheet = fields["sheet_conductance_S"].reshape(-1, 3, 3)[:, :2, :2].reshape(len(numbers), 6, 2, 2)[:, 3:]
    heat = np.einsum("enx,enx->en", current, np.linalg.solve(sheet, current[..., None])[..., 0]).mean(axis=1) @ area
    z = solve(RECTANGLE, SKIN, scene.electrodes, Drive(), ((Punch(0.02, 0.01), pressed()),), LAW).impedance_Ohm
    put_in = 5e-3**2 * (z[0, 0] + z[1, 1] - 2 * z[0, 1])
    contacts = 2 * 5e-3**2 * 1.0 / 0.01
    assert put_in - 2 * contacts < heat < put_in - contacts


@pytest.mark.thorough
@pytest.mark.parametrize("electrodes", [Electrodes(count=16, width_m=0.008), Electrodes(
    kind="surface", count=20, x_m=np.tile(0.035 * np.arange(-2, 3), 4), y_m=np.repeat([-0.05, -0.017, 0.017, 0.05], 5),
    width_m=0.006)])
def test_an_image_finds_the_touch_on_any_skin(electrodes):
    hole = replace(RECTANGLE.outline, holes_m=((-0.085, 0.03, 0.008),))
    scene = Scene(replace(RECTANGLE, edge=hole), (Punch(0.02, 0.01),), SKIN, electrodes)
    solved = solve(scene.body, SKIN, scene.electrodes, Drive(), ((scene.punches[0], pressed()),), LAW)
    images = reconstruct(solved.touched_V, solved.baseline_V, scene=scene)
    (seen,) = images.seen
    assert seen.clear
    assert seen.blob is not None
    assert np.hypot(seen.blob.x_m - 0.02, seen.blob.y_m - 0.01) < 0.012
    assert images.pixels.area_m2.sum() == pytest.approx(0.2 * 0.14 - np.pi * 0.008**2, rel=1e-9)


def test_the_mesh_of_a_touch_can_be_halved_and_follows_the_fillet():
    mesh = touch_mesh(POLYGON, EVEN, 6e-4, ((Punch(0.03, 0.0), pressed()),))
    middle = mesh.nodes_m[mesh.cells[:, :3]].mean(axis=1)
    size = np.linalg.norm(mesh.nodes_m[mesh.cells[:, 0]] - mesh.nodes_m[mesh.cells[:, 1]], axis=1)
    away = np.hypot(middle[:, 0] - 0.03, middle[:, 1])
    assert size[np.abs(away - 0.007) < 3e-4].mean() < 0.4 * size[(away > 0.02) & (away < 0.04)].mean()
    halved = uniform_refinement(mesh)
    assert len(halved.cells) == 4 * len(mesh.cells)
