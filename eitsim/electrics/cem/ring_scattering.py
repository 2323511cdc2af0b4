"""Touches as stacks of rings about their punches: each scatters every circular harmonic by itself; the rim and the
other touches couple them."""

import cmath
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, xlogy

from eitsim.electrics.cem.boundary_integral import Array, Complex, Rim
from eitsim.electrics.cem.floating_electrodes import shunt, shunt_ends
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Electrodes, Punch, Skin
from eitsim.sheet import sheet_conductance as sheet
from matcal.laws.conductivity import Conductivity

Indices = NDArray[np.integer]
# centre as a complex number, and radius, m
Circle = tuple[complex, float]

FULL = 0.9  # Part of their reach over which the rings carry the whole change of conductance.


def ring_share(radius_m: Array, reach_m: float) -> Array:
    """Part of the change of conductance that the rings carry: 1, falling smoothly to 0 at their reach."""
    t = np.clip((radius_m / reach_m - FULL) / (1 - FULL), 0, 1)
    return 1 - t**3 * (10 - 15 * t + 6 * t**2)


@dataclass(frozen=True, eq=False)
class Coupling:
    """Fields about circles, circle by circle in harmonics Re a_m (zeta/reach)^m: what comes in."""

    incoming: Complex  # (m, N) a_m, V, of 1 A into each electrode and 1/N A out of every one
    # (m, m) twice: what goes out as Re conj(c_m) (zeta/reach)^-m comes back as same @ c + crossed @ conj(c)
    same: Complex
    crossed: Complex
    order: Indices  # (m,) the harmonics m


def reaches(body: Body, touches: Sequence[tuple[Punch, Touch]]) -> list[float]:
    """Radii, m, of circles about the punches that stay on the skin and part the gaps between contacts.

    ValueError where a contact reaches an edge or into another.
    """
    out = [admissible_radius(body, punch) for punch, _ in touches]
    for own, (_, touch) in zip(out, touches, strict=True):
        if own <= touch.contact_radius_m:
            raise ValueError(f"the contact reaches {(touch.contact_radius_m - own) * 1e3:.1f} mm outside "
                             f"{body.edge.name}; move the punch inwards.")
    for (i, (one, a)), (j, (other, b)) in itertools.combinations(enumerate(touches), 2):
        gap = abs(position(one) - position(other)) - a.contact_radius_m - b.contact_radius_m
        if gap <= 0:
            raise ValueError(f"the contacts of touches {i + 1} and {j + 1} overlap by {-gap * 1e3:.1f} mm; leave a gap "
                             "between them.")
        out[i], out[j] = min(out[i], a.contact_radius_m + gap / 2), min(out[j], b.contact_radius_m + gap / 2)
    return out


def position(punch: Punch) -> complex:
    """Axis of a punch, m, as a complex number."""
    return complex(punch.x_m, punch.y_m)


def admissible_radius(body: Body, punch: Punch) -> float:
    """Radius, m, of the largest circle about a punch that lies on the skin."""
    return float(body.edge.gap_m((punch.x_m, punch.y_m)))


def scattering(punch: Punch, touch: Touch, skin: Skin, law: Conductivity, reach_m: float, orders: int,
               parts: int) -> Array:
    """Scattering (orders,) of the harmonics m = 1, 2, ...: (rho/reach)^m comes in, tau_m (rho/reach)^-m goes out.

    In a ring the stationary admittance is k, k^2 = s_m (m^2 s_h + g rho^2), g the conductance to a floating punch per
    area (`eitsim.electrics.cem.floating_electrodes`); the rings are the gaps of the touch's samples and the shunt's
    ends, each cut in `parts`.
    """
    stops = np.concatenate([touch.radius_m, shunt_ends(punch, touch)])
    stops = np.unique(np.concatenate([[0.0], stops[stops < reach_m], [reach_m]]))
    radii = np.interp(np.arange(parts * (len(stops) - 1) + 1) / parts, np.arange(len(stops)), stops)
    middle = (radii[1:] + radii[:-1]) / 2
    along, across, normal = sheet.stretches(touch, middle)
    free, share = sheet.untouched_conductance(law, skin), ring_share(middle, reach_m)
    meridian, hoop = (free + share * (s - free) for s in sheet.principal_conductances(law, skin, along, across, normal))
    m = np.arange(1, orders + 1)[:, None]
    k = np.sqrt(meridian * (m**2 * hoop + shunt(punch, touch, middle, along * across) * middle**2))
    y = sheet.admittance(k[:, 0], k[:, 1:], meridian[1:], radii[1:])
    return (free * m[:, 0] - y) / (free * m[:, 0] + y)


def on_disc(rim: Rim, body: Body, electrodes: Electrodes, circles: Sequence[Circle], orders: int,
            harmonics: int) -> Coupling:
    """Fields about circles on a disc by its electrodes, the rim and each other, in harmonics 1 to `orders`; circles may
    touch but not overlap."""
    n, m = np.arange(1, harmonics + 1), np.arange(1, orders + 1)
    placed = [(centre / body.radius_m * cmath.exp(-1j * electrodes.first_angle_rad), reach / body.radius_m)
              for centre, reach in circles]
    turned = np.vstack([_translation(*circle, m, n) for circle in placed])
    order = np.tile(m, len(circles))
    outgoing = (turned.conj() * order[:, None] / n).T
    same = turned @ outgoing + 2 * turned @ (rim.same[:harmonics, :harmonics] @ outgoing)
    crossed = 2 * turned @ (rim.crossed[:harmonics, :harmonics] @ outgoing.conj())
    crossed += np.block([[between(one, other, m) for other in placed] for one in placed])
    return Coupling(turned @ rim.driven[:harmonics], same, crossed, order)


@dataclass(frozen=True, eq=False)
class Scattered:
    """What circles make of the field of 1 A into each electrode and 1/N A out of every one, circle by circle."""

    impedance_Ohm: Array  # (N, N) change of the impedance matrix
    # (m, drives), V: c_m goes out as Re conj(c_m) (zeta/reach)^-m, and comes back as Re d_m (zeta/reach)^m
    outgoing: Complex
    returned: Complex


def scattered(coupling: Coupling, conductance_S: float, scattering: Array) -> Scattered:
    """Fields b = a + W c about circles, a the undisturbed ones and W what comes back, of which c = T b goes out; the
    impedance changes by 2 pi S sum m Re(conj(a_m) c_m). T is (circles orders,) where every harmonic scatters into
    itself, else (2 circles orders, the same) by real, then imaginary parts."""
    same, crossed = coupling.same, coupling.crossed
    back = np.block([[(same + crossed).real, (crossed - same).imag], [(same + crossed).imag, (same - crossed).real]])
    matrix = np.diag(np.tile(scattering, 2)) if scattering.ndim == 1 else scattering
    source = np.vstack([coupling.incoming.real, coupling.incoming.imag])
    field = np.linalg.solve(np.eye(len(matrix)) - back @ matrix, source)
    outgoing = matrix @ field
    change = 2 * np.pi * conductance_S * source.T @ (np.tile(coupling.order, 2)[:, None] * outgoing)
    return Scattered(change, *(one[:len(same)] + 1j * one[len(same):] for one in (outgoing, field - source)))


def impedance_change(coupling: Coupling, conductance_S: float, scattering: Array) -> Array:
    """Change (N, N) of the impedance matrix, Ohm, by circles that scatter as in `scattered`."""
    return scattered(coupling, conductance_S, scattering).impedance_Ohm


def scattered_gradient(found: Scattered, circle: Circle, points_m: Array) -> Array:
    """Gradients (n, 2, N), V/m, of what one circle sends out and gets back, at points (n, 2); the series of what comes
    back converges no further than the circle's image in the edge."""
    place, m = _places(circle, points_m), np.arange(1, len(found.outgoing) + 1)[:, None]
    powers = np.vstack([_powers(place, 0, len(m)), _powers(np.reciprocal(place), 2, len(m))])
    return _gradient(powers, np.vstack([m * found.returned, -m * found.outgoing.conj()]), circle[1])


def outgoing_gradient(found: Scattered, circle: Circle, points_m: Array) -> Array:
    """Gradients (n, 2, N), V/m, of what one circle sends out alone, at points (n, 2)."""
    m = np.arange(1, len(found.outgoing) + 1)[:, None]
    powers = _powers(np.reciprocal(_places(circle, points_m)), 2, len(m))
    return _gradient(powers, -m * found.outgoing.conj(), circle[1])


def _gradient(powers: Complex, coefficients: Complex, reach_m: float) -> Array:
    """(n, 2, N), V/m, of powers (count, n) of places over the radius, of such coefficients (count, N), V."""
    slope = powers.T @ (coefficients / reach_m)
    found = np.empty((len(slope), 2, slope.shape[1]))
    found[:, 0], found[:, 1] = slope.real, -slope.imag
    return found


def _places(circle: Circle, points_m: Array) -> Complex:
    """(n,) places from the centre over the radius."""
    centre, reach = circle
    return np.asarray((points_m @ np.array([1, 1j]) - centre) / reach, dtype=complex)


def _powers(place: Complex, first: int, count: int) -> Complex:
    """(count, n) powers of places (n,) from the first on, as products, which take a tenth of powers' time."""
    out = np.empty((count, len(place)), complex)
    out[0] = place**first
    for k in range(1, count):
        np.multiply(out[k - 1], place, out=out[k])
    return out


def together(scatterings: Sequence[Array], orders: int) -> Array:
    """Scattering (2 circles orders, the same) of circles that scatter so each, of `orders` harmonics or fewer."""
    count = len(scatterings)
    whole = np.zeros((2, count, orders, 2, count, orders))
    for k, own in enumerate(scatterings):
        matrix = np.diag(np.tile(own, 2)) if own.ndim == 1 else own
        known = len(matrix) // 2
        whole[:, k, :known, :, k, :known] = matrix.reshape(2, known, 2, known)
    return whole.reshape(2 * count * orders, -1)


def _translation(centre: complex, reach: float, m: Indices, n: Indices) -> Complex:
    """(m, n): z^n about a centre is sum_m (n over m) centre^(n-m) reach^m (zeta/reach)^m."""
    offset, angle = cmath.polar(centre)
    m = m[:, None]
    short = np.maximum(n - m, 0)
    size = gammaln(n + 1) - gammaln(m + 1) - gammaln(short + 1) + xlogy(short, offset) + m * math.log(reach)
    return np.where(n >= m, np.exp(size + 1j * angle * short), 0.0)


def between(to: Circle, source: Circle, m: Indices) -> Complex:
    """(l, m): (zeta/r)^-m about one centre is sum_l (-1)^l (m+l-1 over l) r^m r'^l d^-(m+l) (zeta'/r')^l about another,
    which lies d from it; 0 for a centre to itself."""
    (z, reach), (z_source, reach_source) = to, source
    if z == z_source:
        return np.zeros((len(m), len(m)), dtype=complex)
    step, angle = cmath.polar(z - z_source)
    order = m[:, None]
    size = gammaln(m + order) - gammaln(order + 1) - gammaln(m)
    size += m * math.log(reach_source / step) + order * math.log(reach / step)
    return np.exp(size + 1j * (np.pi * order - angle * (m + order)))
