"""Many laws of one kind evaluated together, for draws of a posterior and the walkers of a sampler."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from matcal.laws.law import Law, Ranges, kirchhoff_of, tangent_of, vector, with_vector
from touchcal.arrays import Array


@dataclass(frozen=True)
class LawStack(Law):
    """D laws, whose functions take and give a leading axis D; parameters without a law give what is not finite."""

    middle: Any  # one of them, or near them: where searches start
    vectors: Array  # (D, K) their parameters, as `matcal.laws.law.vector` orders them
    moduli: str = "longterm"
    strain_range: Ranges = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.vectors.shape[1:] != vector(self.middle).shape:
            raise ValueError(f"{self.middle.name}: parameters (D, {vector(self.middle).size}) are needed, got "
                             f"{self.vectors.shape}.")

    @property
    def name(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Of the laws."""
        return self.middle.name

    @property
    def numbers(self) -> Array:
        """(K, D, 1) what the functions of the kind take as p."""
        if type(self.middle).numbers is Law.numbers:
            return self.vectors.T[..., None]
        return np.stack([_numbers(self.middle, one) for one in self.vectors], axis=-1)[..., None]

    @property
    def hencky_ratio(self) -> tuple[float, bool]:
        """That of the middle law near rest, from which free faces are sought."""
        return self.middle.hencky_ratio[0], self.incompressible

    @property
    def incompressible(self) -> bool:
        """Whether all of them keep their volume."""
        return self.middle.incompressible

    def kirchhoff(self, x: ArrayLike) -> Array:
        """As `Law.kirchhoff`, (D, n, 3) at x (D, n, 3)."""
        with np.errstate(all="ignore"):
            return kirchhoff_of(type(self.middle), self.numbers, x)

    def tangent(self, x: ArrayLike) -> Array:
        """As `Law.tangent`, (D, n, 3, 3) at x (D, n, 3)."""
        with np.errstate(all="ignore"):
            return tangent_of(type(self.middle), self.numbers, x)

    @property
    def moduli_at_rest(self) -> tuple[Array, Array]:
        """(D,) initial shear and bulk moduli, Pa."""
        at_rest = self.tangent(np.zeros((len(self.vectors), 1, 3)))[:, 0]
        if self.incompressible:
            return (at_rest[:, 0, 0] - at_rest[:, 0, 1]) / 2, np.full(len(self.vectors), np.inf)
        return (at_rest[:, 0, 0] - at_rest[:, 0, 1]) / 2, (at_rest[:, 0, 0] + 2 * at_rest[:, 0, 1]) / 3


def _numbers(law: Law, values: Array) -> Array:
    try:
        return with_vector(law, values).numbers
    except ValueError:
        return np.full(law.numbers.shape, np.nan)
