"""What a stack of rings scatters, against closed forms."""

import numpy as np
import pytest
from scipy.special import iv, ivp

from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.cem.ring_scattering import (
    FULL,
    Coupling,
    _translation,
    between,
    impedance_change,
    on_disc,
    reaches,
    ring_share,
    scattered,
    scattering,
)
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch, Skin
from matcal.laws.conductivity import Conductivity, conductivity

LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
SKIN = Skin(strain="normal")  # what the discs below are pressed by
EDGE, REACH, SHEET = 8e-3, 0.05, 6e-4
ORDERS = np.arange(1, 13)


def rings(inside_normal: float, pressure_Pa: float = 0.0) -> Touch:
    """A synthetic disc of uniform strain through the thickness, its edge as thin as the samples allow."""
    r = np.concatenate([np.linspace(0, EDGE, 41), [EDGE * (1 + 1e-9)], np.linspace(0.01, 0.09, 20)])
    one, inside = np.ones_like(r), r <= EDGE
    return Touch(r, 0 * r, 0 * r, one, one, np.where(inside, inside_normal, 1.0), np.where(inside, pressure_Pa, 0.0),
                 EDGE, *[0.0] * 9, 0, (), 0.0)


def test_a_disc_of_other_conductance_scatters_as_in_the_closed_form():
    inner = float(conductivity(LAW, -0.6)) * 20e-6
    expected = (SHEET - inner) / (SHEET + inner) * (EDGE / REACH) ** (2 * ORDERS)
    got = scattering(Punch(), rings(0.4), SKIN, LAW, REACH, 12, 1)
    np.testing.assert_allclose(got, expected, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("contact", [1e-2, 1e-4])
def test_a_floating_conductor_scatters_as_in_the_closed_form(contact):
    """Inside u is a modified Bessel function of rho sqrt(1/(z S))."""
    rate = EDGE / np.sqrt(contact * SHEET)
    admittance = rate * ivp(ORDERS, rate) / iv(ORDERS, rate)
    expected = (ORDERS - admittance) / (ORDERS + admittance) * (EDGE / REACH) ** (2 * ORDERS)
    punch = Punch(conductor=True, contact_impedance_Ohm_m2=contact)
    errors = [np.abs(scattering(punch, rings(1.0, 1e3), SKIN, LAW, REACH, 12, parts)[0] / expected[0] - 1)
              for parts in (1, 2, 4)]
    print(errors)
    assert errors[2] < 2e-4
    assert errors[0] > 3.5 * errors[1] > 12 * errors[2]


def test_a_concentric_disc_changes_the_impedance_as_in_the_closed_form():
    """Without electrodes' shunting (z large) the modes of N point-like contacts scatter back once each."""
    tau = scattering(Punch(), rings(0.4), SKIN, LAW, REACH, 12, 1)
    electrodes = Electrodes(contact_impedance_Ohm_m=1e6, width_m=1e-3)
    rim = solve_rim(Body(), electrodes, SHEET)
    coupling = on_disc(rim, Body(), electrodes, [(0j, REACH)], len(tau), 160)
    change = impedance_change(coupling, SHEET, tau)
    share = tau * (REACH / 0.1) ** (2 * ORDERS)
    half = 0.5e-3 / 0.1
    mode = 2 * share / (1 - share) * np.sinc(ORDERS * half / np.pi) ** 2 / (np.pi * SHEET * ORDERS)
    apart = np.subtract.outer(np.arange(16), np.arange(16)) * np.pi / 8
    expected = np.einsum("m,mij->ij", mode, np.cos(ORDERS[:, None, None] * apart))
    np.testing.assert_allclose(change, expected, atol=1e-6 * np.abs(expected).max())


def test_powers_about_another_centre_are_binomial_sums():
    """z^n and (zeta/r)^-m, evaluated at points about the new centre: their series agree but for a constant."""
    centre, reach = 0.3 - 0.4j, 0.25
    around = 0.5 * reach * np.exp(1j * np.arange(5))
    m, n = np.arange(1, 60), np.arange(1, 9)
    inner = (around[:, None] / reach) ** m @ _translation(centre, reach, m, n)
    outer = (centre + around[:, None]) ** n
    np.testing.assert_allclose(np.diff(inner, axis=0), np.diff(outer, axis=0), atol=1e-12)
    source, own = (-0.35 + 0.1j, 0.3), (centre, reach)
    inner = (around[:, None] / reach) ** m @ between(own, source, m)[:, :8]
    outer = ((centre + around[:, None] - source[0]) / source[1]) ** -n
    np.testing.assert_allclose(np.diff(inner, axis=0), np.diff(outer, axis=0), atol=1e-12)
    assert not between(own, own, m).any()


def test_scatterers_do_not_know_their_order_and_turn_with_the_ring():
    electrodes, h = Electrodes(), 120
    rim, tau = solve_rim(Body(), electrodes, SHEET), -0.4 * 0.6 ** (2 * ORDERS)
    pair = [(0.03 + 0.01j, 0.03, tau), (-0.05 - 0.02j, 0.025, 0.5 * tau)]

    def change(scatterers: list[tuple[complex, float, np.ndarray]]) -> np.ndarray:
        circles = [(centre, reach) for centre, reach, _ in scatterers]
        coupling = on_disc(rim, Body(), electrodes, circles, len(tau), h)
        return impedance_change(coupling, SHEET, np.concatenate([own for *_, own in scatterers]))

    both = change(pair)
    size = np.abs(both).max()
    np.testing.assert_allclose(change(pair[::-1]), both, atol=1e-12 * size)
    np.testing.assert_allclose(both, both.T, atol=1e-10 * size)
    turned = [(centre * np.exp(2j * np.pi / 16), reach, own) for centre, reach, own in pair]
    np.testing.assert_allclose(change(turned), np.roll(both, (1, 1), (0, 1)), atol=1e-10 * size)
    silent = [pair[0], (*pair[1][:2], 0 * tau)]
    np.testing.assert_allclose(change(silent), change(pair[:1]), atol=1e-12 * size)
    assert np.abs(both - change(pair[:1]) - change(pair[1:])).max() > 1e-4 * size


def test_the_rings_carry_all_inside_and_nothing_at_their_reach():
    """1 to FULL of the reach, half midway from there, 0 at the reach, and flat at both ends."""
    at = np.array([0.0, FULL, (1 + FULL) / 2, 1.0, 1.2]) * 0.04
    assert ring_share(at, 0.04) == pytest.approx([1, 1, 0.5, 0, 0])
    near = ring_share(0.04 * np.array([FULL + 1e-3, 1 - 1e-3]), 0.04)
    assert near == pytest.approx([1, 0], abs=1e-4)


def test_circles_stay_in_the_disc_and_part_the_gap_between_contacts():
    """To the rim 100 - 40 mm; between two contacts of 8 mm, 30 mm apart, each gets 8 + 14/2 mm."""
    touch, alone, near = rings(0.4), Punch(x_m=0.04), Punch(x_m=0.04, y_m=0.03)
    assert reaches(Body(), [(alone, touch)]) == pytest.approx([0.06])
    assert reaches(Body(), [(alone, touch), (near, touch)]) == pytest.approx([0.015, 0.015])
    with pytest.raises(ValueError, match=r"1\.0 mm outside the rim"):
        reaches(Body(), [(Punch(x_m=0.093), touch)])
    with pytest.raises(ValueError, match=r"touches 1 and 2 overlap by 6\.0 mm"):
        reaches(Body(), [(alone, touch), (Punch(x_m=0.05), touch)])


def test_fields_about_circles_are_what_comes_in_and_what_comes_back() -> None:
    """b = a + W c, W c = same c + crossed conj(c), c = T b, and 2 pi S sum m Re(conj(a_m) c_m), by themselves."""
    rng, order, own = np.random.default_rng(5), np.tile([1, 2, 3], 2), np.array([0.5, -0.4, 0.3, 0.2, -0.5, 0.4])
    same, crossed = 0.2 * (rng.normal(size=(2, 6, 6)) + 1j * rng.normal(size=(2, 6, 6)))
    incoming = rng.normal(size=(6, 4)) + 1j * rng.normal(size=(6, 4))
    found = scattered(Coupling(incoming, same, crossed, order), 2.0, own)
    back = same @ found.outgoing + crossed @ found.outgoing.conj()
    np.testing.assert_allclose(found.returned, back, rtol=1e-10)
    np.testing.assert_allclose(found.outgoing, own[:, None] * (incoming + back), rtol=1e-10)
    np.testing.assert_allclose(found.impedance_Ohm, 4 * np.pi * np.real(np.einsum(
        "m,mk,ml->kl", order, incoming.conj(), found.outgoing)), rtol=1e-10)
