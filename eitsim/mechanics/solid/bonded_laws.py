"""Two laws by element: those of a layer and of the soft base that it is bonded to."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.solid.grid import Grid
from matcal.laws.law import Law, Parameter, over
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class Bonded(Law):
    """The laws of a layer and of its base; moduli are the layer's. It has no energy of its own: `by_part` asks the
    law of each element, what does not ask so raises NotImplementedError."""

    name: ClassVar[str] = "bonded"
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    layer: Law
    base: Law
    # (elements,) of a grid, which lie in the base; None before it is laid on one
    below: NDArray[np.bool_] | None = None

    @property
    def moduli(self) -> str:  # type: ignore[override]
        return self.layer.moduli

    @property
    def mu_0_Pa(self) -> float:
        return self.layer.mu_0_Pa

    @property
    def kappa_0_Pa(self) -> float:
        """As many times mu_0 as the larger of both is of the smaller mu_0: what rounding and locking go by."""
        return self.mu_0_Pa * max(law.kappa_0_Pa for law in (self.layer, self.base)) / min(
            law.mu_0_Pa for law in (self.layer, self.base))


def laid_on(law: Law, grid: Grid, interface: float) -> Law:
    """A law in units of its mu_0 and, of two, with the elements of a grid that lie below the interface."""
    if not isinstance(law, Bonded):
        return over(law, law.mu_0_Pa)
    below = grid.flat_nodes[grid.elements, 1].mean(axis=1) < interface
    return replace(law, layer=over(law.layer, law.mu_0_Pa), base=over(law.base, law.mu_0_Pa), below=below)


def by_part(law: Law, asked: Callable[..., Any], *points: Array) -> Any:
    """asked(law, *points), an array or several, of arrays (n, ...), each point by the law of its element; points of an
    element lie one after another."""
    if not isinstance(law, Bonded) or law.below is None:
        return asked(law, *points)
    below = np.repeat(law.below, len(points[0]) // len(law.below))
    parts = [asked(one, *(values[where] for values in points)) for one, where in (
        (law.layer, ~below), (law.base, below))]
    if isinstance(parts[0], tuple):
        return tuple(_joined(below, *each) for each in zip(*parts, strict=True))
    return _joined(below, *parts)


def _joined(below: NDArray[np.bool_], layer: Array, base: Array) -> Array:
    out = np.empty((len(below), *layer.shape[1:]), dtype=layer.dtype)
    out[~below], out[below] = layer, base
    return out
