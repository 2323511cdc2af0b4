"""Neo-Hooke: U = mu/2 (sum lambda_k^2 - 3 - 2 ln J) + lambda/2 (ln J)^2, lambda = 2 mu nu/(1 - 2 nu).

At nu = 1/2 the law keeps its volume, J = 1, and is the incompressible neo-Hooke.

Source: Bonet & Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (2008), 6.4.3.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.law import Law, Parameter, Ranges, sinh_ratio
from touchcal.jit import where


@dataclass(frozen=True)
class NeoHooke(Law):
    """Parameters of the law."""

    name: ClassVar[str] = "neo_hooke"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("mu_Pa", (0.0, np.inf), 1.0),
                                                   Parameter("nu", (-0.9, 0.495), 0.25))
    linear_parameters: ClassVar[tuple[str, ...]] = ("mu_Pa",)
    mu_Pa: float  # initial shear modulus
    nu: float  # initial Poisson's ratio
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    @property
    def kappa_0_Pa(self) -> float:
        """Initial bulk modulus, Pa; infinite where the law keeps its volume."""
        return np.inf if self.incompressible else super().kappa_0_Pa

    @staticmethod
    def energy_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        stretched = np.expm1(2 * x_1) + np.expm1(2 * x_2) + np.expm1(2 * x_3)
        return p[0] / 2 * (stretched - 2 * s) + _lame(p) / 2 * s * s

    @staticmethod
    def stress_at(p, x_1, x_2, x_3):
        volume = _lame(p) * (x_1 + x_2 + x_3)
        return p[0] * np.expm1(2 * x_1) + volume, p[0] * np.expm1(2 * x_2) + volume, p[0] * np.expm1(2 * x_3) + volume

    @staticmethod
    def tangent_at(p, x_1, x_2, x_3):
        bulk = _lame(p)
        return (2 * p[0] * np.exp(2 * x_1) + bulk, 2 * p[0] * np.exp(2 * x_2) + bulk, 2 * p[0] * np.exp(2 * x_3) + bulk,
                bulk, bulk, bulk)

    @staticmethod
    def difference_at(p, mean, half, x_3):
        return 2 * p[0] * np.exp(2 * mean) * sinh_ratio(2 * half)


def _lame(p):
    """lambda, Pa; 0 at nu = 1/2, where J = 1."""
    free = 1 - 2 * p[1]
    return where(free > 0, 2 * p[0] * p[1] / where(free > 0, free, 1.0), 0.0)
