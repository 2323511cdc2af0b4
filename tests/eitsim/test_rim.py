"""The untouched skin without a mesh."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from eitsim.cem import SkinMesh, impedance
from eitsim.drive import read_out
from eitsim.electrodes import arcs, contact_impedances
from eitsim.rim import solve_rim
from eitsim.scene import Body, Drive, Electrodes
from eitsim.template import ring_mesh

REFERENCE = Path(__file__).parents[2].parent / "shared" / "reference" / "eit" / "analytic_homog_single.csv"


@pytest.mark.skipif(not REFERENCE.exists(), reason="the reference values are not beside the checkout")
def test_readings_equal_the_mesh_free_reference():
    expected = np.loadtxt(REFERENCE, delimiter=",")
    readings = read_out(Drive(), solve_rim(Body(), Electrodes(), 1e-3).impedance_Ohm)
    assert np.abs(readings / expected - 1).max() < 1e-11


@pytest.mark.parametrize(("body", "electrodes"), [
    (Body(), Electrodes(contact_impedance_Ohm_m=1e-6)),
    (Body(radius_m=0.05), Electrodes(count=7, width_m=0.02, first_angle_rad=0.4, contact_impedance_Ohm_m=30.0))])
def test_impedance_agrees_with_a_mesh(body, electrodes):
    mesh = graded_mesh(body, electrodes)
    meshed = impedance(mesh, np.full(len(mesh.cells), 6e-4), contact_impedances(electrodes))
    exact = solve_rim(body, electrodes, 6e-4).impedance_Ohm
    error = np.abs(meshed - exact).max() / np.abs(exact).max()
    print(f"{electrodes.count} electrodes, z = {electrodes.contact_impedance_Ohm_m}: {error:.1e}")
    assert error < 3e-4


def graded_mesh(body: Body, electrodes: Electrodes) -> SkinMesh:
    """Angles and rings in geometric progression towards the ends of the electrodes."""
    near = 0.5 * 0.4 ** np.arange(9, -1, -1)
    points = np.concatenate([[0.0], near, 1 - near[-2::-1]])
    ends = arcs(body.radius_m, electrodes)
    following = np.append(ends[1:, 0], ends[0, 0] + 2 * np.pi)
    angles = [a + (b - a) * points for pair in zip(ends[:, 0], ends[:, 1], following, strict=True)
              for a, b in pairwise(pair)]
    electrode = np.repeat([k // 2 if k % 2 == 0 else -1 for k in range(2 * electrodes.count)], len(points))
    radii = body.radius_m * np.concatenate([np.linspace(0, 0.5, 3), 1 - 0.5 ** np.arange(1.5, 14, 0.5), [1.0]])
    return ring_mesh(radii, np.zeros((len(radii), 2)), np.concatenate(angles), electrode, electrodes.count)


def test_only_the_product_of_conductance_and_contact_impedance_matters_beside_the_scale():
    one = solve_rim(Body(), Electrodes(contact_impedance_Ohm_m=1.0), 6e-4).impedance_Ohm
    other = solve_rim(Body(), Electrodes(contact_impedance_Ohm_m=0.1), 6e-3).impedance_Ohm
    np.testing.assert_allclose(one, 10 * other, rtol=1e-12, atol=1e-9)


def test_impedance_is_symmetric_positive_and_circulant():
    z = solve_rim(Body(), Electrodes(), 6e-4).impedance_Ohm
    assert np.abs(z - z.T).max() < 1e-12 * np.abs(z).max()
    assert np.abs(np.roll(z, (1, 1), (0, 1)) - z).max() < 1e-12 * np.abs(z).max()
    assert np.linalg.eigvalsh(z)[1] > 0
