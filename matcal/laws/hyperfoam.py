"""Hyperfoam (compressible Ogden-Hill) law in Abaqus's convention, exact at beta = 0.

U = sum_i 2 mu_i/alpha_i^2 [ sum_k lambda_k^alpha_i - 3 + (J^(-alpha_i beta_i) - 1)/beta_i ],
beta_i = nu_i/(1 - 2 nu_i); the limit beta_i -> 0 of the last term is -alpha_i ln J.

Everything is written in the logarithmic stretches x_k = ln lambda_k, so no term cancels near the rest state. The terms
stand here once: as functions of arrays, which the compiled loops of the finite elements call on single numbers.
Source: Abaqus Theory Guide, "Hyperelastic material behavior"; Storakers, J. Mech. Phys. Solids 34 (1986) 125,
DOI 10.1016/0022-5096(86)90033-5.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from matcal.laws.law import Law, Parameter, Ranges, Real, check
from touchcal.arrays import Array
from touchcal.jit import where


def energy_term(mu: float, alpha: float, beta: float, x_1: Real, x_2: Real, x_3: Real) -> Real:
    """Energy of one term, Pa, at logarithmic stretches."""
    inner = exp_remainder(alpha * x_1) + exp_remainder(alpha * x_2) + exp_remainder(alpha * x_3)
    if beta != 0:
        inner = inner + exp_remainder(-alpha * beta * (x_1 + x_2 + x_3)) / beta
    return 2 * mu / alpha**2 * inner


def stretch_growth(alpha: Real, x: Real) -> Real:
    """lambda^alpha - 1 at a logarithmic stretch x."""
    return np.expm1(alpha * x)


def volume_growth(alpha: Real, beta: Real, s: Real) -> Real:
    """J^(-alpha beta) - 1 at s = ln J; 0 where beta is."""
    return np.expm1(-alpha * beta * s)


def kirchhoff_term(mu: Real, alpha: Real, stretch: Real, volume: Real) -> Real:
    """Principal Kirchhoff stress of one term, Pa, from stretch_growth and volume_growth."""
    return 2 * mu / alpha * (stretch - volume)


def stretch_tangent_term(mu: Real, stretch: Real) -> Real:
    """Part of d tau_k/dx_k of one term, Pa, from stretch_growth at x_k."""
    return 2 * mu * (stretch + 1)


def volume_tangent_term(mu: Real, beta: Real, volume: Real) -> Real:
    """Part of every d tau_k/dx_l of one term, Pa, from volume_growth."""
    return 2 * mu * beta * (volume + 1)


def divided_difference_term(mu: Real, alpha: Real, half: Real, stretch_1: Real, stretch_2: Real) -> Real:
    """(tau_1 - tau_2)/(x_1 - x_2) of one term, Pa, from half = (x_1 - x_2)/2 and stretch_growth at both; the volumetric
    part drops out, and nothing cancels at half = 0."""
    larger, smaller, z = stretch_1 + 1, stretch_2 + 1, alpha * half
    near = np.abs(z) < 0.05
    series = 1 + z * z * (1 / 6 + z * z * (1 / 120 + z * z / 5040))
    return where(near, 2 * mu * np.sqrt(larger * smaller) * series, mu * (larger - smaller) / where(near, 1.0, z))


def exp_remainder(z: Real) -> Real:
    """e^z - 1 - z without cancellation."""
    series = z * z * (1 / 2 + z * (1 / 6 + z * (1 / 24 + z * (1 / 120 + z * (1 / 720 + z / 5040)))))
    return where(np.abs(z) < 0.05, series, np.expm1(z) - z)

def respond(p, x, mean, half, tau, tangent, slope):
    """As `matcal.laws.compiled_response.responses`: each power of a stretch is worked out once."""
    growth = np.empty(3)
    tau[:] = 0.0
    tangent[:] = 0.0
    slope[:] = 0.0
    for n in range(x.shape[0]):
        for i in range(p.shape[1]):
            mu, alpha, beta = p[0, i], p[1, i], p[2, i]
            volume, bulk = 0.0, 0.0
            if beta != 0:
                volume = volume_growth(alpha, beta, x[n, 0] + x[n, 1] + x[n, 2])
                bulk = volume_tangent_term(mu, beta, volume)
            for k in range(3):
                growth[k] = stretch_growth(alpha, x[n, k])
                tau[n, k] += kirchhoff_term(mu, alpha, growth[k], volume)
                tangent[n, k, k] += stretch_tangent_term(mu, growth[k])
                for m in range(3):
                    tangent[n, k, m] += bulk
            for pair in range(half.shape[1]):
                first, second = pair // 2, 1 + (pair + 1) // 2
                slope[n, pair] += divided_difference_term(mu, alpha, half[n, pair], growth[first], growth[second])


def kirchhoff_per_modulus(alpha: ArrayLike, beta: ArrayLike, x: ArrayLike) -> Array:
    """Principal Kirchhoff stresses of single terms per unit mu, d tau_k/d mu_i, (N, ..., 3), for alpha, beta (N,)."""
    x = np.asarray(x, dtype=float)
    shape = (-1,) + (1,) * x.ndim
    a = np.asarray(alpha, dtype=float).reshape(shape)
    b = np.broadcast_to(np.asarray(beta, dtype=float), a.size).reshape(shape)
    volume = volume_growth(a, b, x.sum(axis=-1, keepdims=True)) if np.any(b != 0) else 0.0
    return np.asarray(kirchhoff_term(1.0, a, stretch_growth(a, x), volume))


@dataclass(frozen=True)
class Hyperfoam(Law):
    """Parameters of the law."""

    name: ClassVar[str] = "hyperfoam"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mu_Pa", (-np.inf, np.inf), 1.0, True), Parameter("alpha", (-50.0, 50.0), 2.0, True),
        Parameter("nu", (-0.9, 0.495), 0.0, True, varied=False))
    linear_parameters: ClassVar[tuple[str, ...]] = ("mu_Pa",)
    respond = staticmethod(respond)
    mu_Pa: Array  # (N,) shear moduli, Pa; any sign, their sum (mu_0) must be positive
    alpha: Array  # (N,) exponents, non-zero
    nu: Array  # (N,) Poisson-like ratios, -1 < nu < 1/2
    moduli: str = "longterm"  # whether mu_Pa are the moduli before or after relaxation
    # mode -> (lowest, highest) fitted nominal strain (gamma for shear, J for volumetric)
    strain_range: Ranges = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("mu_Pa", "alpha", "nu"):
            value = np.array(getattr(self, name), dtype=float, ndmin=1)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        if not (self.mu_Pa.shape == self.alpha.shape == self.nu.shape) or self.mu_Pa.ndim != 1:
            raise ValueError(f"hyperfoam: mu_Pa, alpha and nu must have one length, got {self.mu_Pa.size}, "
                             f"{self.alpha.size} and {self.nu.size}.")
        if np.any(self.alpha == 0):
            raise ValueError("hyperfoam: alpha must not be 0; its limit is not part of this law.")
        if np.any(self.nu >= 0.5) or np.any(self.nu <= -1):
            raise ValueError(f"hyperfoam: nu must lie between -1 and 0.5, got {self.nu.tolist()}.")
        check(self)

    @property
    def beta(self) -> Array:
        """(N,) beta_i = nu_i/(1 - 2 nu_i)."""
        return self.nu / (1 - 2 * self.nu)

    @property
    def numbers(self) -> Array:
        """(3, N) mu, alpha and beta."""
        return np.stack([self.mu_Pa, self.alpha, self.beta])

    @property
    def mu_0_Pa(self) -> float:
        """Initial shear modulus mu_0 = sum mu_i, Pa."""
        return float(self.mu_Pa.sum())

    @property
    def kappa_0_Pa(self) -> float:
        """Initial bulk modulus sum 2 mu_i (1/3 + beta_i), Pa."""
        return float(np.sum(2 * self.mu_Pa * (1 / 3 + self.beta)))

    @property
    def hencky_ratio(self) -> tuple[float, bool]:
        """nu where it is one for all terms, at every strain; else the mean."""
        return float(self.nu.mean()), bool(np.ptp(self.nu) == 0)

    @staticmethod
    def energy_at(p, x_1, x_2, x_3):
        """As `Law.energy_at`, of p (3, N)."""
        total = 0.0
        for i in range(p.shape[1]):
            total = total + energy_term(p[0, i], p[1, i], p[2, i], x_1, x_2, x_3)
        return total

    def kirchhoff(self, x: ArrayLike) -> Array:
        """As `Law.kirchhoff`, of all terms at once."""
        return np.tensordot(self.mu_Pa, kirchhoff_per_modulus(self.alpha, self.beta, x), axes=1)

    def tangent(self, x: ArrayLike) -> Array:
        """As `Law.tangent`."""
        x = np.asarray(x, dtype=float)
        s = x.sum(axis=-1)[..., None, None]
        tangent = np.zeros((*x.shape, 3))
        for mu, a, b in zip(self.mu_Pa, self.alpha, self.beta, strict=True):
            own = np.asarray(stretch_tangent_term(mu, stretch_growth(a, x)))
            tangent = tangent + (own[..., None] * np.eye(3) + volume_tangent_term(mu, b, volume_growth(a, b, s)))
        return tangent

    def difference(self, mean: ArrayLike, half: ArrayLike, third: ArrayLike = 0.0) -> Array:
        """As `Law.difference`, whatever x_3."""
        mean, half = np.asarray(mean, dtype=float), np.asarray(half, dtype=float)
        difference = np.zeros(np.broadcast_shapes(mean.shape, half.shape))
        for mu, a in zip(self.mu_Pa, self.alpha, strict=True):
            ends = stretch_growth(a, mean + half), stretch_growth(a, mean - half)
            difference = difference + divided_difference_term(mu, a, half, *ends)
        return difference
