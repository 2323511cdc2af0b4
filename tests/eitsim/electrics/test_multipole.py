"""What a stack of rings scatters, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import iv, ivp

from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.cem.ring_scattering import Scatterer, impedance_change, scattering
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch, Skin
from matcal.laws.conductivity import Conductivity, conductivity

LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
EDGE, REACH, SHEET = 8e-3, 0.05, 6e-4
ORDERS = np.arange(1, 13)


def rings(inside_normal: float, pressure_Pa: float = 0.0) -> Touch:
    """A synthetic disc of uniform strain, its edge as thin as the samples allow."""
    r = np.concatenate([np.linspace(0, EDGE, 41), [EDGE * (1 + 1e-9)], np.linspace(0.01, 0.09, 20)])
    one, inside = np.ones_like(r), r <= EDGE
    return Touch(r, 0 * r, 0 * r, one, one, np.where(inside, inside_normal, 1.0), np.where(inside, pressure_Pa, 0.0),
                 EDGE, *[0.0] * 9, 0, (), 0.0)


def test_a_disc_of_other_conductance_scatters_as_in_the_closed_form():
    inner = float(conductivity(LAW, -0.6)) * 20e-6
    expected = (SHEET - inner) / (SHEET + inner) * (EDGE / REACH) ** (2 * ORDERS)
    got = scattering(Punch(), rings(0.4), Skin(), LAW, REACH, 12, 1)
    np.testing.assert_allclose(got, expected, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("contact", [1e-2, 1e-4])
def test_a_floating_conductor_scatters_as_in_the_closed_form(contact):
    """Inside u is a modified Bessel function of rho sqrt(1/(z S))."""
    rate = EDGE / np.sqrt(contact * SHEET)
    admittance = rate * ivp(ORDERS, rate) / iv(ORDERS, rate)
    expected = (ORDERS - admittance) / (ORDERS + admittance) * (EDGE / REACH) ** (2 * ORDERS)
    punch = Punch(conductor=True, contact_impedance_Ohm_m2=contact)
    errors = [np.abs(scattering(punch, rings(1.0, 1e3), Skin(), LAW, REACH, 12, parts)[0] / expected[0] - 1)
              for parts in (1, 2, 4)]
    print(errors)
    assert errors[2] < 2e-4
    assert errors[0] > 3.5 * errors[1] > 12 * errors[2]


def test_a_concentric_disc_changes_the_impedance_as_in_the_closed_form():
    """Without electrodes' shunting (z large) the modes of N point-like contacts scatter back once each."""
    tau = scattering(Punch(), rings(0.4), Skin(), LAW, REACH, 12, 1)
    electrodes = Electrodes(contact_impedance_Ohm_m=1e6, width_m=1e-3)
    rim = solve_rim(Body(), electrodes, SHEET)
    change = impedance_change(rim, Body(), electrodes, SHEET, [Scatterer(0j, REACH, tau)], 160)
    share = tau * (REACH / 0.1) ** (2 * ORDERS)
    half = 0.5e-3 / 0.1
    mode = 2 * share / (1 - share) * np.sinc(ORDERS * half / np.pi) ** 2 / (np.pi * SHEET * ORDERS)
    apart = np.subtract.outer(np.arange(16), np.arange(16)) * np.pi / 8
    expected = np.einsum("m,mij->ij", mode, np.cos(ORDERS[:, None, None] * apart))
    np.testing.assert_allclose(change, expected, atol=1e-6 * np.abs(expected).max())
