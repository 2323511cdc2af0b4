"""A law that the program does not have, known to it while a test runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import pytest

from matcal.laws.known_laws import LAWS
from matcal.laws.law import Law, Parameter, Ranges, sinh_ratio


@dataclass(frozen=True)
class MooneyRivlin(Law):
    """U = c_1 (I_1 - 3) + c_2 (I_2 - 3) + kappa/2 (ln J)^2, I_1 and I_2 of the stretches without change of volume."""

    name: ClassVar[str] = "split_volume"
    parameters: ClassVar[tuple[Parameter, ...]] = (Parameter("c_1_Pa", (0.0, np.inf), 1.0),
                                                   Parameter("c_2_Pa", (0.0, np.inf), 0.1),
                                                   Parameter("kappa_Pa", (0.0, np.inf), 4.0))
    c_1_Pa: float
    c_2_Pa: float
    kappa_Pa: float
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    @staticmethod
    def energy_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        first = np.expm1(2 * (x_1 - s / 3)) + np.expm1(2 * (x_2 - s / 3)) + np.expm1(2 * (x_3 - s / 3))
        second = np.expm1(2 * (s / 3 - x_1)) + np.expm1(2 * (s / 3 - x_2)) + np.expm1(2 * (s / 3 - x_3))
        return p[0] * first + p[1] * second + p[2] / 2 * s * s

    @staticmethod
    def stress_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        f_1, f_2, f_3 = _slope(p, x_1 - s / 3), _slope(p, x_2 - s / 3), _slope(p, x_3 - s / 3)
        rest = p[2] * s - (f_1 + f_2 + f_3) / 3
        return f_1 + rest, f_2 + rest, f_3 + rest

    @staticmethod
    def tangent_at(p, x_1, x_2, x_3):
        s = x_1 + x_2 + x_3
        f_1, f_2, f_3 = _curvature(p, x_1 - s / 3), _curvature(p, x_2 - s / 3), _curvature(p, x_3 - s / 3)
        rest = p[2] + (f_1 + f_2 + f_3) / 9
        return (rest + f_1 / 3, rest + f_2 / 3, rest + f_3 / 3, rest - (f_1 + f_2) / 3, rest - (f_1 + f_3) / 3,
                rest - (f_2 + f_3) / 3)

    @staticmethod
    def difference_at(p, mean, half, x_3):
        return _curvature(p, (mean - x_3) / 3) * sinh_ratio(2 * half)


def _slope(p, y):
    return 2 * p[0] * np.exp(2 * y) - 2 * p[1] * np.exp(-2 * y)


def _curvature(p, y):
    return 4 * p[0] * np.exp(2 * y) + 4 * p[1] * np.exp(-2 * y)


@pytest.fixture
def mooney_rivlin(monkeypatch: pytest.MonkeyPatch) -> type[MooneyRivlin]:
    """The law, by its name."""
    monkeypatch.setitem(LAWS, MooneyRivlin.name, f"{__name__}:MooneyRivlin")
    return MooneyRivlin
