"""Compressible neo-Hooke: U = mu/2 (sum lambda_k^2 - 3 - 2 ln J) + lambda/2 (ln J)^2, lambda = 2 mu nu/(1 - 2 nu).

Source: Bonet & Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (2008), 6.4.3.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.law import Law, Parameter, Ranges, sinh_ratio


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

    @staticmethod
    def energy_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        stretched = np.expm1(2 * x_1) + np.expm1(2 * x_2) + np.expm1(2 * x_3)
        return p[0] / 2 * (stretched - 2 * s) + p[0] * p[1] / (1 - 2 * p[1]) * s * s

    @staticmethod
    def stress_at(p, x_1, x_2, x_3):
        volume = 2 * p[0] * p[1] / (1 - 2 * p[1]) * (x_1 + x_2 + x_3)
        return p[0] * np.expm1(2 * x_1) + volume, p[0] * np.expm1(2 * x_2) + volume, p[0] * np.expm1(2 * x_3) + volume

    @staticmethod
    def tangent_at(p, x_1, x_2, x_3):
        bulk = 2 * p[0] * p[1] / (1 - 2 * p[1])
        return (2 * p[0] * np.exp(2 * x_1) + bulk, 2 * p[0] * np.exp(2 * x_2) + bulk, 2 * p[0] * np.exp(2 * x_3) + bulk,
                bulk, bulk, bulk)

    @staticmethod
    def difference_at(p, mean, half, x_3):
        return 2 * p[0] * np.exp(2 * mean) * sinh_ratio(2 * half)
