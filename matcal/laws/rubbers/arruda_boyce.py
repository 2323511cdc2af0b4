"""Arruda-Boyce, eight chains, series of five terms: W = mu sum_i C_i lambda_m^(2 - 2 i) (I_1^i - 3^i).

C = 1/2, 1/20, 11/1050, 19/7000, 519/673750; mu_0 = 2 mu sum_i i C_i (3/lambda_m^2)^(i - 1).
Source: Arruda & Boyce, J. Mech. Phys. Solids 41 (1993) 389, DOI 10.1016/0022-5096(93)90013-6.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.law import Parameter, Ranges
from matcal.laws.rubbers.isochoric import NU, Isochoric

C_1, C_2, C_3, C_4, C_5 = 1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750


@dataclass(frozen=True)
class ArrudaBoyce(Isochoric):
    """Parameters of the law."""

    name: ClassVar[str] = "arruda_boyce"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mu_Pa", (0.0, np.inf), 1.0), Parameter("lambda_m", (0.5, 50.0), 4.0), NU)
    linear_parameters: ClassVar[tuple[str, ...]] = ("mu_Pa",)
    mu_Pa: float
    lambda_m: float  # stretch at which the chains lock
    nu: float = 0.5  # initial Poisson's ratio
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    @staticmethod
    def of_invariants(p, i_1, i_2):
        t, q = i_1 + 3, p[1] ** -2.0
        squares, cubes = t * t + 3 * t + 9, t**3 + 3 * t * t + 9 * t + 27
        energy = i_1 * (C_1 + q * (C_2 * (t + 3) + q * (C_3 * squares + q * (C_4 * cubes + q * C_5 * (
            t * cubes + 81)))))
        first = C_1 + q * t * (2 * C_2 + q * t * (3 * C_3 + q * t * (4 * C_4 + q * t * 5 * C_5)))
        second = q * (2 * C_2 + q * t * (6 * C_3 + q * t * (12 * C_4 + q * t * 20 * C_5)))
        return p[0] * energy, p[0] * first, 0.0, p[0] * second, 0.0, 0.0
