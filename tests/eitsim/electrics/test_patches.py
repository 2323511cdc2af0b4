"""Patch electrodes: sectors of the surface along the rim, on meshes of two families."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import SkinMesh, gradients, impedance, potentials
from eitsim.electrics.cem.assembly import quadrature_points as points_of
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.disc_electrics import following_mesh
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.electrics.mesh.graded_mesh import triangulation
from eitsim.electrics.mesh.ring_mesh import template
from eitsim.electrics.outline.patched_disc import patched_disc_mesh
from eitsim.scene.electrodes import Electrodes, contact_impedances
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Punch, Skin
from eitsim.sheet.sheet_conductance import touched_conductance
from matcal.laws.conductivity import Conductivity

LAW = Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4))
SKIN = Skin(strain="normal")  # the touches below squeeze it and stretch nothing in plane
PATCHES = Electrodes(kind="patch", width_m=(0.008, 0.014, 0.01, 0.01) * 2, count=8, length_m=0.012,
                     contact_impedance_Ohm_m2=(1e-2, 2e-3) * 4)
EVEN = Electrodes(kind="patch")


def pressed() -> Touch:
    """A touch that squeezes the skin under a punch of 14 mm to 0.7 of its thickness."""
    radius = np.linspace(0, 0.03, 121)
    normal = 1 - 0.3 / (1 + (radius / 0.007) ** 8)
    rest = np.ones_like(radius)
    return Touch(radius, 0 * rest, 0 * rest, rest, rest, normal, 0 * rest, 0.007, *[0.0] * 9, 0, (), 0.0)


TOUCHES = ((Punch(0.02, 0.01), pressed()), (Punch(-0.05, -0.02), pressed()))


def relative(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def change(mesh: SkinMesh, electrodes: Electrodes, touches: tuple) -> np.ndarray:
    z = contact_impedances(electrodes)
    touched = touched_conductance(points_of(mesh), touches, SKIN, LAW)
    return impedance(mesh, touched, z) - impedance(mesh, np.full(len(mesh.cells), 6e-4), z)


@pytest.mark.parametrize("touches", [TOUCHES[:1], TOUCHES])
def test_meshes_cover_the_disc_and_each_patch(touches: tuple):
    mesh = following_mesh(Body(), PATCHES, touches, 2)
    _, area = gradients(mesh, np.zeros((len(mesh.nodes_m), 1)))
    assert area.sum() == pytest.approx(np.pi * 0.01, rel=1e-5)
    of_cell = {tuple(cell): a for cell, a in zip(mesh.cells.tolist(), area.sum(axis=1), strict=True)}
    under = np.array([of_cell[tuple(cell)] for cell in mesh.under.tolist()])
    covered = np.bincount(mesh.electrode, under)
    sector = np.array(PATCHES.width_m) / 0.1 * (0.1**2 - 0.088**2) / 2
    np.testing.assert_allclose(covered, sector, rtol=1e-5)


def test_two_families_of_meshes_converge_to_each_other():
    ends = [change(family(Body(), PATCHES, TOUCHES[:1], level), PATCHES, TOUCHES[:1]) for family, level in
            ((lambda b, e, t, n: template(b, e, *t[0], n), 4), (triangulation, 3), (triangulation, 1))]
    print(f"level 3 against level 4: {relative(ends[1], ends[0]):.1e}, level 1: {relative(ends[2], ends[0]):.1e}")
    assert relative(ends[1], ends[0]) < 2e-3
    assert relative(ends[1], ends[0]) < relative(ends[2], ends[0]) / 3


def test_patches_that_shorten_become_lines():
    lines = solve_rim(Body(), Electrodes(), 6e-4).impedance_Ohm
    patches = [replace(EVEN, length_m=size, contact_impedance_Ohm_m2=size) for size in (4e-3, 1e-3, 2.5e-4)]
    gaps = [relative(untouched_impedance(Body(), short, 6e-4), lines) for short in patches]
    print(gaps)
    assert gaps[0] > 3 * gaps[1] > 9 * gaps[2]
    assert gaps[2] < 0.02


def test_a_poor_contact_gives_the_patch_potential_of_its_own():
    """U = z I / area beside what little the skin needs."""
    z, area = 1e6, 0.01 / 0.1 * (0.1**2 - 0.09**2) / 2
    found = untouched_impedance(Body(), replace(EVEN, contact_impedance_Ohm_m2=z), 6e-4)
    np.testing.assert_allclose(found, z / area * (np.eye(16) - 1 / 16), atol=1e-5 * z / area)


def test_reciprocity_balance_and_turning():
    mesh = following_mesh(Body(), EVEN, TOUCHES[:1], 1)
    z = change(mesh, EVEN, TOUCHES[:1])
    assert np.abs(z - z.T).max() < 1e-9 * np.abs(z).max()
    whole = untouched_impedance(Body(), EVEN, 6e-4)
    assert np.abs(whole - whole.T).max() < 1e-12 * np.abs(whole).max()
    assert np.abs(whole - np.roll(whole, (1, 1), (0, 1))).max() < 1e-10 * np.abs(whole).max()
    turned = untouched_impedance(Body(), replace(EVEN, first_angle_rad=0.3), 6e-4)
    assert np.abs(whole - turned).max() < 1e-10 * np.abs(whole).max()


def test_the_current_through_each_patch_is_what_is_driven():
    mesh = following_mesh(Body(), PATCHES, TOUCHES[:1], 1)
    z = contact_impedances(PATCHES)
    u = potentials(mesh, np.full(len(mesh.cells), 6e-4), z)
    inside = replace(mesh, cells=mesh.under)
    _, area = gradients(inside, np.zeros((len(mesh.nodes_m), 1)))
    drop = u[len(mesh.nodes_m) + mesh.electrode][:, None] - at_points(inside, u)
    flow = np.einsum("eq,eqp->ep", area, drop) / z[mesh.electrode, None]
    current = np.stack([flow[mesh.electrode == k].sum(axis=0) for k in range(8)])
    assert np.abs(current - (np.eye(8) - 1 / 8)).max() < 1e-12


def at_points(mesh: SkinMesh, potential: np.ndarray) -> np.ndarray:
    """Potentials (cells, q, k) at the quadrature points, by the map that takes nodes there."""
    stacked = [points_of(replace(mesh, nodes_m=np.column_stack([column, column]))) for column in potential[
        :len(mesh.nodes_m)].T]
    return np.stack([part[..., 0] for part in stacked], axis=-1)


def test_readings_of_a_touch_meet_the_wanted_error():
    got = solve(Body(), SKIN, EVEN, Drive(), TOUCHES[:1], LAW, signal=0.003)
    fine = change(template(Body(), EVEN, *TOUCHES[0], 6), EVEN, TOUCHES[:1])
    true = relative(got.impedance_Ohm - untouched_impedance(Body(), EVEN, 6e-4), fine)
    print(f"told {got.signal_error:.1e}, true {true:.1e}")
    assert got.method == "mesh"
    assert true < 0.003


@pytest.mark.thorough
def test_the_mesh_that_patches_cut_agrees_with_that_of_rings():
    """Of a touch outside the patches, which both follow."""
    sheets = [change(made(Body(), EVEN, TOUCHES[:1]), EVEN, TOUCHES[:1])
              for made in (patched_disc_mesh, lambda *at: template(*at[:2], *TOUCHES[0], 4))]
    assert relative(*sheets) < 2e-3


@pytest.mark.thorough
def test_a_contact_on_a_patch_reads_alike_on_the_next_one():
    """Within the estimates, though the polygon that stands for the rim has other corners there."""
    step, changes = 2 * np.pi / EVEN.count, []
    for k in (0, 1):
        touches = ((Punch(0.085 * np.cos(k * step), 0.085 * np.sin(k * step)), pressed()),)
        got = solve(Body(), SKIN, EVEN, Drive(), touches, LAW, signal=0.05)
        assert got.signal_error < 0.05
        changes.append(got.impedance_Ohm - untouched_impedance(Body(), EVEN, 6e-4))
    assert relative(np.roll(changes[0], (1, 1), axis=(0, 1)), changes[1]) < 2 * got.signal_error


def test_rings_serve_lines_alone():
    with pytest.raises(ValueError, match="with others"):
        solve(Body(), SKIN, EVEN, Drive(), TOUCHES[:1], LAW, method="multipole")
