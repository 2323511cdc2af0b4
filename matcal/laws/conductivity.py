"""Conductivity of the skin against strain, c(e), by a law of conduction, and of a strip by its resistance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from matcal.laws.conduction_laws import CUBIC, conduction_law
from touchcal.arrays import Array
from touchcal.number_words import counted


@dataclass(frozen=True)
class Conductivity:
    """A law of conduction with its numbers, and the strain over which it was fitted."""

    c0_S_per_m: float  # conductivity at no strain, S/m, positive
    a: Array  # (m,) coefficients a_1, ..., of the cubic three
    strain_range: tuple[float, float] = (0.0, 0.0)  # (lowest, highest) fitted nominal strain
    kind: str = CUBIC  # name of the law, as `matcal.laws.conduction_laws` knows it
    # strains outside which c is what it is at the nearer one of `held`
    limits: tuple[float, float] = (-np.inf, np.inf)
    held: tuple[float, float] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        a = np.array(self.a, dtype=float, ndmin=1)
        a.setflags(write=False)
        object.__setattr__(self, "a", a)
        object.__setattr__(self, "strain_range", (float(self.strain_range[0]), float(self.strain_range[1])))
        count = conduction_law(self.kind).basis(np.zeros(1)).shape[1] - 1
        if a.shape != (count,) or not np.all(np.isfinite(a)):
            raise ValueError(f"conductivity: a of the {self.kind} law must hold {counted(count, 'finite number')}, got "
                             f"{a.tolist()}.")
        if not (np.isfinite(self.c0_S_per_m) and self.c0_S_per_m > 0):
            raise ValueError(f"conductivity: c0_S_per_m must be positive, got {self.c0_S_per_m}.")


class NotPositive(ValueError):
    """A strain at which a law of conduction is not positive, or not finite."""


def conductivity(law: Conductivity, strain: ArrayLike) -> Array:
    """c(e), S/m, any shape; NotPositive where c <= 0, naming the strain."""
    e = np.asarray(strain, dtype=float)
    e = np.where(e < law.limits[0], law.held[0], np.where(e > law.limits[1], law.held[1], e))
    with np.errstate(over="ignore", divide="ignore"):
        c = law.c0_S_per_m * conduction_law(law.kind).ratio(law.a, e)
    if np.any(~((c > 0) & (c < np.inf))):
        worst = np.argmin(np.where(np.isinf(c), -np.inf, c))
        raise NotPositive(f"conductivity: c({float(np.ravel(e)[worst]):g}) = {float(np.ravel(c)[worst]):g} S/m is not "
                          f"positive and finite; the {law.kind} law was fitted for strains {law.strain_range[0]:g} to "
                          f"{law.strain_range[1]:g}. Stay within them, or measure there.")
    return c


def drawn_conductivity(kind: str, numbers: Array, strain: ArrayLike) -> Array:
    """c(e), S/m, (..., n), at strains (n,) of numbers c_0 (1, a), S/m, (..., 1 + m) of a law, whatever its sign."""
    ratio = conduction_law(kind).ratio(numbers[..., None, 1:] / numbers[..., None, :1], np.asarray(strain, dtype=float))
    return numbers[..., :1] * ratio


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
