"""Dipole response of axisymmetric sheets against closed forms."""

import numpy as np
import pytest

from eitsim.sheet.sheet_conductance import dipole


@pytest.mark.parametrize("inside", [0.1, 3.0, 1e6])
def test_a_disc_of_another_conductance(inside):
    radius = np.append(np.linspace(0.01, 2.0, 20), np.linspace(2.0 + 1e-12, 5.0, 30))
    sheet = np.where(radius <= 2.0, inside, 1.0)
    assert dipole(radius, sheet, sheet) == pytest.approx(4.0 * (1 - inside) / (1 + inside), rel=1e-6)


def test_an_anisotropic_disc():
    radius = np.append(np.linspace(0.01, 2.0, 20), np.linspace(2.0 + 1e-12, 5.0, 30))
    radial, hoop = np.where(radius <= 2.0, 0.5, 1.0), np.where(radius <= 2.0, 8.0, 1.0)
    assert dipole(radius, radial, hoop) == pytest.approx(4.0 * (1 - 2) / (1 + 2), rel=1e-6)


def test_stretching_a_sheet_of_one_conductivity_leaves_no_trace():
    radius = np.linspace(1e-3, 6.0, 5000)
    turn = 1 + 0.5 * np.exp(-((radius - 2) / 0.3)**2)
    assert abs(dipole(radius, turn, 1 / turn)) < 1e-6
