"""Yeoh: W = c_10 (I_1 - 3) + c_20 (I_1 - 3)^2 + c_30 (I_1 - 3)^3, mu_0 = 2 c_10.

Source: Yeoh, Rubber Chem. Technol. 66 (1993) 754, DOI 10.5254/1.3538343.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from matcal.laws.law import Parameter, Ranges
from matcal.laws.rubbers.isochoric import NU, Isochoric

_ANY = (-np.inf, np.inf)


@dataclass(frozen=True)
class Yeoh(Isochoric):
    """Parameters of the law."""

    name: ClassVar[str] = "yeoh"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("c_10_Pa", _ANY, 1.0), Parameter("c_20_Pa", _ANY, 0.0), Parameter("c_30_Pa", _ANY, 0.0), NU)
    linear_parameters: ClassVar[tuple[str, ...]] = ("c_10_Pa", "c_20_Pa", "c_30_Pa")
    c_10_Pa: float
    c_20_Pa: float
    c_30_Pa: float
    nu: float = 0.5  # initial Poisson's ratio
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    @staticmethod
    def of_invariants(p, i_1, i_2):
        return (i_1 * (p[0] + i_1 * (p[1] + i_1 * p[2])), p[0] + i_1 * (2 * p[1] + 3 * p[2] * i_1), 0.0,
                2 * p[1] + 6 * p[2] * i_1, 0.0, 0.0)
