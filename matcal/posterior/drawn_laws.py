"""Laws and stresses of many draws at once: hyperfoams through their designs, any other law as a stack."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BarycentricInterpolator

from matcal.laws import known_laws
from matcal.laws.deformation_modes import design, nominal_stress, push_forward, stacked_second_piola
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.law_stack import LawStack
from matcal.posterior.draws import Draws, parameters, quantiles
from touchcal.arrays import Array

_NU_NODES = 9  # values of nu between which stresses are interpolated


def law_of(draws: Draws, k: int) -> Law:
    """The long-term law of draw k."""
    return known_laws.law_of(draws.kind.name, parameters(draws, k))


def moduli_of(draws: Draws) -> tuple[Array, Array]:
    """(D,) initial shear moduli and Young's moduli, Pa."""
    if draws.kind is Hyperfoam:
        mu_Pa, beta = draws.law["mu_Pa"], draws.law["nu"] / (1 - 2 * draws.law["nu"])
        mu, bulk = mu_Pa.sum(axis=1), np.sum(2 * mu_Pa * (1 / 3 + beta), axis=1)
    else:
        mu, bulk = _stack(draws).moduli_at_rest
    return mu, 9 * mu / (3 + mu / bulk)


def stress_of(draws: Draws, mode: str, strain: ArrayLike) -> Array:
    """Nominal stress of every draw at strains (n,), Pa, (D, n); where nu of hyperfoams differs from draw to draw but
    not from term to term, interpolated between a few values of it."""
    e = np.asarray(strain, dtype=float)
    if draws.kind is not Hyperfoam:
        return stress_of_stack(_stack(draws), mode, e)
    each = draws.law["nu"]
    if each.shape[1] > 1 and np.any(np.ptp(each, axis=1) > 0):
        return np.stack([nominal_stress(law_of(draws, k), mode, e) for k in range(len(draws))])
    nu = each[:, 0]
    if np.ptp(nu) == 0:
        return _of_foams(draws, mode, e, float(nu[0]))
    middle, half = (nu.max() + nu.min()) / 2, np.ptp(nu) / 2
    nodes = middle + half * np.cos(np.pi * np.arange(_NU_NODES) / (_NU_NODES - 1))
    weight = BarycentricInterpolator(nodes, np.eye(_NU_NODES))(nu)
    tabulated = np.stack([_of_foams(draws, mode, e, float(v)) for v in nodes])
    return np.einsum("dk,kdn->dn", weight, tabulated)


def stress_of_stack(laws: LawStack, mode: str, strain: Array) -> Array:
    """Nominal stress of each law at strains (n,), Pa, (D, n); not finite where parameters have none."""
    return np.sum(push_forward(mode, strain) * stacked_second_piola(laws, mode, strain), axis=-1)


def stress_band(draws: Draws, mode: str, strain: ArrayLike, level: float = 0.95) -> tuple[Array, Array]:
    """Pointwise quantiles of nominal stress at strains (n,), Pa: ((n,), (n,))."""
    if draws.kind is Hyperfoam:
        return quantiles(lambda k: nominal_stress(law_of(draws, k), mode, strain), len(draws), level)
    stress = stress_of(draws, mode, strain)
    return quantiles(lambda k: stress[k], len(draws), level)


def _of_foams(draws: Draws, mode: str, e: Array, nu: float) -> Array:
    alpha = draws.law["alpha"]
    columns = design(mode, e, alpha.ravel(), nu).reshape(e.size, *alpha.shape)
    return np.einsum("ndk,dk->dn", columns, draws.law["mu_Pa"])


def _stack(draws: Draws) -> LawStack:
    return LawStack(law_of(draws, len(draws) // 2), np.hstack([*draws.law.values()]))
