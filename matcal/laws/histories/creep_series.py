"""Creep and relaxation as one material: J(t) = J_0 + sum J_i (1 - exp(-t/lambda_i)) and E(t) = E_inf + sum E_k
exp(-t/tau_k) with s J~(s) s E~(s) = 1, solved exactly.

Source: Park & Schapery, Int. J. Solids Struct. 36 (1999) 1653, DOI 10.1016/S0020-7683(98)00055-9.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.optimize import root_scalar

from touchcal.arrays import Array


def relaxation_of(J_0: float, J: Array, lambda_s: Array) -> tuple[float, Array, Array]:
    """(E_inf, E (M,), tau_s (M,)) of J_0 > 0, J (M,) > 0 and increasing lambda_s (M,); every tau_k lies between
    lambda_(k-1) and lambda_k."""
    ends = np.r_[lambda_s[0] * J_0 / (2 * (J_0 + J.sum())), lambda_s]

    def carson(ln_tau: float) -> float:
        tau = np.exp(ln_tau)
        return float(J_0 + np.sum(J * tau / (tau - lambda_s)))

    roots = [root_scalar(carson, bracket=_inside(carson, np.log(low), np.log(high)), xtol=1e-14).root
             for low, high in pairwise(ends)]
    tau = np.exp(np.array(roots))
    s = -1 / tau
    slope = -np.sum(J * lambda_s / (1 + lambda_s * s[:, None])**2, axis=1)
    return 1 / (J_0 + float(J.sum())), 1 / (slope * s), tau


def _inside(carson: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Ends just inside a gap between poles, between which the function falls from above 0 to below it."""
    width = high - low
    for k in range(4, 46):
        ends = low + width * 2.0**-k, high - width * 2.0**-k
        if carson(ends[0]) > 0 > carson(ends[1]):
            return ends
    raise ValueError(f"retardation times around {np.exp(high):.3g} s are too close or one has no compliance.")
