"""An uneven sheet: its admittance against finite elements, and what is exact."""

from dataclasses import replace

import numpy as np
import pytest

from eitsim.electrics.cem.assembly import centred, potentials, quadrature_points
from eitsim.electrics.cem.boundary_integral import rim_admittance
from eitsim.electrics.cem.uneven_sheet import MODES, sheet_modes
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.electrodes import Electrodes, contact_impedances
from eitsim.scene.scene import Body

COUNT, SHEET_S = 8, 1e-3
RNG = np.random.default_rng(0)
RING = Electrodes(count=COUNT, width_m=tuple(0.01 * np.exp(0.05 * RNG.standard_normal(COUNT))),
                  contact_impedance_Ohm_m=tuple(np.exp(RNG.standard_normal(COUNT))))
RIM = rim_admittance(Body(), RING, SHEET_S)


def by_elements(modes: np.ndarray) -> np.ndarray:
    """Impedance (N, N), Ohm, on rings of triangles that narrow towards the rim."""
    angles, electrode = rim_angles(Body(), RING, 5)
    radii = 0.1 * np.concatenate([np.linspace(0, 0.8, 13)[:-1], 1 - np.geomspace(0.2, 2e-3, 12), [1.0]])
    mesh = ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, COUNT)
    sheet = SHEET_S * np.exp(np.tensordot(modes, sheet_modes(Body(), quadrature_points(mesh)), 1))
    found = potentials(mesh, sheet[..., None, None] * np.eye(2), contact_impedances(RING))
    return centred(mesh, found)[len(mesh.nodes_m):]


def change(modes: np.ndarray) -> np.ndarray:
    uneven = rim_admittance(Body(), RING, SHEET_S, modes)
    return np.linalg.pinv(uneven.admittance_S) - np.linalg.pinv(RIM.admittance_S)


@pytest.mark.parametrize("mode", range(len(MODES)))
def test_each_mode_changes_the_impedance_as_on_a_mesh(mode: int) -> None:
    """Of either sign, so that what is of second order falls out."""
    step = 1e-2 * np.eye(len(MODES))[mode]
    expected = by_elements(step) - by_elements(-step)
    found = change(step) - change(-step)
    assert np.linalg.norm(found - expected) < 0.02 * np.linalg.norm(expected)


def test_a_sheet_uneven_by_a_tenth_is_off_by_little() -> None:
    """The exponential of the first order; the first order alone is off by more."""
    modes = 0.05 * np.array([1.0, -1.0, 1.0, 1.0, -1.0])
    expected = by_elements(modes) - by_elements(np.zeros(len(MODES)))
    alone = RIM.admittance_S + np.tensordot(modes, RIM.by_sheet, 1)
    off, first = (np.linalg.norm(one - expected) / np.linalg.norm(expected)
                  for one in (change(modes), np.linalg.pinv(alone) - np.linalg.pinv(RIM.admittance_S)))
    print(f"off by {off:.2%} of the change, by {first:.2%} to first order")
    assert off < 0.02 < first


def test_the_width_of_an_electrode_changes_the_admittance_by_its_derivative() -> None:
    width = np.array(RING.width_m)
    for k in (0, 5):
        step = 1e-3 * np.eye(COUNT)[k]
        wide, narrow = (rim_admittance(Body(), replace(RING, width_m=tuple(width * np.exp(one))), SHEET_S).admittance_S
                        for one in (step, -step))
        expected = (wide - narrow) / 2e-3
        assert np.abs(RIM.by_width[k] - expected).max() < 1e-5 * np.abs(expected).max()
