"""Touches that edges change, as circles that scatter: rings where they are rings, a mesh's readings where not, the same
wherever the edges lie, with a symmetry and without one."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import SkinMesh, dissection, impedance, quadrature_points
from eitsim.electrics.cem.coupled_scattering import _joined, coupled_scattering
from eitsim.electrics.cem.floating_electrodes import Touches, floating
from eitsim.electrics.cem.ring_scattering import scattering
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.outline.ringed_mesh import outlined_mesh
from eitsim.scene.drive import read_out
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import touched_conductance, untouched_conductance
from matcal.laws.conductivity import Conductivity

LAW, SKIN, ORDERS = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)), Skin(strain="normal"), 12
BODY = Body(Outline("rectangle", width_m=0.12, height_m=0.08), 0.005)
L = Body(Outline("polygon", points_m=(
    (-0.06, -0.04), (0.06, -0.04), (0.06, 0.0), (0.02, 0.0), (0.02, 0.04), (-0.06, 0.04))), 0.005)
LINES = Electrodes(count=12, width_m=0.006)
SHEET_S = untouched_conductance(LAW, SKIN)
FAR_M = 1e3  # A straight edge is the rim of a disc so large.


def pressed() -> Touch:
    """A touch that squeezes the skin under a punch of 10 mm."""
    radius = np.linspace(0, 0.03, 121)
    normal, rest = 1 - 0.3 * np.exp(-(radius / 0.006) ** 4), np.ones_like(radius)
    return Touch(radius, 0 * rest, 0 * rest, rest, rest, normal, 1e4 * (radius < 0.005), 0.005, *[0.0] * 9, 0, (), 0.0)


def near_an_edge(gap_m: float, towards: tuple[float, float]) -> Touch:
    """The same, more squeezed and stretched on the side towards an edge that lies so far from its axis."""
    radius, share = np.linspace(0, gap_m, 25), np.linspace(0, 1, 25)
    there = np.exp(-(radius[:, None] / 0.008) ** 2) * (radius[:, None] / 0.008) * np.cos(np.pi * share)
    metric = np.stack([1 + 0.2 * there, 0.1 * there * np.sin(np.pi * share), 1 - 0.1 * there], axis=-1)
    rim = RimField(radius, share, np.zeros((25, 25, 3)), metric, 1 - 0.1 * there, FAR_M, FAR_M - gap_m,
                   np.array(towards))
    return replace(pressed(), rim=rim)


def near_edges(gap_m: float, towards: tuple[float, float], bearings: tuple[float, ...],
               width_m: float = 0.006) -> Touch:
    """The same towards edges in several directions from the nearest one, rad, that lie as far and change the touch the
    less each."""
    radius, share = np.linspace(0, gap_m, 25), np.linspace(0, 1, 65)
    metric, normal = np.tile([1.0, 0.0, 1.0], (25, 65, 1)), np.ones((25, 65))
    for k, bearing in enumerate(bearings):
        angle = 2 * np.pi * share - bearing
        there = np.exp(-(radius[:, None] / width_m) ** 2) * (radius[:, None] / width_m) * np.cos(angle) / (1 + k)
        c, s = np.cos(bearing), np.sin(bearing)
        xx, xy, yy = 0.2 * there, 0.1 * there * np.sin(angle), -0.1 * there
        metric += np.stack([c * c * xx - 2 * c * s * xy + s * s * yy, c * s * (xx - yy) + (c * c - s * s) * xy,
                            s * s * xx + 2 * c * s * xy + c * c * yy], axis=-1)
        normal -= 0.1 * there
    rim = RimField(radius, share, np.zeros((25, 65, 3)), metric, normal, np.inf, 0.0, np.array(towards),
                   whole_turn=True)
    return replace(pressed(), rim=rim)


@pytest.mark.thorough
@pytest.mark.parametrize("conductor", [False, True])
def test_an_axisymmetric_touch_scatters_as_its_rings(conductor):
    punch, touch = Punch(0.03, 0.02, conductor=conductor), pressed()
    tau = scattering(punch, touch, SKIN, LAW, 0.012, ORDERS, 16)
    found = coupled_scattering(punch, touch, SKIN, LAW, 0.012, ORDERS)
    off = np.abs(found - np.diag(np.tile(tau, 2))).max() / np.abs(tau).max()
    print(f"{off:.1e}")
    assert off < 2e-5


@pytest.mark.thorough
@pytest.mark.parametrize("conductor", [False, True])
def test_without_a_known_symmetry_one_edge_scatters_the_same(conductor):
    """The cubics along circles differ at their ends."""
    punch = Punch(0.03, 0.02, conductor=conductor)
    half, whole = (coupled_scattering(punch, touch, SKIN, LAW, 0.012, ORDERS) for touch in (
        near_an_edge(0.015, (0.6, 0.8)), near_edges(0.015, (0.6, 0.8), (0.0,), 0.008)))
    off = np.abs(whole - half).max() / np.abs(half).max()
    print(f"{off:.1e}")
    assert off < 1e-4


@pytest.mark.parametrize("touch", [near_an_edge(0.015, (0.6, 0.8)), near_edges(0.015, (0.6, 0.8), (0.0, 1.3, 4.0))])
def test_scattering_is_reciprocal_and_mixes_harmonics(touch):
    """m T_mn = n T_nm: what goes out of one harmonic by another is as much the other way round."""
    found = coupled_scattering(Punch(0.03, 0.02), touch, SKIN, LAW, 0.012, ORDERS)
    weighted = np.tile(np.arange(1, ORDERS + 1), 2)[:, None] * found
    np.testing.assert_allclose(weighted, weighted.T, atol=1e-10)
    mixed = weighted - np.diag(np.diag(weighted))
    assert np.abs(mixed).max() > 0.1 * np.abs(weighted).max()


@pytest.mark.parametrize("conductor", [False, True])
def test_rings_and_a_mesh_agree_within_their_estimates_near_an_edge(conductor):
    """In a fraction of the time."""
    punch, touch = Punch(0.01, 0.025, 0.01, conductor=conductor), near_an_edge(0.015, (0.0, 1.0))
    rings, mesh = (solve(BODY, SKIN, LINES, Drive(), ((punch, touch),), LAW, method=method, signal=2e-3)
                   for method in ("auto", "mesh"))
    off = np.linalg.norm(rings.signal_V - mesh.signal_V) / np.linalg.norm(mesh.signal_V)
    print(f"{off:.1e} {rings.signal_error:.1e} {mesh.signal_error:.1e} {rings.cpu_s:.3f} {mesh.cpu_s:.3f} s")
    assert rings.method == "multipole"
    assert off < rings.signal_error + mesh.signal_error
    axisymmetric = solve(BODY, SKIN, LINES, Drive(), ((punch, pressed()),), LAW).signal_V
    assert np.linalg.norm(axisymmetric - mesh.signal_V) > 0.01 * np.linalg.norm(mesh.signal_V)


@pytest.mark.thorough
@pytest.mark.parametrize("conductor", [False, True])
@pytest.mark.parametrize(("body", "place_m", "towards", "bearings"), [
    (BODY, (0.045, 0.025), (0.0, 1.0), (0.0, -np.pi / 2)),
    (replace(BODY, edge=replace(BODY.outline, height_m=0.031)), (0.01, 0.0005), (0.0, 1.0), (0.0, np.pi)),
    (replace(BODY, edge=replace(BODY.outline, holes_m=((0.01, 0.0, 0.01),))), (0.01, 0.025), (0.0, 1.0), (0.0, np.pi)),
    (L, (0.01, -0.01), (np.sqrt(0.5), np.sqrt(0.5)), (0.0,))],
    ids=["corner", "strip", "hole", "re-entrant corner"])
def test_rings_near_several_edges_are_off_a_finer_mesh_as_they_say(body, place_m, towards, bearings, conductor):
    """A mesh whose rings end at the touch's samples, outside which untouched readings are known to 2e-5."""
    lines = Scene(body, electrodes=LINES).electrodes
    touches = ((Punch(*place_m, 0.01, conductor=conductor), near_edges(0.014, towards, bearings)),)
    found = solve(body, SKIN, lines, Drive(), touches, LAW, signal=2e-3)
    mesh = outlined_mesh(body, lines, SHEET_S, touches, 2e-5, at_samples=True)
    known = signal_on(mesh, lines, touches)
    off = np.linalg.norm(found.signal_V - known) / np.linalg.norm(known)
    print(f"{off:.1e} {found.signal_error:.1e} {found.cpu_s:.3f} s, {len(mesh.nodes_m)} nodes")
    assert found.method == "multipole"
    assert off < min(5e-4, 3 * found.signal_error)


def signal_on(mesh: SkinMesh, lines: Electrodes, touches: Touches) -> np.ndarray:
    z, order, conductors = contact_impedances(lines), dissection(mesh), floating(mesh, touches)
    shunted = order if conductors is None else dissection(mesh, conductors)
    touched = touched_conductance(quadrature_points(mesh), touches, SKIN, LAW)
    return read_out(Drive(), impedance(mesh, touched, z, order=shunted, floating=conductors)
                    - impedance(mesh, np.full(len(mesh.cells), SHEET_S), z, order=order))


def test_a_turned_skin_has_the_same_signal_near_an_edge():
    signals = []
    for body, punch, towards, first in (
            (BODY, Punch(0.01, 0.025, 0.01), (0.0, 1.0), 0.0),
            (replace(BODY, edge=replace(BODY.outline, width_m=0.08, height_m=0.12)),
             Punch(-0.025, 0.01, 0.01), (-1.0, 0.0), np.pi / 2)):
        lines = replace(LINES, first_angle_rad=first)
        signals.append(solve(body, SKIN, lines, Drive(), ((punch, near_an_edge(0.015, towards)),), LAW).signal_V)
    assert np.linalg.norm(signals[1] - signals[0]) < 5e-4 * np.linalg.norm(signals[0])


@pytest.mark.thorough
def test_a_contact_that_reaches_the_edge_takes_a_mesh():
    touch = replace(near_an_edge(0.0052, (0.0, 1.0)), contact_radius_m=0.0055)
    punch = Punch(0.01, 0.0348, 0.01)
    assert solve(BODY, SKIN, LINES, Drive(), ((punch, touch),), LAW, signal=0.02).method == "mesh"
    with pytest.raises(ValueError, match="'multipole' needs a contact that ends before the edge"):
        solve(BODY, SKIN, LINES, Drive(), ((punch, touch),), LAW, method="multipole")


@pytest.mark.parametrize("punch", [False, True])
def test_joined_elements_have_the_admittance_of_one_dense_network(punch: bool) -> None:
    """All nodes but those of the outer end, and the punch, which draws no current, are eliminated at once."""
    rng, count, held = np.random.default_rng(1), 4, 0.7
    size = 3 * count + punch
    roots = rng.normal(size=(5, size, size))
    elements, core = roots @ roots.swapaxes(1, 2) + np.eye(size), rng.uniform(1, 2, count)
    whole = np.zeros((11 * count + punch,) * 2)
    for k, element in enumerate(elements):
        nodes = np.r_[2 * k * count + np.arange(3 * count), [11 * count] * punch].astype(int)
        whole[np.ix_(nodes, nodes)] += element
    whole[np.arange(count), np.arange(count)] += core
    if punch:
        ends = np.ix_([0, 11 * count], [0, 11 * count])
        whole[ends] += held * np.array([[1.0, -1.0], [-1.0, 1.0]])
    kept = np.arange(10 * count, 11 * count)
    rest = np.setdiff1d(np.arange(len(whole)), kept)
    expected = whole[np.ix_(kept, kept)] - whole[np.ix_(kept, rest)] @ np.linalg.solve(
        whole[np.ix_(rest, rest)], whole[np.ix_(rest, kept)])
    found = _joined(elements, core, held)
    assert np.triu(found) == pytest.approx(np.triu(expected), rel=1e-9)
