from dataclasses import dataclass, field
from typing import ClassVar

from matcal.laws.law import Law, Parameter


@dataclass(frozen=True)
class Hencky(Law):
    name: ClassVar[str] = "hencky"
    parameters: ClassVar[tuple] = (Parameter("mu_Pa", (0, 1e9), 1.0), Parameter("kappa_Pa", (0, 1e12), 2.0))
    mu_Pa: float
    kappa_Pa: float
    moduli: str = "longterm"
    strain_range: dict = field(default_factory=dict)

    @staticmethod
    def energy_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        return p[0] * (x_1**2 + x_2**2 + x_3**2 - s**2 / 3) + p[1] / 2 * s**2

    @staticmethod
    def stress_at(p, x_1, x_2, x_3):
        rest = (p[1] - 2 * p[0] / 3) * (x_1 + x_2 + x_3)
        return 2 * p[0] * x_1 + rest, 2 * p[0] * x_2 + rest, 2 * p[0] * x_3 + rest

    @staticmethod
    def tangent_at(p, x_1, x_2, x_3):
        off = p[1] - 2 * p[0] / 3 + 0 * x_1
        return off + 2 * p[0], off + 2 * p[0], off + 2 * p[0], off, off, off

    @staticmethod
    def difference_at(p, mean, half, x_3):
        return 2 * p[0] + 0 * mean
