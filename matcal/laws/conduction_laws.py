"""Laws of conduction: how a conductivity over that at rest, c/c_0, follows the strain, and what a fit needs of that.

A new law is one object like these and its place in LAWS, or an entry point `touchcal.conduction` of an installed
package.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from touchcal.arrays import Array
from touchcal.entry_points import added


class ConductionLaw(Protocol):
    """c/c_0 = ratio(a, e), 1 at e = 0, of coefficients a (..., m) at strains e that broadcast with (...).

    `basis`(e) (n, 1 + m) is what a fit is linear in: ln c = basis @ (ln c_0, a) of a logarithmic law, which is
    positive everywhere, c = basis @ c_0 (1, a) of another.
    """

    @property
    def name(self) -> str: ...  # in a card
    @property
    def formula(self) -> str: ...  # of c, with places for c_0 and each of a
    @property
    def logarithmic(self) -> bool: ...
    def ratio(self, a: Array, strain: Array) -> Array: ...
    def slope(self, a: Array, strain: Array) -> Array: ...  # derivative of `ratio` with the strain
    def basis(self, strain: Array) -> Array: ...


class Cubic:
    """c = c_0 (1 + a_1 e + a_2 e^2 + a_3 e^3) (paper, figure 6c)."""

    name = "cubic"
    formula = "{} * (1 + ({}) * e + ({}) * e^2 + ({}) * e^3)"
    logarithmic = False

    def ratio(self, a: Array, strain: Array) -> Array:
        return 1 + strain * (a[..., 0] + strain * (a[..., 1] + strain * a[..., 2]))

    def slope(self, a: Array, strain: Array) -> Array:
        return a[..., 0] + strain * (2 * a[..., 1] + strain * 3 * a[..., 2])

    def basis(self, strain: Array) -> Array:
        return np.vander(strain, 4, increasing=True)


@dataclass(frozen=True)
class LogLinear:
    """ln c = ln c_0 + a_1 x(e), x a measure of strain."""

    name: str
    formula: str
    measure: Callable[[Array], Array]  # x(e)
    rate: Callable[[Array], Array]  # dx/de
    logarithmic: bool = True

    def ratio(self, a: Array, strain: Array) -> Array:
        return np.exp(a[..., 0] * self.measure(strain))

    def slope(self, a: Array, strain: Array) -> Array:
        return a[..., 0] * self.rate(strain) * self.ratio(a, strain)

    def basis(self, strain: Array) -> Array:
        return np.column_stack([np.ones_like(strain), self.measure(strain)])


CUBIC = Cubic.name
# the exponential is that of tunnelling between particles
LAWS: dict[str, ConductionLaw] = {law.name: law for law in (
    Cubic(), LogLinear("exponential", "{} * exp(({}) * e)", lambda e: e, np.ones_like),
    LogLinear("power", "{} * (1 + e)^({})", np.log1p, lambda e: 1 / (1 + e)))}


def conduction_laws() -> dict[str, ConductionLaw]:
    """Every law by its name, those of installed packages too."""
    return LAWS | added("conduction")


def conduction_law(name: str) -> ConductionLaw:
    """The law of a name; ValueError lists the known."""
    if (law := LAWS.get(name) or conduction_laws().get(name)) is None:
        raise ValueError(f"law of conduction '{name}' is unknown; known: {', '.join(conduction_laws())}.")
    return law
