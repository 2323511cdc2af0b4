"""A frictionless sphere on a bonded layer of linear elasticity by Hankel's transform: no mesh, nothing of eitsim.

The contact pressure is sum c_k (1 - r^2/a^2)^(k - 1/2), k = 1, 2 ..., whose transforms are spherical Bessel functions
(Sneddon's finite integral); the layer answers each wave number by Papkovich and Neuber's potentials. The coefficients
are those at which the face follows the sphere inside a, and a is that of the force. Lengths over the thickness,
stresses over mu, forces over mu times the thickness squared.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import gamma, j0, jv

TERMS, PLACES = 7, 24  # of the pressure, and where the face is held to the sphere
MOST, PANELS, DEEP = 1200.0, 400, 30.0  # wave numbers; from DEEP on the layer is a half-space
POWERS = np.arange(TERMS) + 0.5


@dataclass(frozen=True)
class Pressed:
    """What a sphere makes of the layer."""

    depth: float
    contact: float  # radius
    largest_pressure: float
    areal_strain: np.ndarray  # (n,) of the face, at the radii asked for


def pressed(nu: float, sphere: float, force: float, radius: np.ndarray) -> Pressed:
    """The layer of a Poisson's ratio under a force on a sphere of a radius."""
    s, weight = _wave_numbers()
    sinks, widens = _face(s, nu)

    def pressure(a: float) -> tuple[np.ndarray, float]:
        """Coefficients with the depth, and the force."""
        r = a * np.linspace(0.02, 0.98, PLACES)
        by = j0(r[:, None] * s) @ ((weight * s * sinks)[:, None] * _transforms(s, a))
        found = np.linalg.lstsq(np.column_stack([by, -np.ones(PLACES)]), -(r**2) / (2 * sphere))[0]
        return found, float(np.pi * a**2 * np.sum(found[:-1] / (POWERS + 1)))

    a = brentq(lambda one: np.log(pressure(one)[1] / force), 0.02, 1.5, xtol=1e-10)
    found, _ = pressure(a)
    areal = j0(radius[:, None] * s) @ (weight * s**2 * widens * (_transforms(s, a) @ found[:-1]))
    return Pressed(float(found[-1]), a, float(found[:-1].sum()), areal)


def _wave_numbers() -> tuple[np.ndarray, np.ndarray]:
    point, weight = np.polynomial.legendre.leggauss(16)
    half = MOST / PANELS / 2
    starts = 2 * half * np.arange(PANELS)
    return (starts[:, None] + half * (1 + point)).ravel(), np.tile(half * weight, PANELS)


def _transforms(s: np.ndarray, a: float) -> np.ndarray:
    """(n, TERMS) int_0^a r J_0(s r) (1 - r^2/a^2)^power dr."""
    x = s[:, None] * a
    return a**2 * 2**POWERS * gamma(POWERS + 1) * jv(POWERS + 1, x) / x ** (POWERS + 1)


def _face(s: np.ndarray, nu: float) -> np.ndarray:
    """(2, n) how far the face sinks, times J_0, and moves outwards, times J_1, under a pressure J_0(s r)."""
    return np.array([((1 - nu) / one, -(1 - 2 * nu) / (2 * one)) if one > DEEP else _bonded(one, nu) for one in s]).T


def _bonded(s: float, nu: float) -> tuple[float, float]:
    lame = 2 * nu / (1 - 2 * nu)
    (u, _, v, _), (w, w_z, r, r_z) = _potentials(s, nu, 0.0), _potentials(s, nu, 1.0)
    c = np.linalg.solve([u, v, lame * (w_z + s * r) + 2 * w_z, r_z - s * w], [0.0, 0.0, -1.0, 0.0])
    return -float(w @ c), float(r @ c)


def _potentials(s: float, nu: float, z: float) -> np.ndarray:
    """(4, 4) u_z, its slope by z, u_r and its slope, of 2 mu u = 4 (1 - nu) phi_z e_z - grad(phi_0 + z phi_z): phi_0,
    then phi_z, is exp(s (z - 1)) and exp(-s z)."""
    ends, bent = ((np.exp(s * (z - 1)), s), (np.exp(-s * z), -s)), 4 * (1 - nu)
    return np.array([
        *((-q * f, -q * q * f, s * f, s * q * f) for f, q in ends),
        *((bent * f - (1 + z * q) * f, bent * q * f - (2 + z * q) * q * f, s * z * f, s * (1 + z * q) * f)
          for f, q in ends)]).T / 2
