"""Extended tube: chains of finite length, D = I_1 - 3, and their confinement by neighbours.

W = G_c/2 [(1 - delta^2) D/(1 - delta^2 D) + ln(1 - delta^2 D)] + 2 G_e/beta^2 sum_k (lambda_bar_k^-beta - 1),
mu_0 = G_c (1 - 2 delta^2) + G_e; the energy is infinite where D reaches 1/delta^2.
Source: Kaliske & Heinrich, Rubber Chem. Technol. 72 (1999) 602, DOI 10.5254/1.3538822.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.hyperfoam import exp_remainder
from matcal.laws.law import Parameter, Ranges, sinh_ratio
from matcal.laws.rubbers.isochoric import NU, Isochoric
from touchcal.jit import where


@dataclass(frozen=True)
class ExtendedTube(Isochoric):
    """Parameters of the law."""

    name: ClassVar[str] = "extended_tube"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("g_c_Pa", (0.0, np.inf), 1.0), Parameter("delta", (0.0, 0.6), 0.1),
        Parameter("g_e_Pa", (0.0, np.inf), 1.0), Parameter("beta", (0.01, 2.0), 0.3), NU)
    linear_parameters: ClassVar[tuple[str, ...]] = ("g_c_Pa", "g_e_Pa")
    g_c_Pa: float  # modulus of the crosslinks
    delta: float  # inextensibility of the chains
    g_e_Pa: float  # modulus of the confining tube
    beta: float  # how far the tube is released
    nu: float = 0.5  # initial Poisson's ratio
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    @staticmethod
    def of_invariants(p, i_1, i_2):
        q = p[1] * p[1]
        inside = q * i_1 < 1
        left = where(inside, 1 - q * i_1, np.nan)
        energy = p[0] / 2 * ((1 - q) * i_1 / left + np.log1p(left - 1))
        return (where(inside, energy, np.inf), p[0] / 2 * ((1 - q) / left**2 - q / left), 0.0,
                p[0] / 2 * (2 * q * (1 - q) / left**3 - q * q / left**2), 0.0, 0.0)

    @staticmethod
    def of_stretch(p, x):
        return (2 * p[2] / p[3] ** 2 * exp_remainder(-p[3] * x), -2 * p[2] / p[3] * np.expm1(-p[3] * x),
                2 * p[2] * np.exp(-p[3] * x))

    @staticmethod
    def of_two_stretches(p, mean, half):
        return 2 * p[2] * np.exp(-p[3] * mean) * sinh_ratio(p[3] * half)
