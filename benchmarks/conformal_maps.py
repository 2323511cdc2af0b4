"""Readings of an ellipse and of a square without a mesh: conformal maps to the unit disc carry the Laplace equation.

Under a map w = g(p) a uniform sheet stays one, a contact impedance z along an edge becomes z |g'|, and a patch of
another conductance keeps it and takes the shape of its image. On the disc the potential of currents in at its rim is a
series of cosines, that of a patch one of charges along its edge and their images in the rim.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import ellipj, ellipk, spherical_jn

from touchcal.arrays import Array

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Mapped:
    """A region and its map to the unit disc."""

    to_disc: Callable[[Complex], Complex]  # places, m, to the unit disc
    shrink: Callable[[Array], Array]  # |g'|, 1/m, of the place on the edge whose image has an angle, rad


@dataclass(frozen=True)
class Patch:
    """A circle of another conductance."""

    centre_m: complex
    radius_m: float
    share: float  # its conductance over that of the sheet


def square(side_m: float) -> Mapped:
    """The square about the origin by the lemniscatic sine, g = sl(c p), whose derivative is (1 - sl^4)^(1/2)."""
    half_turn = float(ellipk(0.5)) / np.sqrt(2)  # from the middle of the square to its corner, of sl
    scale = half_turn / (side_m / np.sqrt(2)) * np.exp(-0.25j * np.pi)

    def to_disc(places: Complex) -> Complex:
        u = scale * places
        (one, one_slope), (other, other_slope) = _lemniscatic(u.real), _lemniscatic(u.imag)
        return (one * other_slope + 1j * other * one_slope) / (1 - one**2 * other**2)

    return Mapped(to_disc, lambda angle: abs(scale) * np.sqrt(np.abs(1 - np.exp(4j * angle))))


def _lemniscatic(x: Array) -> tuple[Array, Array]:
    """sl x = sd(2^(1/2) x) / 2^(1/2) of the modulus 1/2^(1/2), and its derivative."""
    sn, cn, dn, _ = ellipj(np.sqrt(2) * x, 0.5)
    return sn / dn / np.sqrt(2), cn / dn**2


def ellipse(a_m: float, b_m: float) -> Mapped:
    """The ellipse of half axes a > b about the origin by g = k^(1/2) sn(2 K/pi arcsin(p/c)), c^2 = a^2 - b^2, of the
    nome ((a - b)/(a + b))^2. Source: Schwarz, see Nehari, Conformal Mapping, VI.3."""
    focus, nome = np.sqrt(a_m**2 - b_m**2), ((a_m - b_m) / (a_m + b_m)) ** 2
    n = np.arange(1, 20)
    m = float(((2 * nome**0.25 * (1 + np.sum(nome ** (n * (n + 1))))) / (1 + 2 * np.sum(nome ** (n**2)))) ** 4)
    scale = 2 * float(ellipk(m)) / np.pi

    def mapped(places: Complex) -> tuple[Complex, Complex]:
        """g and g'."""
        angle = np.arcsin(places / focus)
        sn, cn, dn = _jacobi(scale * angle, m)
        return m**0.25 * sn, m**0.25 * cn * dn * scale / (focus * np.cos(angle))

    turn = 2 * np.pi * (np.arange(4096) + 0.5) / 4096
    image, slope = mapped(np.asarray(a_m * np.cos(turn) + 1j * b_m * np.sin(turn), dtype=np.complex128))
    angle = np.unwrap(np.angle(image))
    at = np.append(angle, angle[0] + 2 * np.pi)
    spline = CubicSpline(at, np.append(np.abs(slope), abs(slope[0])), bc_type="periodic")
    return Mapped(lambda places: mapped(places)[0], spline)


def _jacobi(u: Complex, m: float) -> tuple[Complex, Complex, Complex]:
    """sn, cn and dn of complex arguments."""
    s, c, d, _ = ellipj(u.real, m)
    s1, c1, d1, _ = ellipj(u.imag, 1 - m)
    below = c1**2 + m * s**2 * s1**2
    return ((s * d1 + 1j * c * d * s1 * c1) / below, (c * c1 - 1j * s * d * s1 * d1) / below,
            (d * c1 * d1 - 1j * m * s * c * s1) / below)


def mapped_impedance(region: Mapped, ends_m: Complex, contact_Ohm_m: float, conductance_S: float,
                     patch: Patch | None = None, *, degree: int = 24, modes: int = 12000, around: int = 400) -> Array:
    """Impedance matrix (N, N), Ohm, of line electrodes between ends (N, 2) on the edge, counter-clockwise.

    The current on every electrode is a sum of Legendre polynomials of the angle of its image up to `degree`, and
    z |g'| j + u = U is tested by them (Galerkin). Charges mu of a patch satisfy
    (s + 1)/(2 (s - 1)) mu + d_n int G mu = -d_n u_0 at points `around` its edge, s its share, u_0 the potential without
    it, G = -(log|w - v| + log|1 - w v'|) / 2 pi.
    """
    turn = np.unwrap(np.angle(region.to_disc(ends_m)), axis=1)
    middle, half = turn.mean(axis=1), np.diff(turn, axis=1) / 2
    order = np.arange(degree + 1)
    place, weight = np.polynomial.legendre.leggauss(4 * degree)
    angle = middle[:, None] + half * place
    legendre = np.polynomial.legendre.legvander(place, degree)
    tested = legendre * weight[:, None]
    count, size = len(middle), len(order)
    n = np.arange(1, modes + 1)
    products = np.concatenate([2 * h * np.exp(1j * n * at) * 1j ** order[:, None] * spherical_jn(order[:, None], n * h)
                               for at, h in zip(middle, half[:, 0], strict=True)])
    kernel = np.real(products / n @ products.conj().T) / np.pi
    if patch is not None:
        kernel -= _by_patch(region, patch, angle, half * np.ones_like(place), tested, around)
    for k in range(count):
        own = slice(k * size, (k + 1) * size)
        shrink = contact_Ohm_m * conductance_S * region.shrink(angle[k])
        kernel[own, own] += half[k] * (legendre.T * shrink) @ tested
    into = np.kron(np.eye(count), np.eye(size)[:, :1]) * np.repeat(2 * half, size, axis=0)
    admittance = conductance_S * into.T @ np.linalg.solve(kernel, into)
    z = np.linalg.solve(admittance, np.eye(count) - 1 / count)
    return z - z.mean(axis=0)


def _by_patch(region: Mapped, patch: Patch, angle: Array, half: Array, tested: Array, around: int) -> Array:
    """What a patch takes from the kernel of the electrodes' polynomials."""
    wave = np.fft.fftfreq(around, 1 / around)
    edge = region.to_disc(patch.centre_m + patch.radius_m * np.exp(2j * np.pi * np.arange(around) / around))
    along, bent = (np.fft.ifft((1j * wave) ** k * np.fft.fft(edge)) for k in (1, 2))
    normal, length = -1j * along / np.abs(along), np.abs(along) * 2 * np.pi / around
    with np.errstate(divide="ignore", invalid="ignore"):
        own = np.real(normal[:, None] / (edge[:, None] - edge))
    np.fill_diagonal(own, np.imag(along.conj() * bent) / np.abs(along) ** 3 / 2)
    image = np.real(normal[:, None] * -edge.conj() / (1 - edge[:, None] * edge.conj()))
    charged = (patch.share + 1) / (2 * (patch.share - 1)) * np.eye(around) - (own + image) * length / (2 * np.pi)
    rim = np.exp(1j * angle)[..., None]
    inflow = -np.real(normal / (edge - rim)) / np.pi  # (N, q, around) d_n u_0
    felt = -np.log(np.abs(rim - edge)) * length / np.pi  # (N, q, around) potential
    driven, read = (np.einsum("kqa,kq,qi->kia", one, half, tested).reshape(-1, around) for one in (inflow, felt))
    return read @ np.linalg.solve(charged, driven.T)
