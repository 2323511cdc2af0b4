"""The weighted design of all curves as a spline in the exponent, on the few directions that its columns span.

Columns d stress/d mu(alpha) are smooth in alpha and nearly dependent: some thirty directions hold them all to 1e-10,
and a cubic spline between nodes 0.04 apart reproduces them to 2e-7. A search or a sampler then costs microseconds a
point whatever the number of measurements; what it finds is evaluated again with the exact design.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from matcal.fitting.hyperfoam.curves import Curve, projected_operator, weighted_design, weighted_stress
from matcal.laws.deformation_modes import second_piola_per_modulus
from touchcal.arrays import Array

_STEP, _COARSE, _KEPT = 0.04, 80, 1e-11
# numbers that are held at once
_AT_ONCE = 2_000_000


@dataclass(frozen=True)
class Table:
    """Design and target of a fit on a short basis; inner products are those of the full problem."""

    # (n, r) orthonormal directions
    basis: Array
    # alpha -> (r,) column, for alpha within the bounds that it was made for
    column: CubicSpline
    # (r,) weighted stress
    target: Array

    def design(self, alpha: ArrayLike) -> Array:
        """(r, N) design at exponents (N,)."""
        return self.column(np.asarray(alpha)).T

    def slope(self, alpha: ArrayLike) -> Array:
        """(r, N) derivative of each column of the design with its exponent."""
        return self.column(np.asarray(alpha), 1).T


def tabulate(curves: Sequence[Curve], nu: float, bounds: tuple[float, float], more: Array | None = None) -> Table:
    """Table for exponents within `bounds`; `more` (n, J) are further vectors that the basis must hold."""
    target = weighted_stress(curves)
    coarse = weighted_design(curves, np.linspace(*bounds, _COARSE) + 1e-7, nu)
    vectors = np.column_stack([coarse, target] + ([more] if more is not None and more.size else []))
    q, r = np.linalg.qr(vectors / np.linalg.norm(vectors, axis=0))
    left, size, _ = np.linalg.svd(r)
    basis = q @ left[:, size > _KEPT * size[0]]
    nodes = np.linspace(bounds[0] - _STEP, bounds[1] + _STEP, int((bounds[1] - bounds[0]) / _STEP) + 4)
    nodes = np.where(np.abs(nodes) < 1e-9, 1e-9, nodes)
    columns, first = np.zeros((nodes.size, basis.shape[1])), 0
    for curve in curves:
        n = curve.experiment.value.size
        operator = projected_operator(curve, basis[first:first + n]).T
        for rows in np.array_split(np.arange(nodes.size), 1 + nodes.size * n // _AT_ONCE):
            unit = second_piola_per_modulus(curve.experiment.kind, curve.experiment.strain, nodes[rows], nu)
            columns[rows] += unit.reshape(rows.size, -1) @ operator
        first += n
    return Table(basis, CubicSpline(nodes, columns), basis.T @ target)
