"""Conducting punches on meshes: against rings that scatter and closed forms, balance, symmetry, both limits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import iv, ivp

from eitsim.electrics.cem.assembly import dissection, impedance, potentials, quadrature_points
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.cem.floating_electrodes import floating, shunt, shunt_ends, shunts
from eitsim.electrics.cem.ring_scattering import impedance_change, on_disc
from eitsim.electrics.forward.disc_electrics import following_mesh
from eitsim.electrics.forward.sheet_fields import skin_fields
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.mesh.graded_mesh import triangulation
from eitsim.electrics.mesh.p2_triangles import uniform_refinement
from eitsim.electrics.mesh.symmetric_mesh import alike_mesh
from eitsim.scene.drive import read_out
from eitsim.scene.electrodes import Electrodes, contact_impedances
from eitsim.scene.results import RimField, Touch
from eitsim.scene.scene import Body, Drive, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import touched_conductance
from matcal.laws.conductivity import Conductivity

LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
SHEET, EDGE = 6e-4, 7.2e-3
PUNCH = Punch(0.03, 0.01, conductor=True)
LINES, PATCHES = Electrodes(), Electrodes(kind="patch")


def pressed(areal: float = 1.1, normal: float = 0.6) -> Touch:
    """A skin stretched alike in both directions inside the contact, which ends a little beyond the punch's edge."""
    r = np.unique(np.concatenate([np.linspace(0, EDGE, 30), [EDGE * (1 + 1e-9)], np.geomspace(8e-3, 0.09, 40)]))
    inside = r <= EDGE
    stretch, through = np.where(inside, np.sqrt(areal), 1.0), np.where(inside, normal, 1.0)
    return Touch(r, 0 * r, 0 * r, stretch, stretch, through, np.where(inside, 1e3, 0.0), EDGE, *[0.0] * 9, 0, (), 0.0)


def clipped(touch: Touch) -> Touch:
    """The touch with a field of the rim that changes nothing, which takes it to the mesh."""
    radius, share = np.linspace(0, 0.02, 5), np.linspace(0, 1, 6)
    one = np.ones((5, 6))
    return replace(touch, rim=RimField(radius, share, np.zeros((5, 6, 3)), np.broadcast_to([1.0, 0, 1], (5, 6, 3)), one,
                                       0.1, 0.03))


def relative(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def readings(*touches: tuple[Punch, Touch], method: str = "mesh", electrodes: Electrodes = LINES, signal: float = 2e-3):
    return solve(Body(), Skin(), electrodes, Drive(), touches, LAW, signal=signal, method=method)


def change(mesh, touches, electrodes=LINES):
    sheet = touched_conductance(quadrature_points(mesh), touches, Skin(), LAW)
    z = contact_impedances(electrodes)
    return (impedance(mesh, sheet, z, floating=floating(mesh, touches))
            - impedance(mesh, np.full(len(mesh.cells), SHEET), z))


def with_z(z: float, punch: Punch = PUNCH) -> Punch:
    return replace(punch, contact_impedance_Ohm_m2=z)


def test_the_shunt_ends_with_the_contact_and_follows_the_stretched_area():
    touch = pressed()
    radius = np.array([0.0, 0.99 * EDGE, 1.01 * EDGE])
    np.testing.assert_allclose(shunt(with_z(1e-4), touch, radius, 1.1 * np.ones(3)), [1.1e4, 1.1e4, 0.0])
    assert shunt_ends(PUNCH, touch) == [EDGE]
    assert not shunt(replace(PUNCH, conductor=False), touch, radius, np.ones(3)).any()
    assert shunt_ends(replace(PUNCH, conductor=False), touch) == []
    hollow = replace(touch, pressure_Pa=np.where(touch.radius_m < 3e-3, 0.0, touch.pressure_Pa))
    outer, inner = shunt_ends(PUNCH, hollow)
    assert outer == EDGE
    assert hollow.pressure_Pa[touch.radius_m <= inner].max() == 0
    between = shunt(PUNCH, hollow, np.array([inner * 0.999, inner * 1.001]), np.ones(2))
    assert between[0] == 0 < between[1]


def test_a_contact_that_is_not_round_shunts_as_far_as_it_goes_in_each_direction():
    angle = 2 * np.pi * np.arange(64) / 64
    ends = 0.004 / np.sqrt(np.cos(angle) ** 2 + 4 * np.sin(angle) ** 2)  # half axes of 4 and 2 mm
    touch = replace(pressed(), contact_radius_m=0.004, contact_ends_m=ends)
    x, y = np.meshgrid(*[np.linspace(-0.005, 0.005, 41) + 1e-5] * 2)
    (found,) = shunts(np.stack([x + PUNCH.x_m, y + PUNCH.y_m], axis=-1), ((PUNCH, touch),))
    away = np.hypot(x, 2 * y)
    assert np.all(found[away < 0.0038] > 0)
    assert np.all(found[away > 0.0042] == 0)


@pytest.mark.parametrize("z", [1e-2, 1e-4])
def test_the_mesh_converges_to_the_closed_form(z):
    """A floating disc on a flat sheet: inside u is a modified Bessel function of rho sqrt(1 / (z S))."""
    order, reach = np.arange(1, 13), 0.05
    touch, punch = pressed(1.0, 1.0), with_z(z)
    rate = EDGE / np.sqrt(z * SHEET)
    y = rate * ivp(order, rate) / iv(order, rate)
    tau = (order - y) / (order + y) * (EDGE / reach) ** (2 * order)
    circles = [(complex(punch.x_m, punch.y_m), reach)]
    exact = impedance_change(on_disc(solve_rim(Body(), LINES, SHEET), Body(), LINES, circles, 12, 128), SHEET, tau)
    errors = [relative(change(alike_mesh(Body(), LINES, ((punch, touch),), level), ((punch, touch),)), exact)
              for level in (1, 2, 4)]
    print(errors)
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert errors[2] < 1e-4


@pytest.mark.parametrize("z", [1e-9, 1e-6, 1e-4, 1e-2])
def test_mesh_and_rings_agree_within_their_estimates(z):
    one, other = (readings((with_z(z), pressed()), method=method) for method in ("mesh", "multipole"))
    off = relative(one.signal_V, other.signal_V)
    print(z, off, one.signal_error, other.signal_error)
    assert off < one.signal_error + other.signal_error
    assert one.signal_error < 2e-3


def test_a_punch_lets_no_current_out_and_readings_stay_reciprocal():
    other = (Punch(-0.05, 0.0, conductor=True, contact_impedance_Ohm_m2=1e-3), pressed())
    touches = ((PUNCH, pressed()), other)
    mesh = following_mesh(Body(), LINES, touches, 1)
    conductors = floating(mesh, touches)
    assert conductors is not None
    assert conductors.count == 2
    sheet = touched_conductance(quadrature_points(mesh), touches, Skin(), LAW)
    found = potentials(mesh, sheet, 1.0, floating=conductors)
    i, j = np.triu_indices(mesh.cells.shape[1] + 1, 1)
    unknown = np.column_stack([conductors.under, len(mesh.nodes_m) + conductors.conductor])
    flow = conductors.weights[..., None] * (found[unknown[:, i]] - found[unknown[:, j]])
    into = flow[:, j == mesh.cells.shape[1]]
    for k in range(2):
        own = into[conductors.conductor == k]
        assert np.abs(own.sum(axis=(0, 1))).max() < 1e-12 * np.abs(own).sum(axis=(0, 1)).max()
    z = impedance(mesh, sheet, 1.0, floating=conductors)
    assert np.abs(z - z.T).max() < 1e-12 * np.abs(z).max()
    assert np.abs(z.sum(axis=0)).max() < 1e-12 * np.abs(z).max()
    np.testing.assert_allclose(found[-16:] - found[-16:].mean(axis=0), z, atol=1e-10 * np.abs(z).max())


@pytest.mark.parametrize("electrodes", [LINES, PATCHES], ids=["lines", "patches"])
def test_a_poor_contact_is_none_and_a_good_one_a_metal_disc(electrodes):
    touch = pressed()
    bare, poor, good, best = (
        readings((punch, touch), electrodes=electrodes).signal_V
        for punch in (replace(PUNCH, conductor=False), with_z(1e6), with_z(1e-8), with_z(1e-9)))
    assert relative(poor, bare) < 1e-6
    assert relative(good, best) < 1e-3
    mesh = uniform_refinement(triangulation(Body(), electrodes, ((PUNCH, touch),)))
    points, z = quadrature_points(mesh), contact_impedances(electrodes)
    sheet = touched_conductance(points, ((PUNCH, touch),), Skin(), LAW)
    metal = sheet + np.where(shunts(points, ((PUNCH, touch),))[0] > 0, 1e4, 0.0)[..., None, None] * np.eye(2)
    disc = impedance(mesh, metal, z) - impedance(mesh, np.full(len(mesh.cells), SHEET), z)
    off = relative(best, read_out(Drive(), disc))
    print("against a metal disc:", off)
    assert off < 3e-3
    assert relative(best, bare) > 0.1


def test_touches_near_the_rim_and_several_float_each_by_itself():
    """A field of the rim that changes nothing gives what the rings give, two punches on one potential do not."""
    one = (PUNCH, pressed())
    near = readings((PUNCH, clipped(pressed())), method="auto")
    assert near.method == "mesh"
    assert relative(near.signal_V, readings(one, method="multipole").signal_V) < 2 * near.signal_error
    pair = one, (replace(PUNCH, x_m=-0.02), pressed())
    got, rings = readings(*pair), readings(*pair, method="multipole")
    assert relative(got.signal_V, rings.signal_V) < got.signal_error + rings.signal_error
    mesh = triangulation(Body(), LINES, pair)
    apart = floating(mesh, pair)
    assert apart is not None
    joined = replace(apart, conductor=np.zeros_like(apart.conductor), count=1)
    sheet = touched_conductance(quadrature_points(mesh), pair, Skin(), LAW)
    own, common = (impedance(mesh, sheet, 1.0, floating=f) for f in (apart, joined))
    assert relative(common, own) > 0.01


def test_turned_and_mirrored_scenes_read_alike():
    touch = clipped(pressed())
    z = readings((PUNCH, touch)).impedance_Ohm
    mirrored = readings((replace(PUNCH, y_m=-PUNCH.y_m), touch)).impedance_Ohm
    mirror = -np.arange(16) % 16
    assert relative(mirrored, z[np.ix_(mirror, mirror)]) < 1e-10
    turn = np.exp(0.5j * np.pi) * complex(PUNCH.x_m, PUNCH.y_m)
    turned = readings((replace(PUNCH, x_m=turn.real, y_m=turn.imag), touch)).impedance_Ohm
    assert relative(turned, np.roll(z, (4, 4), axis=(0, 1))) < 1e-10


def test_an_order_for_other_conductors_is_refused():
    touches = ((PUNCH, pressed()),)
    mesh = following_mesh(Body(), LINES, touches, 1)
    sheet, conductors = np.full(len(mesh.cells), SHEET), floating(mesh, touches)
    with pytest.raises(ValueError, match="order of elimination"):
        impedance(mesh, sheet, 1.0, order=dissection(mesh), floating=conductors)
    with pytest.raises(ValueError, match="lies between the points"):
        floating(mesh, ((PUNCH, replace(pressed(), pressure_Pa=0 * pressed().pressure_Pa)),))


def test_fields_under_a_punch_balance_and_show_it_shorted():
    scene = Scene(punches=(with_z(1e-6), Punch(-0.04, 0.0, conductor=False)))
    points, (_, cells), fields = skin_fields(scene, [pressed(), pressed()], LAW, patterns=[3])
    under = fields["contact_conductance_S_per_m2"] > 0
    away = np.hypot(points[:, 0] - PUNCH.x_m, points[:, 1] - PUNCH.y_m)
    assert under.any()
    assert away[under].max() < EDGE * (1 + 1e-6)
    assert np.ptp(fields["shorted_potential_V_03"][under]) == 0
    np.testing.assert_array_equal(fields["shorted_potential_V_03"][~under], fields["potential_V_03"][~under])
    assert np.ptp(fields["potential_V_03"][under]) < 0.2 * np.ptp(fields["untouched_potential_V_03"][under])
    assert not fields["into_punch_A_per_m2_03"][~under].any()
    corners = cells[under[cells].all(axis=1)][:, :3]
    one, other = (points[corners[:, k], :2] - points[corners[:, 0], :2] for k in (1, 2))
    area = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]) / 2
    mean = fields["into_punch_A_per_m2_03"][cells[under[cells].all(axis=1)]].mean(axis=1)
    assert abs(mean @ area) < 0.05 * np.abs(mean) @ area
