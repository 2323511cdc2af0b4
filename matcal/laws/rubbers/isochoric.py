"""Rubbers: energies of the stretches at constant volume, lambda_bar_k = J^(-1/3) lambda_k, and of the volume alone.

U = W(I_1, I_2) + sum_k w(ln lambda_bar_k) + kappa/2 (J - 1)^2, I_1 = sum lambda_bar_k^2, I_2 = sum lambda_bar_k^-2. A
law states W with its derivatives, or w with its own, or both; stress, tangent and divided difference follow here once.
Source: Ogden, Non-linear Elastic Deformations (1984), 7.2; Simo & Taylor, DOI 10.1016/0045-7825(91)90100-K.
"""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from matcal.laws.hyperfoam import exp_remainder
from matcal.laws.law import Law, Parameter, sinh_ratio
from matcal.laws.volumetric import bulk_modulus, volume_energy, volume_stress, volume_tangent

NU = Parameter("nu", (0.0, 0.4999999), 0.5)  # last parameter of every such law


class Isochoric(Law):
    """A law of the stretches at constant volume, whose last parameter is nu, 1/2 where it keeps its volume."""

    keeps_volume: ClassVar[bool] = True
    nu: float

    @staticmethod
    def of_invariants(p: Any, i_1: Any, i_2: Any) -> Any:
        """W, its derivatives W_1, W_2, W_11, W_12, W_22, Pa, at i_1 = I_1 - 3 and i_2 = I_2 - 3."""
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0

    @staticmethod
    def of_stretch(p: Any, x: Any) -> Any:
        """w, w', w'', Pa, at a logarithmic stretch x; w and w' are 0 at rest."""
        return 0.0, 0.0, 0.0

    @staticmethod
    def of_two_stretches(p: Any, mean: Any, half: Any) -> Any:
        """(w'(x_1) - w'(x_2))/(x_1 - x_2), Pa, at mean +- half, without cancellation at half = 0."""
        return 0.0

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        cls.energy_at, cls.stress_at, cls.tangent_at, cls.difference_at = map(
            staticmethod, _assembled(cls.__qualname__, cls.of_invariants, cls.of_stretch, cls.of_two_stretches))

    @property
    def mu_0_Pa(self) -> float:
        """Initial shear modulus 2 (W_1 + W_2) + w''/2 at rest, Pa."""
        rest = self.of_invariants(self.numbers, 0.0, 0.0)
        return float(2 * (rest[1] + rest[2]) + self.of_stretch(self.numbers, 0.0)[2] / 2)

    @property
    def kappa_0_Pa(self) -> float:
        """Initial bulk modulus, Pa; infinite where the law keeps its volume."""
        return np.inf if self.incompressible else float(bulk_modulus(self.mu_0_Pa, self.nu))


def _assembled(law: str, of_invariants: Callable[..., Any], of_stretch: Callable[..., Any],
               of_two_stretches: Callable[..., Any]) -> tuple[Callable[..., Any], ...]:
    """The four functions of a law. They and what they call are named after it: compiled code that was kept on disk by
    different processes is distinguished by names alone."""
    def bulk(p):
        """kappa, Pa; mu_0 = 2 (W_1 + W_2) + w''/2 at rest."""
        rest = of_invariants(p, 0.0, 0.0)
        return bulk_modulus(2 * (rest[1] + rest[2]) + of_stretch(p, 0.0)[2] / 2, p[-1])

    def invariants(a, b, c):
        return (exp_remainder(2 * a) + exp_remainder(2 * b) + exp_remainder(2 * c),
                exp_remainder(-2 * a) + exp_remainder(-2 * b) + exp_remainder(-2 * c))

    def energy_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        a, b, c = x_1 - s / 3, x_2 - s / 3, x_3 - s / 3
        i_1, i_2 = invariants(a, b, c)
        stretched = of_stretch(p, a)[0] + of_stretch(p, b)[0] + of_stretch(p, c)[0]
        return of_invariants(p, i_1, i_2)[0] + stretched + volume_energy(bulk(p), s)

    def stress_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        a, b, c = x_1 - s / 3, x_2 - s / 3, x_3 - s / 3
        g_1, g_2, g_3, h_1, h_2, h_3 = np.expm1(2 * a), np.expm1(2 * b), np.expm1(2 * c), np.expm1(-2 * a), np.expm1(
            -2 * b), np.expm1(-2 * c)
        w = of_invariants(p, g_1 + g_2 + g_3, h_1 + h_2 + h_3)
        t_1 = 2 * w[1] * g_1 - 2 * w[2] * h_1 + of_stretch(p, a)[1]
        t_2 = 2 * w[1] * g_2 - 2 * w[2] * h_2 + of_stretch(p, b)[1]
        t_3 = 2 * w[1] * g_3 - 2 * w[2] * h_3 + of_stretch(p, c)[1]
        shift = volume_stress(bulk(p), s) - (t_1 + t_2 + t_3) / 3
        return t_1 + shift, t_2 + shift, t_3 + shift

    def row(w, up_k, down_k, up_l, down_l):
        return 4 * (w[3] * up_k * up_l - w[4] * (up_k * down_l + down_k * up_l) + w[5] * down_k * down_l)

    def tangent_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        a, b, c = x_1 - s / 3, x_2 - s / 3, x_3 - s / 3
        i_1, i_2 = invariants(a, b, c)
        w = of_invariants(p, i_1, i_2)
        u_1, u_2, u_3, d_1, d_2, d_3 = np.exp(2 * a), np.exp(2 * b), np.exp(2 * c), np.exp(-2 * a), np.exp(
            -2 * b), np.exp(-2 * c)
        h_11 = 4 * (w[1] * u_1 + w[2] * d_1) + of_stretch(p, a)[2] + row(w, u_1, d_1, u_1, d_1)
        h_22 = 4 * (w[1] * u_2 + w[2] * d_2) + of_stretch(p, b)[2] + row(w, u_2, d_2, u_2, d_2)
        h_33 = 4 * (w[1] * u_3 + w[2] * d_3) + of_stretch(p, c)[2] + row(w, u_3, d_3, u_3, d_3)
        h_12, h_13, h_23 = row(w, u_1, d_1, u_2, d_2), row(w, u_1, d_1, u_3, d_3), row(w, u_2, d_2, u_3, d_3)
        m_1, m_2, m_3 = (h_11 + h_12 + h_13) / 3, (h_12 + h_22 + h_23) / 3, (h_13 + h_23 + h_33) / 3
        mean = (m_1 + m_2 + m_3) / 3 + volume_tangent(bulk(p), s)
        return (h_11 - 2 * m_1 + mean, h_22 - 2 * m_2 + mean, h_33 - 2 * m_3 + mean,
                h_12 - m_1 - m_2 + mean, h_13 - m_1 - m_3 + mean, h_23 - m_2 - m_3 + mean)

    def difference_at(p, mean, half, x_3):
        s = 2 * mean + x_3
        m, c = mean - s / 3, x_3 - s / 3
        i_1, i_2 = invariants(m + half, m - half, c)
        w = of_invariants(p, i_1, i_2)
        ratio = sinh_ratio(2 * half)
        return 4 * ratio * (w[1] * np.exp(2 * m) + w[2] * np.exp(-2 * m)) + of_two_stretches(p, m, half)

    for function in (bulk, invariants, row, energy_at, stress_at, tangent_at, difference_at):
        function.__qualname__ = f"{law}.{function.__name__}"
    return energy_at, stress_at, tangent_at, difference_at
