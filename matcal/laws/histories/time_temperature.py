"""Shift of times with temperature: the material at T is at log10 a_T decades of time later what it is at the reference.

Sources: Williams, Landel & Ferry, J. Am. Chem. Soc. 77 (1955) 3701, DOI 10.1021/ja01619a008; Ferry 1980, chapter 11.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from touchcal.arrays import Array

GAS_J_PER_MOL_K = 8.314462618


@dataclass(frozen=True)
class Wlf:
    """log10 a_T = -C_1 (T - T_r)/(C_2 + T - T_r)."""

    C1: float  # decades
    C2_K: float  # K
    reference_K: float  # T_r, K


@dataclass(frozen=True)
class Arrhenius:
    """ln a_T = E_a/R (1/T - 1/T_r)."""

    activation_J_per_mol: float  # E_a
    reference_K: float  # T_r, K


Shift = Wlf | Arrhenius


def decades(law: Shift, temperature_K: ArrayLike) -> Array:
    """log10 a_T at temperatures (any shape), K; ValueError where a WLF shift has no value (T <= T_r - C_2)."""
    t = np.asarray(temperature_K, dtype=float)
    if isinstance(law, Arrhenius):
        return law.activation_J_per_mol / (GAS_J_PER_MOL_K * np.log(10)) * (1 / t - 1 / law.reference_K)
    above = law.C2_K + t - law.reference_K
    if np.any(above <= 0):
        raise ValueError(f"the WLF shift ends at {law.reference_K - law.C2_K - 273.15:.4g} C; stay above it.")
    return -law.C1 * (t - law.reference_K) / above
