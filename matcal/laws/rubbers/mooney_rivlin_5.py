"""Mooney-Rivlin of five constants: W = sum c_ij (I_1 - 3)^i (I_2 - 3)^j over 1 <= i + j <= 2, mu_0 = 2 (c_10 + c_01).

Source: Rivlin & Saunders, Phil. Trans. R. Soc. A 243 (1951) 251, DOI 10.1098/rsta.1951.0004.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.law import Parameter, Ranges
from matcal.laws.rubbers.isochoric import NU, Isochoric

_ANY = (-np.inf, np.inf)
_CONSTANTS = ("c_10_Pa", "c_01_Pa", "c_20_Pa", "c_11_Pa", "c_02_Pa")


@dataclass(frozen=True)
class MooneyRivlin5(Isochoric):
    """Parameters of the law."""

    name: ClassVar[str] = "mooney_rivlin_5"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        *(Parameter(constant, _ANY, float(k == 0)) for k, constant in enumerate(_CONSTANTS)), NU)
    linear_parameters: ClassVar[tuple[str, ...]] = _CONSTANTS
    c_10_Pa: float
    c_01_Pa: float
    c_20_Pa: float
    c_11_Pa: float
    c_02_Pa: float
    nu: float = 0.5  # initial Poisson's ratio
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    @staticmethod
    def of_invariants(p, i_1, i_2):
        energy = p[0] * i_1 + p[1] * i_2 + p[2] * i_1 * i_1 + p[3] * i_1 * i_2 + p[4] * i_2 * i_2
        return (energy, p[0] + 2 * p[2] * i_1 + p[3] * i_2, p[1] + p[3] * i_1 + 2 * p[4] * i_2,
                2 * p[2], p[3], 2 * p[4])
