"""Mooney-Rivlin of two constants: W = c_10 (I_1 - 3) + c_01 (I_2 - 3), mu_0 = 2 (c_10 + c_01).

Source: Mooney, J. Appl. Phys. 11 (1940) 582, DOI 10.1063/1.1712836; Rivlin, DOI 10.1098/rsta.1948.0024.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.law import Parameter, Ranges
from matcal.laws.rubbers.isochoric import NU, Isochoric

_ANY = (-np.inf, np.inf)


@dataclass(frozen=True)
class MooneyRivlin(Isochoric):
    """Parameters of the law."""

    name: ClassVar[str] = "mooney_rivlin"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("c_10_Pa", _ANY, 1.0), Parameter("c_01_Pa", _ANY, 0.1), NU)
    linear_parameters: ClassVar[tuple[str, ...]] = ("c_10_Pa", "c_01_Pa")
    c_10_Pa: float
    c_01_Pa: float
    nu: float = 0.5  # initial Poisson's ratio
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    @staticmethod
    def of_invariants(p, i_1, i_2):
        return p[0] * i_1 + p[1] * i_2, p[0], p[1], 0.0, 0.0, 0.0
