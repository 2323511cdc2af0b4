"""Reference elements of a volume and of its faces: tetrahedra, and prisms that are a flat element times a line."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from skfem import ElementLineP1, ElementLineP2, ElementQuad2, ElementTetP1, ElementTetP2, ElementTriP1, ElementTriP2
from skfem.quadrature import get_quadrature

from touchcal.arrays import Array

# scikit-fem's element and the degree of exactness of its quadrature
_SIMPLE: dict[str, tuple[Any, int]] = {
    "T1": (ElementTetP1, 1), "T2": (ElementTetP2, 4), "P1": (ElementTriP1, 2), "P2": (ElementTriP2, 4),
    "Q2": (ElementQuad2, 5), "L1": (ElementLineP1, 3), "L2": (ElementLineP2, 5)}


@dataclass(frozen=True, eq=False)
class Reference:
    """Nodal functions of a reference element at the points of its quadrature."""

    value: Array  # (q, k)
    gradient: Array  # (q, k, d)
    weights: Array  # (q,)


@lru_cache(maxsize=16)
def reference(name: str) -> Reference:
    """Of a tetrahedron or a flat element by its name; of a prism, "Q2xL2", the products, nodes of the flat element
    first."""
    if "x" in name:
        return _product(*(reference(part) for part in name.split("x")))
    kind, degree = _SIMPLE[name]
    points, weights = get_quadrature(kind(), degree)
    basis = [kind().lbasis(points, i) for i in range(len(kind().doflocs))]
    value = np.stack([np.broadcast_to(b[0], weights.shape) for b in basis], axis=1)
    gradient = np.stack([np.broadcast_to(b[1], points.shape).T for b in basis], axis=1)
    return Reference(value, gradient, weights)


def _product(flat: Reference, line: Reference) -> Reference:
    """Every point and node of one with every one of the other."""
    def outer(one: Array, other: Array) -> Array:
        made = one[:, None, :, None] * other[None, :, None, :]
        return made.reshape(len(one) * len(other), -1)

    along = [outer(flat.gradient[..., i], line.value) for i in range(flat.gradient.shape[2])]
    return Reference(outer(flat.value, line.value),
                     np.stack([*along, outer(flat.value, line.gradient[..., 0])], axis=-1),
                     np.outer(flat.weights, line.weights).ravel())
