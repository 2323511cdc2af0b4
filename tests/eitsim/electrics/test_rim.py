"""The untouched skin without a mesh."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from eitsim.electrics.cem.adjoint import impedance_by_contact
from eitsim.electrics.cem.assembly import SkinMesh, impedance, potentials
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.disc_electrics import DiscSkin
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.mesh.ring_mesh import ring_mesh
from eitsim.scene.drive import read_out
from eitsim.scene.edges.disc import Disc
from eitsim.scene.electrodes import arcs, contact_impedances, middles, present, widths
from eitsim.scene.scene import Body, Drive, Electrodes

REFERENCE = Path(__file__).parents[3].parent / "shared" / "reference" / "eit" / "analytic_homog_single.csv"


UNEQUAL = Electrodes(count=6, angles_rad=(0.1, 0.5, 1.2, 2.9, 4.0, 5.5), width_m=(0.01, 0.04, 0.03, 0.002, 0.02, 0.1),
                     contact_impedance_Ohm_m=(1.0, 0.05, 10.0, 0.3, 2.0, 1.0))
FULL_M = 2 * np.pi * 0.1


@pytest.mark.skipif(not REFERENCE.exists(), reason="the reference values are not beside the checkout")
def test_readings_equal_the_mesh_free_reference():
    expected = np.loadtxt(REFERENCE, delimiter=",")
    readings = read_out(Drive(), solve_rim(Body(), Electrodes(), 1e-3).impedance_Ohm)
    assert np.abs(readings / expected - 1).max() < 1e-11


@pytest.mark.parametrize(("body", "electrodes"), [
    (Body(), Electrodes(contact_impedance_Ohm_m=1e-6)),
    (Body(Disc(0.05)), Electrodes(count=7, width_m=0.02, first_angle_rad=0.4, contact_impedance_Ohm_m=30.0)),
    (Body(), UNEQUAL)])
def test_impedance_agrees_with_a_mesh(body, electrodes):
    mesh = graded_mesh(body, electrodes)
    meshed = impedance(mesh, np.full(len(mesh.cells), 6e-4), contact_impedances(electrodes))
    exact = solve_rim(body, electrodes, 6e-4).impedance_Ohm
    error = np.abs(meshed - exact).max() / np.abs(exact).max()
    print(f"{electrodes.count} electrodes, z = {electrodes.contact_impedance_Ohm_m}: {error:.1e}")
    assert error < 3e-4


@pytest.mark.parametrize("electrodes", [Electrodes(count=7, width_m=0.02, first_angle_rad=0.4), UNEQUAL])
def test_contact_impedances_change_it_as_adjoint_fields_of_a_mesh_say(electrodes):
    mesh, z = graded_mesh(Body(), electrodes), contact_impedances(electrodes)
    sheet = np.full(len(mesh.cells), 6e-4)
    adjoint = impedance_by_contact(mesh, potentials(mesh, sheet, z), z) * z[:, None, None]
    without = np.array(DiscSkin(Body(), electrodes, 6e-4).by_log_contact())
    assert np.abs(without - adjoint).max() < 1e-3 * np.abs(adjoint).max()


NEAR = 0.4 ** np.arange(9, -1, -1)
RINGS = np.concatenate([np.linspace(0, 0.5, 3), 1 - 0.5 ** np.arange(1.5, 14, 0.5), [1.0]])


def graded_mesh(body: Body, electrodes: Electrodes, level: int = 1, near: np.ndarray = NEAR,
                rings: np.ndarray = RINGS) -> SkinMesh:
    """Angles that near the ends of the electrodes, and rings that near the rim; each step cut in `level`."""
    near = near / 2
    points = cut(np.concatenate([[0.0], near, 1 - near[-2::-1], [1.0]]), level)[:-1]
    ends = arcs(body.radius_m, electrodes)
    following = np.append(ends[1:, 0], ends[0, 0] + 2 * np.pi)
    angles = [a + (b - a) * points for pair in zip(ends[:, 0], ends[:, 1], following, strict=True)
              for a, b in pairwise(pair)]
    electrode = np.repeat([k // 2 if k % 2 == 0 else -1 for k in range(2 * electrodes.count)], len(points))
    radii = body.radius_m * cut(rings, level)
    return ring_mesh(radii, np.zeros((len(radii), 2)), np.concatenate(angles), electrode, electrodes.count)


def cut(points: np.ndarray, parts: int) -> np.ndarray:
    return np.interp(np.arange(parts * (len(points) - 1) + 1) / parts, np.arange(len(points)), points)


def test_only_the_product_of_conductance_and_contact_impedance_matters_beside_the_scale():
    one = solve_rim(Body(), Electrodes(contact_impedance_Ohm_m=1.0), 6e-4).impedance_Ohm
    other = solve_rim(Body(), Electrodes(contact_impedance_Ohm_m=0.1), 6e-3).impedance_Ohm
    np.testing.assert_allclose(one, 10 * other, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("turn", [0.4, -2.0])
def test_fields_turn_with_the_electrodes_and_keep_their_ratio_to_the_size(turn: float) -> None:
    rng = np.random.default_rng(1)
    r, angle = 0.08 * np.sqrt(rng.random(6)), rng.uniform(0, 2 * np.pi, 6)

    def places(by: float, size: float) -> np.ndarray:
        return size * np.column_stack([r * np.cos(angle + by), r * np.sin(angle + by)])

    straight = DiscSkin(Body(), Electrodes(count=7), 1e-3).slopes(places(0, 1))
    turned = DiscSkin(Body(), Electrodes(count=7, first_angle_rad=turn), 1e-3).slopes(places(turn, 1))
    np.testing.assert_allclose(turned, straight * np.exp(-1j * turn), rtol=1e-9, atol=1e-9 * np.abs(straight).max())
    half = Electrodes(count=7, width_m=0.005, contact_impedance_Ohm_m=0.5)
    small = DiscSkin(Body(Disc(0.05)), half, 1e-3).slopes(places(0, 0.5))
    np.testing.assert_allclose(small, 2 * straight, rtol=1e-9, atol=1e-9 * np.abs(straight).max())


def test_impedance_is_symmetric_positive_and_circulant():
    z = solve_rim(Body(), Electrodes(), 6e-4).impedance_Ohm
    assert np.abs(z - z.T).max() < 1e-12 * np.abs(z).max()
    assert np.abs(np.roll(z, (1, 1), (0, 1)) - z).max() < 1e-12 * np.abs(z).max()
    assert np.linalg.eigvalsh(z)[1] > 0


def unlike(electrodes: Electrodes) -> Electrodes:
    """The same ring with its angles written out, which couples the electrodes in one dense system."""
    return replace(electrodes, first_angle_rad=0.0, angles_rad=tuple(middles(electrodes)))


@pytest.mark.parametrize("kind", ["line", "patch"])
def test_what_is_kept_between_calls_cannot_be_overwritten(kind: str):
    with pytest.raises(ValueError, match="read-only"):
        untouched_impedance(Body(), Electrodes(kind=kind), 6e-4)[0, 0] = 0.0


@pytest.mark.parametrize("electrodes", [
    Electrodes(), Electrodes(count=4, width_m=0.15), Electrodes(width_m=0.038), Electrodes(count=64, width_m=0.0005)])
def test_modes_around_the_ring_and_one_dense_system_agree(electrodes):
    modes, dense = solve_rim(Body(), electrodes, 6e-4), solve_rim(Body(), unlike(electrodes), 6e-4)
    for name in ("impedance_Ohm", "driven", "same", "crossed"):
        one, other = getattr(modes, name), getattr(dense, name)
        assert np.abs(one - other).max() < 1e-11 * np.abs(one).max(), name


def test_unequal_electrodes_equal_graded_quadratic_meshes_to_a_millionth():
    ring = Electrodes(count=8, width_m=(0.01, 0.03, 0.02, 0.005, 0.02, 0.04, 0.01, 0.03),
                      angles_rad=(0.1, 0.9, 1.7, 2.3, 3.2, 4.0, 4.8, 5.7),
                      contact_impedance_Ohm_m=(1.0, 0.05, 10.0, 0.3, 2.0, 1.0, 1.0, 0.5))
    rings = np.concatenate([[0.0, 0.25], 1 - 0.5 ** np.arange(1, 12), [1.0]])
    meshes = [graded_mesh(Body(), ring, level, 0.5 ** np.arange(10, -1, -1), rings) for level in (2, 3)]
    coarse, fine = (impedance(mesh, np.full(len(mesh.cells), 6e-4), contact_impedances(ring)) for mesh in meshes)
    ends = coarse, fine, fine + (fine - coarse) / (1.5**3.5 - 1)
    exact = solve_rim(Body(), ring, 6e-4).impedance_Ohm
    errors = [np.abs(z - exact).max() / np.abs(exact).max() for z in ends]
    print(f"two meshes and their limit at a rate of 3.5: {errors}")
    assert errors[1] < errors[0] / 1.5**3
    assert errors[2] < 1e-6


def test_unequal_electrodes_balance_and_are_passive():
    """Reciprocity cannot be read off: the impedance is made symmetric before it is given."""
    z = solve_rim(Body(), UNEQUAL, 6e-4).impedance_Ohm
    assert np.abs(z.sum(axis=0)).max() < 1e-12 * np.abs(z).max()
    assert np.linalg.eigvalsh(z)[1] > 0


def test_poor_contacts_give_each_electrode_its_own_impedance():
    """U = z I / width beside what little the skin needs."""
    poor = replace(UNEQUAL, contact_impedance_Ohm_m=tuple((1e7 * contact_impedances(UNEQUAL)).tolist()))
    own = np.diag(contact_impedances(poor) / widths(poor))
    centre = np.eye(6) - 1 / 6
    assert np.abs(solve_rim(Body(), poor, 6e-4).impedance_Ohm - centre @ own @ centre).max() < 1e-6 * own.max()


def test_poor_contacts_reflect_waves_by_ohms_law_alone():
    """In the limit S z / R >> 1 the inflow is (U - g) / z, U the mean of g on the electrode, and a_n its component n
    over n: both parts of the field that floating electrodes add."""
    z, body, sheet = 1e5, Body(), 1e-3
    electrodes = Electrodes(count=3, angles_rad=(0.2, 1.5, 4.0), width_m=(0.05, 0.02, 0.08), contact_impedance_Ohm_m=z)
    rim, n = solve_rim(body, electrodes, sheet), np.arange(1, 9)
    same = np.zeros((2, len(n), len(n)), complex)
    for start, stop in arcs(body.radius_m, electrodes) - electrodes.first_angle_rad:
        for part, sign in zip(same, (1, -1), strict=True):
            within = integral(sign * n[None, :] - n[:, None], start, stop)
            part -= within - integral(-n, start, stop)[:, None] * integral(sign * n, start, stop) / (stop - start)
    same /= 2 * np.pi * sheet * z / body.radius_m * n[:, None]
    for found, expected in zip((rim.same, rim.crossed), same, strict=True):
        assert np.abs(found[:len(n), :len(n)] - expected).max() < 2e-3 * np.abs(expected).max()


def integral(k: np.ndarray, start: float, stop: float) -> np.ndarray:
    """Of exp(i k theta) over an arc."""
    safe = np.where(k == 0, 1, k)
    return np.where(k == 0, stop - start, (np.exp(1j * safe * stop) - np.exp(1j * safe * start)) / (1j * safe))


def test_an_electrode_that_lets_nothing_through_is_none():
    kept, centre = [0, 1, 2, 3, 5], np.eye(5) - 1 / 5
    five = solve_rim(Body(), present(replace(UNEQUAL, missing=(4,))), 6e-4).impedance_Ohm
    gaps = []
    for poor in (1e6, 1e8):
        z = (1.0, 0.05, 10.0, 0.3, poor, 1.0)
        six = solve_rim(Body(), replace(UNEQUAL, contact_impedance_Ohm_m=z), 6e-4).impedance_Ohm[np.ix_(kept, kept)]
        gaps.append(np.abs(five - centre @ six @ centre).max() / np.abs(five).max())
    print(gaps)
    assert gaps[1] < 1e-6
    assert gaps[0] == pytest.approx(100 * gaps[1], rel=0.05)


def test_electrodes_that_nearly_touch_end_where_those_that_touch_are():
    rings = [Electrodes(width_m=FULL_M / 16 - gap) for gap in (0.0, 1e-9, 1e-7, 1e-5)]
    z = [solve_rim(Body(), ring, 6e-4).impedance_Ohm for ring in rings]
    steps = [np.abs(other - z[0]).max() / np.abs(z[0]).max() for other in z[1:]]
    print(steps)
    np.testing.assert_allclose(steps[1:], [100 * steps[0], 1e4 * steps[0]], rtol=0.05)
    assert steps[0] < 1e-6


@pytest.mark.thorough
@pytest.mark.parametrize("count", [4, 5, 33, 64])
def test_any_count_that_touches_conducts(count):
    z = solve_rim(Body(), Electrodes(count=count, width_m=FULL_M / count), 6e-4).impedance_Ohm
    assert np.abs(np.roll(z, (1, 1), (0, 1)) - z).max() < 1e-12 * np.abs(z).max()
    assert np.linalg.eigvalsh(z)[1] > 0


def test_what_is_not_resolved_is_refused_with_the_mend():
    with pytest.raises(ValueError, match=r"electrodes 0 and 1 .* touch.*leave a gap of .* mm, or give them .* Ohm m"):
        solve_rim(Body(), Electrodes(count=4, width_m=FULL_M / 4, contact_impedance_Ohm_m=1e-5), 6e-4)
    with pytest.raises(ValueError, match=r"64 electrodes that are not identical .* 8192 coupled unknowns"):
        solve_rim(Body(), Electrodes(count=64, width_m=0.009, contact_impedance_Ohm_m=(1.0,) * 63 + (2.0,)), 6e-4)
    with pytest.raises(ValueError, match="patches need a mesh"):
        solve_rim(Body(), Electrodes(kind="patch"), 6e-4)
