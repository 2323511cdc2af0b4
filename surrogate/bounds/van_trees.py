"""The least mean squared error over a uniform prior of (d, F), whatever the estimator, where the information varies.

Van Trees' inequality holds for every vector field q on the prior that does not cross its border:
E (t_hat - t)^2 >= (E q.grad t)^2 / E[q' I q + (div q)^2]. The best q solves I q - grad div q = grad t, and the bound is
E q.grad t: the average Cramer-Rao variance where it is small against the prior, and the prior's own variance where the
readings tell nothing. Of one parameter with constant information I on a range 2a it is (1 - tanh(u)/u) / I, u = a
sqrt(I); a Gaussian prior of the same variance would give 1 / (I + 3/a^2), which is more than a uniform prior's best
estimator needs to miss. Source: Gill, Levit, Bernoulli 1 (1995) 59, DOI 10.2307/3318681, whose inequality is optimised
here over the field.
"""

from dataclasses import dataclass

import numpy as np
from skfem import Basis, BilinearForm, ElementLineP2, ElementTriRT2, LinearForm, MeshLine, MeshTri, condense, solve
from skfem.element import DiscreteField
from skfem.helpers import dot

from touchcal.arrays import Array

# Squares of two triangles along each parameter. On synthetic touches the bound is within 1 % of the best estimator's
# error where noise is loud, and 7 to 9 % below it where it is so quiet that the posterior is a thin curve.
ELEMENTS = 16
_NONE = 1e-6  # information over 1 / range^2 that stands for none at all


@dataclass(frozen=True, eq=False)
class Domain:
    """The rectangle of a uniform prior, or the line where one of its parameters is known."""

    basis: Basis  # on the unit square or line
    varies: tuple[int, ...]  # parameters that vary, some of (0, 1) for (d, F)
    lowest: Array  # (2,) lowest values of both
    size: Array  # (2,) ranges of both

    @property
    def points(self) -> Array:
        """(elements, q, 2) d and F at the quadrature points."""
        found = np.moveaxis(np.asarray(self.basis.global_coordinates()), 0, -1)
        share = np.zeros((*found.shape[:-1], 2))
        share[..., list(self.varies)] = found
        return self.lowest + share * self.size

    def mean(self, values: Array) -> float:
        """Average of values (elements, q) over the prior."""
        return float(np.sum(values * self.basis.dx))


def domain(d_mm: tuple[float, float], force_N: tuple[float, float], elements: int = ELEMENTS) -> Domain:
    """The prior's rectangle of diameters and forces, each scaled to 0 to 1 inside; ValueError where neither varies."""
    ends = np.array([d_mm, force_N])
    varies = tuple(np.flatnonzero(np.ptp(ends, axis=1) > 0).tolist())
    if not varies:
        raise ValueError("neither the diameter nor the force varies, so that there is no prior of the punch to average "
                         "over. Give a design or a data set with a range of forces.")
    line = np.linspace(0, 1, elements + 1)
    basis = (Basis(MeshTri.init_tensor(line, line), ElementTriRT2(), intorder=4) if len(varies) == 2
             else Basis(MeshLine(line), ElementLineP2(), intorder=4))
    return Domain(basis, varies, ends[:, 0], np.ptp(ends, axis=1))


def least_error(where: Domain, information: Array, slope: Array) -> Array:
    """(elements, q) values at the quadrature points whose average is the bound of a target's squared error.

    information: (elements, q, 2, 2) of (d, F); slope: (elements, q, 2) derivative of the target by them. Single values
    bound nothing: an estimator may do better in one place of the prior for doing worse in another. Coarse elements make
    a lower bound, never a wrong one.
    """
    kept, size = list(where.varies), where.size[list(where.varies)]
    known = information[..., kept, :][..., kept] * np.outer(size, size) + _NONE * np.eye(len(kept))
    known, own = np.moveaxis(known, (-2, -1), (0, 1)), np.moveaxis(slope[..., kept] * size, -1, 0)
    flow = BilinearForm(lambda q, r, w: dot(np.einsum("ij...,j...->i...", known, _vector(q)), _vector(r))
                        + _div(q) * _div(r))
    load = LinearForm(lambda r, w: dot(own, _vector(r)))
    system = condense(flow.assemble(where.basis), load.assemble(where.basis), D=where.basis.get_dofs())
    best = where.basis.interpolate(np.asarray(solve(*system)))
    return dot(own, _vector(best))  # pyright: ignore[reportArgumentType]


def _vector(field: DiscreteField) -> Array:
    """(1 or 2, elements, q) the field itself, which is one number on a line."""
    values = np.asarray(field)
    return values[None] if values.ndim == 2 else values


def _div(field: DiscreteField) -> Array:
    return np.asarray(field.grad)[0] if field.div is None else np.asarray(field.div)
