"""Hyperfoam (compressible Ogden-Hill) law in Abaqus's convention, exact at beta = 0.

U = sum_i 2 mu_i/alpha_i^2 [ sum_k lambda_k^alpha_i - 3 + (J^(-alpha_i beta_i) - 1)/beta_i ],
beta_i = nu_i/(1 - 2 nu_i); the limit beta_i -> 0 of the last term is -alpha_i ln J.

Everything is written in the logarithmic stretches x_k = ln lambda_k, so no term cancels near the rest state. The terms
stand here once: as functions of arrays, which the compiled loops of the finite elements call on single numbers.
Source: Abaqus Theory Guide, "Hyperelastic material behavior"; Storakers, J. Mech. Phys. Solids 34 (1986) 125,
DOI 10.1016/0022-5096(86)90033-5.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from touchcal.arrays import Array
from touchcal.jit import where

Real = Array | float  # an array, or a number inside a compiled loop
MODULI = ("instantaneous", "longterm")


@dataclass(frozen=True)
class Hyperfoam:
    """Parameters of the law."""

    mu_Pa: Array  # (N,) shear moduli, Pa; any sign, their sum (mu_0) must be positive
    alpha: Array  # (N,) exponents, non-zero
    nu: Array  # (N,) Poisson-like ratios, -1 < nu < 1/2
    moduli: str = "longterm"  # whether mu_Pa are the moduli before or after relaxation
    # mode -> (lowest, highest) fitted nominal strain (gamma for shear, J for volumetric)
    strain_range: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("mu_Pa", "alpha", "nu"):
            value = np.array(getattr(self, name), dtype=float, ndmin=1)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        if not (self.mu_Pa.shape == self.alpha.shape == self.nu.shape) or self.mu_Pa.ndim != 1:
            raise ValueError(f"hyperfoam: mu_Pa, alpha and nu must have one length, got {self.mu_Pa.size}, "
                             f"{self.alpha.size} and {self.nu.size}.")
        if not np.all(np.isfinite(np.concatenate([self.mu_Pa, self.alpha, self.nu]))):
            raise ValueError("hyperfoam: mu_Pa, alpha and nu must be finite numbers.")
        if np.any(self.alpha == 0):
            raise ValueError("hyperfoam: alpha must not be 0; its limit is not part of this law.")
        if np.any(self.nu >= 0.5) or np.any(self.nu <= -1):
            raise ValueError(f"hyperfoam: nu must lie between -1 and 0.5, got {self.nu.tolist()}.")
        if self.mu_Pa.sum() <= 0:
            raise ValueError(f"hyperfoam: mu_0 = sum of mu_Pa must be positive, got {self.mu_Pa.sum():g} Pa.")
        if self.moduli not in MODULI:
            raise ValueError(f"hyperfoam: moduli '{self.moduli}' is unknown; known: {', '.join(MODULI)}.")

    @property
    def beta(self) -> Array:
        """(N,) beta_i = nu_i/(1 - 2 nu_i)."""
        return self.nu / (1 - 2 * self.nu)

    @property
    def mu_0_Pa(self) -> float:
        """Initial shear modulus mu_0 = sum mu_i, Pa."""
        return float(self.mu_Pa.sum())

    @property
    def E_0_Pa(self) -> float:
        """Initial Young's modulus, Pa: 2 mu_0 (1 + nu_0) with the bulk modulus sum 2 mu_i (1/3 + beta_i)."""
        bulk = float(np.sum(2 * self.mu_Pa * (1 / 3 + self.beta)))
        return 9 * bulk * self.mu_0_Pa / (3 * bulk + self.mu_0_Pa)


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


def sinh_ratio(z: Real) -> Real:
    """sinh(z)/z without cancellation, 1 at 0."""
    small = np.abs(z) < 1e-4
    return where(small, 1 + z * z / 6, np.sinh(z) / where(small, 1.0, z))


# What compiled loops may call.
TERMS = (energy_term, stretch_growth, volume_growth, kirchhoff_term, stretch_tangent_term, volume_tangent_term,
         divided_difference_term, exp_remainder, sinh_ratio)


def energy(law: Hyperfoam, x: ArrayLike) -> Array:
    """Strain energy per reference volume, Pa, at logarithmic stretches x (..., 3)."""
    x_1, x_2, x_3 = np.moveaxis(np.asarray(x, dtype=float), -1, 0)
    total = np.zeros(x_1.shape)
    with np.errstate(over="ignore", invalid="ignore"):
        for mu, a, b in zip(law.mu_Pa, law.alpha, law.beta, strict=True):
            total = total + energy_term(mu, a, b, x_1, x_2, x_3)
    return total


def kirchhoff_per_modulus(alpha: ArrayLike, beta: ArrayLike, x: ArrayLike) -> Array:
    """Principal Kirchhoff stresses of single terms per unit mu, d tau_k/d mu_i, (N, ..., 3), for alpha, beta (N,)."""
    x = np.asarray(x, dtype=float)
    shape = (-1,) + (1,) * x.ndim
    a = np.asarray(alpha, dtype=float).reshape(shape)
    b = np.broadcast_to(np.asarray(beta, dtype=float), a.size).reshape(shape)
    volume = volume_growth(a, b, x.sum(axis=-1, keepdims=True)) if np.any(b != 0) else 0.0
    return np.asarray(kirchhoff_term(1.0, a, stretch_growth(a, x), volume))


def kirchhoff(law: Hyperfoam, x: ArrayLike) -> Array:
    """Principal Kirchhoff stresses tau_k = dU/dx_k, Pa, (..., 3), at logarithmic stretches x (..., 3)."""
    return np.tensordot(law.mu_Pa, kirchhoff_per_modulus(law.alpha, law.beta, x), axes=1)


def kirchhoff_tangent(law: Hyperfoam, x: ArrayLike) -> Array:
    """d tau_k / d x_l = d2U/dx_k dx_l, Pa, (..., 3, 3), symmetric, at logarithmic stretches x (..., 3)."""
    x = np.asarray(x, dtype=float)
    s = x.sum(axis=-1)[..., None, None]
    tangent = np.zeros((*x.shape, 3))
    for mu, a, b in zip(law.mu_Pa, law.alpha, law.beta, strict=True):
        own = np.asarray(stretch_tangent_term(mu, stretch_growth(a, x)))
        tangent = tangent + (own[..., None] * np.eye(3) + volume_tangent_term(mu, b, volume_growth(a, b, s)))
    return tangent


def kirchhoff_difference(law: Hyperfoam, mean: ArrayLike, half: ArrayLike) -> Array:
    """Divided difference (tau_1 - tau_2)/(x_1 - x_2), Pa, at x_1, x_2 = mean +- half, of any one shape."""
    mean, half = np.asarray(mean, dtype=float), np.asarray(half, dtype=float)
    difference = np.zeros(np.broadcast_shapes(mean.shape, half.shape))
    for mu, a in zip(law.mu_Pa, law.alpha, strict=True):
        ends = stretch_growth(a, mean + half), stretch_growth(a, mean - half)
        difference = difference + divided_difference_term(mu, a, half, *ends)
    return difference
