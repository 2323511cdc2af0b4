"""The volume's part of laws that split it off: U = kappa/2 (J - 1)^2, kappa = 2 mu_0 (1 + nu)/(3 (1 - 2 nu)).

At nu = 1/2 the law keeps its volume: this part is then absent, and the pressure follows from the free faces
(`matcal.laws.deformation_modes`). Finite elements take the law nearly incompressible, with a kappa that they state.
Source: Abaqus Theory Guide, "Hyperelastic material behavior" (D_1 = 2/kappa).
"""

from dataclasses import replace

import numpy as np

from matcal.laws.law import L, Real
from touchcal.jit import where

NEARLY = 0.4995  # Poisson's ratio that finite elements take for 1/2: kappa = 1000 mu_0


def nearly_incompressible(law: L, nu: float = NEARLY) -> L:
    """The law with a finite bulk modulus: as it is where it has one, else of this initial Poisson's ratio."""
    return replace(law, nu=nu) if law.incompressible else law


def with_bulk(law: L, over_mu_0: float) -> L:
    """The law with a bulk modulus so many times its mu_0; as it is where it has no single Poisson's ratio."""
    nu = (3 * over_mu_0 - 2) / (6 * over_mu_0 + 2)
    return replace(law, nu=nu) if isinstance(getattr(law, "nu", None), float) else law


def bulk_modulus(mu_0: Real, nu: Real) -> Real:
    """kappa, Pa; 0 at nu = 1/2, where the law has no volumetric part."""
    free = 1 - 2 * nu
    return where(free > 0, 2 * mu_0 * (1 + nu) / 3 / where(free > 0, free, 1.0), 0.0)


def volume_energy(kappa: Real, s: Real) -> Real:
    """U, Pa, at s = ln J."""
    return kappa / 2 * np.expm1(s) ** 2


def volume_stress(kappa: Real, s: Real) -> Real:
    """dU/ds, Pa: the mean Kirchhoff stress."""
    return kappa * np.exp(s) * np.expm1(s)


def volume_tangent(kappa: Real, s: Real) -> Real:
    """d2U/ds2, Pa."""
    return kappa * np.exp(s) * (2 * np.exp(s) - 1)
