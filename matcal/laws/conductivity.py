"""Conductivity of the skin against strain: c(e) = c_0 (1 + a_1 e + a_2 e^2 + a_3 e^3)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchcal.arrays import Array


@dataclass(frozen=True)
class Conductivity:
    """Cubic law (paper, figure 6c) and the strain over which it was fitted."""

    c0_S_per_m: float  # conductivity at no strain, S/m, positive
    a: Array  # (3,) coefficients a_1, a_2, a_3
    strain_range: tuple[float, float] = (0.0, 0.0)  # (lowest, highest) fitted nominal strain

    def __post_init__(self) -> None:
        a = np.array(self.a, dtype=float, ndmin=1)
        a.setflags(write=False)
        object.__setattr__(self, "a", a)
        object.__setattr__(self, "strain_range", (float(self.strain_range[0]), float(self.strain_range[1])))
        if a.shape != (3,) or not np.all(np.isfinite(a)):
            raise ValueError(f"conductivity: a must hold three finite numbers, got {a.tolist()}.")
        if not (np.isfinite(self.c0_S_per_m) and self.c0_S_per_m > 0):
            raise ValueError(f"conductivity: c0_S_per_m must be positive, got {self.c0_S_per_m}.")


class NotPositive(ValueError):
    """A strain at which a conductivity's cubic is not positive."""


def conductivity(law: Conductivity, strain: ArrayLike) -> Array:
    """c(e), S/m, any shape; NotPositive where c <= 0, naming the strain."""
    e = np.asarray(strain, dtype=float)
    c = law.c0_S_per_m * (1 + e * (law.a[0] + e * (law.a[1] + e * law.a[2])))
    if np.any(~(c > 0)):
        worst = float(np.ravel(e)[np.argmin(np.ravel(c))])
        raise NotPositive(f"conductivity: c({worst:g}) = {float(np.min(c)):g} S/m is not positive; the cubic was "
                          f"fitted for strains {law.strain_range[0]:g} to {law.strain_range[1]:g}. Stay within them, "
                          "or measure there.")
    return c


def outside(law: Conductivity, strain: ArrayLike) -> NDArray[np.bool_]:
    """Where a strain lies outside the fitted range; any shape."""
    e = np.asarray(strain, dtype=float)
    return (e < law.strain_range[0]) | (e > law.strain_range[1])


def coating_thickness(thickness_m: ArrayLike, areal_stretch: ArrayLike) -> Array:
    """Current coating thickness, m: the sprayed layer keeps its thickness, t = t_0, whatever the areal stretch. This
    one rule serves both ends: a strip of length L_0(1 + e) and width w has R = L_0(1 + e)/(c(e) w t), and the sheet on
    a deforming body has the conductance tensor c t J_s C_s^-1 on its reference surface."""
    return np.broadcast_to(np.asarray(thickness_m, dtype=float), np.shape(areal_stretch)).copy()


def strip_conductivity(resistance_Ohm: ArrayLike, strain: ArrayLike, length_m: float, ring_area_m2: float) -> Array:
    """c = L/(R A), S/m, of a coated strip: current length L_0(1 + e), coated ring A with `coating_thickness`. Source:
    paper, section 3.2."""
    e = np.asarray(strain, dtype=float)
    ratio = coating_thickness(1.0, 1 + e)
    return length_m * (1 + e) / (np.asarray(resistance_Ohm, dtype=float) * ring_area_m2 * ratio)
