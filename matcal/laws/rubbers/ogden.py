"""Ogden: W = sum_i 2 mu_i/alpha_i^2 (sum_k lambda_bar_k^alpha_i - 3), mu_0 = sum_i mu_i, constants as Abaqus's.

A fit keeps every mu_i positive, which makes the law convex in the logarithmic stretches, and so Drucker stable.
Source: Ogden, Proc. R. Soc. A 326 (1972) 565, DOI 10.1098/rspa.1972.0026.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.hyperfoam import exp_remainder
from matcal.laws.law import Parameter, Ranges, check, sinh_ratio
from matcal.laws.rubbers.isochoric import NU, Isochoric
from touchcal.arrays import Array


@dataclass(frozen=True)
class Ogden(Isochoric):
    """Parameters of the law."""

    name: ClassVar[str] = "ogden"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mu_Pa", (0.0, np.inf), 1.0, True), Parameter("alpha", (-20.0, 20.0), 2.0, True), NU)
    linear_parameters: ClassVar[tuple[str, ...]] = ("mu_Pa",)
    mu_Pa: Array  # (N,) shear moduli
    alpha: Array  # (N,) exponents, non-zero
    nu: float = 0.5  # initial Poisson's ratio
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("mu_Pa", "alpha"):
            value = np.array(getattr(self, name), dtype=float, ndmin=1)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        if self.mu_Pa.shape != self.alpha.shape or np.any(self.alpha == 0):
            raise ValueError("ogden: mu_Pa and alpha must have one length and no alpha be 0, got "
                             f"{self.mu_Pa.tolist()} and {self.alpha.tolist()}.")
        check(self)

    @staticmethod
    def of_stretch(p, x):
        terms = (p.shape[0] - 1) // 2
        energy, first, second = 0.0, 0.0, 0.0
        for i in range(terms):
            mu, alpha = p[i], p[terms + i]
            growth = np.expm1(alpha * x)
            energy = energy + 2 * mu / alpha**2 * exp_remainder(alpha * x)
            first = first + 2 * mu / alpha * growth
            second = second + 2 * mu * (growth + 1)
        return energy, first, second

    @staticmethod
    def of_two_stretches(p, mean, half):
        terms = (p.shape[0] - 1) // 2
        slope = 0.0
        for i in range(terms):
            slope = slope + 2 * p[i] * np.exp(p[terms + i] * mean) * sinh_ratio(p[terms + i] * half)
        return slope
