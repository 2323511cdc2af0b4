"""A touch as a stack of rings about its punch: it scatters each circular harmonic by itself; the rim couples them."""

from __future__ import annotations

import cmath
import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, xlogy

from eitsim.results import Touch
from eitsim.rim import Rim
from eitsim.scene import Body, Electrodes, Punch, Skin
from eitsim.skin import principal_conductances, stretches, untouched_conductance
from matcal.conductivity import Conductivity

Array = NDArray[np.float64]
Indices = NDArray[np.integer]

# Part of their reach over which the rings carry the whole change of conductance.
FULL = 0.9


def ring_share(radius_m: Array, reach_m: float) -> Array:
    """Part of the change of conductance that the rings carry: 1, falling smoothly to 0 at their reach."""
    t = np.clip((radius_m / reach_m - FULL) / (1 - FULL), 0, 1)
    return 1 - t**3 * (10 - 15 * t + 6 * t**2)


def scattering(punch: Punch, touch: Touch, skin: Skin, law: Conductivity, reach_m: float, orders: int,
               parts: int) -> Array:
    """Scattering (orders,) of the harmonics m = 1, 2, ...: (rho/reach)^m comes in, tau_m (rho/reach)^-m goes out.

    In a ring of constant conductances the admittance Y = rho s_m u'/u obeys Y' = k (Y + k h)/(k + Y h), with
    k^2 = s_m (m^2 s_h + g rho^2), h = tanh(k ln(rho'/rho)/s_m) and g the conductance to a floating punch per area;
    the rings are the gaps of the touch's samples, each cut in `parts`.
    """
    stops = np.unique(np.concatenate([[0.0], touch.radius_m[touch.radius_m < reach_m], [reach_m]]))
    radii = np.interp(np.arange(parts * (len(stops) - 1) + 1) / parts, np.arange(len(stops)), stops)
    middle = (radii[1:] + radii[:-1]) / 2
    along, across, normal = stretches(touch, middle)
    free, share = untouched_conductance(law, skin), ring_share(middle, reach_m)
    meridian, hoop = (free + share * (s - free) for s in principal_conductances(law, skin, along, across, normal))
    m = np.arange(1, orders + 1)[:, None]
    k = np.sqrt(meridian * (m**2 * hoop + _shunt(punch, touch, middle, along * across) * middle**2))
    h = np.tanh(k[:, 1:] / meridian[1:] * np.log(radii[2:] / radii[1:-1]))
    admittance = k[:, 0]
    for ring in range(h.shape[1]):
        kr, hr = k[:, ring + 1], h[:, ring]
        admittance = kr * (admittance + kr * hr) / (kr + admittance * hr)
    return (free * m[:, 0] - admittance) / (free * m[:, 0] + admittance)


def impedance_change(rim: Rim, body: Body, electrodes: Electrodes, conductance_S: float, punch: Punch, reach_m: float,
                     scattered: Array, harmonics: int) -> Array:
    """Change (N, N) of the impedance matrix, Ohm: 2 pi S sum_m m Re(conj(a_m) tau_m b_m), a the undisturbed field
    about the punch and b = a + W tau b, W what rim and electrodes send back.
    """
    offset, angle = cmath.polar(complex(punch.x_m, punch.y_m))
    angle -= electrodes.first_angle_rad
    count, m = electrodes.count, np.arange(1, len(scattered) + 1)
    n = np.arange(1, harmonics + 1)
    local = _translation(offset / body.radius_m, reach_m / body.radius_m, m, n)
    turned = local * np.exp(1j * n * angle)
    turns = np.exp(-2j * np.pi * np.outer(n, np.arange(count)) / count)
    incoming = turned @ (rim.driven[:harmonics, None] * turns)
    outgoing = (turned.conj() * m[:, None] / n).T
    same = local @ (local * m[:, None] / n).T + 2 * turned @ (rim.same[:harmonics, :harmonics] @ outgoing)
    crossed = 2 * turned @ (rim.crossed[:harmonics, :harmonics] @ outgoing.conj())
    back = np.block([[(same + crossed).real, (crossed - same).imag], [(same + crossed).imag, (same - crossed).real]])
    tau, weight = np.tile(scattered, 2), np.tile(m * scattered, 2)
    source = np.vstack([incoming.real, incoming.imag])
    field = np.linalg.solve(np.eye(2 * len(m)) - back * tau, source)
    return 2 * np.pi * conductance_S * source.T @ (weight[:, None] * field)


def _translation(offset: float, reach: float, m: Indices, n: Indices) -> Array:
    """(m, n): z^n about a point at `offset` is sum_m (n over m) offset^(n-m) reach^m (zeta/reach)^m."""
    m = m[:, None]
    short = np.maximum(n - m, 0)
    size = gammaln(n + 1) - gammaln(m + 1) - gammaln(short + 1) + xlogy(short, offset) + m * math.log(reach)
    return np.where(n >= m, np.exp(size), 0.0)


def _shunt(punch: Punch, touch: Touch, radius: Array, areal: Array) -> Array:
    """Conductance to the punch per reference area, S/m^2, where it conducts and presses."""
    if not punch.conductor:
        return np.zeros_like(radius)
    pressed = np.interp(radius, touch.radius_m, touch.pressure_Pa) > 0
    return np.where(pressed, areal / punch.contact_impedance_Ohm_m2, 0.0)
