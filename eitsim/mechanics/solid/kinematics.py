"""Strains and stresses of deformation gradients, as tensors."""

import numpy as np

from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.law import Law
from touchcal.arrays import Array


def tensors(law: Law, gradient: Array) -> dict[str, Array]:
    """Tensors (n, 9), row by row, J and ellipticity (n,) of deformation gradients (n, 3, 3) of positive determinant.
    Green-Lagrange strain is (F'F - 1)/2, nominal strain V - 1 with V^2 = FF'; Kirchhoff stress is J times Cauchy's.
    elliptic is 1 where the law is strongly elliptic, else 0."""
    volume = np.linalg.det(gradient)
    square, axes = np.linalg.eigh(gradient @ np.swapaxes(gradient, 1, 2))
    stretch = np.sqrt(square)
    stress = _from_axes(law.kirchhoff(np.log(stretch)), axes)
    found = {"deformation_gradient": gradient,
             "green_lagrange_strain": (np.swapaxes(gradient, 1, 2) @ gradient - np.eye(3)) / 2,
             "nominal_strain": _from_axes(stretch - 1, axes), "kirchhoff_stress_Pa": stress,
             "cauchy_stress_Pa": stress / volume[:, None, None]}
    return {name: tensor.reshape(-1, 9) for name, tensor in found.items()} | {
        "volume_ratio": volume, "elliptic": strongly_elliptic(law, np.log(stretch)).astype(float)}


def _from_axes(value: Array, axes: Array) -> Array:
    """Symmetric tensors (n, 3, 3) of principal values (n, 3) on axes, columns of (n, 3, 3)."""
    return (axes * value[:, None, :]) @ np.swapaxes(axes, 1, 2)
