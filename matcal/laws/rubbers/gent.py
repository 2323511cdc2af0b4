"""Gent: W = -mu J_m/2 ln(1 - (I_1 - 3)/J_m), mu_0 = mu; the energy is infinite where I_1 - 3 reaches J_m.

Source: Gent, Rubber Chem. Technol. 69 (1996) 59, DOI 10.5254/1.3538357.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.law import Parameter, Ranges
from matcal.laws.rubbers.isochoric import NU, Isochoric
from touchcal.jit import where


@dataclass(frozen=True)
class Gent(Isochoric):
    """Parameters of the law."""

    name: ClassVar[str] = "gent"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mu_Pa", (0.0, np.inf), 1.0), Parameter("j_m", (0.01, 1e4), 50.0), NU)
    linear_parameters: ClassVar[tuple[str, ...]] = ("mu_Pa",)
    mu_Pa: float
    j_m: float  # I_1 - 3 at which the chains are straight
    nu: float = 0.5  # initial Poisson's ratio
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    @staticmethod
    def of_invariants(p, i_1, i_2):
        inside = i_1 < p[1]
        left = where(inside, 1 - i_1 / p[1], np.nan)
        return (where(inside, -p[0] * p[1] / 2 * np.log1p(left - 1), np.inf), p[0] / 2 / left, 0.0,
                p[0] / 2 / p[1] / left**2, 0.0, 0.0)
