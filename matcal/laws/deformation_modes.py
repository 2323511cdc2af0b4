"""Homogeneous tests of a block of foam: nominal stress in every mode, with and without hereditary relaxation.

Each mode is a path of logarithmic principal stretches x(strain) along which the Kirchhoff stress is evaluated; the
second Piola-Kirchhoff components that the nominal stress needs follow from it and may be convolved with a Prony
series before they are pushed forward: P(t) = sum_c w_c(strain(t)) S_c(t).

- uniaxial, biaxial, planar: S = S_11, w = lambda_1 (free faces carry no stress);
  a law that keeps its volume (nu = 1/2) has the pressure that frees them: S = (tau_1 - tau_free)/lambda_1^2;
- shear: F = I + gamma e1 x e2, (S_12, S_22), w = (1, gamma); regular at gamma = 0, where paper equation 3 is 0/0;
- volumetric: "strain" is J, S of each axis, w = J^(-1/3); the stress is the mean Cauchy stress, minus the pressure.

Source: paper, equations 2-4; Abaqus Theory Guide, "Hyperelastic material behavior".
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from matcal.laws.hyperfoam import kirchhoff_per_modulus
from matcal.laws.law import Law
from matcal.laws.law_stack import LawStack
from matcal.laws.prony import Prony, convolve
from touchcal.arrays import Array
from touchcal.errors import NotConverged

MODES = ("uniaxial", "biaxial", "planar", "shear", "volumetric")
# mode -> logarithmic stretches that follow the driven one freely, as (axes driven, axes free)
_AXES = {"uniaxial": ([0], [1, 2]), "biaxial": ([0, 1], [2]), "planar": ([0], [2])}
# longest step of a logarithmic stretch in the search for free faces, and the largest that it may reach
_LONGEST_STEP, _FARTHEST = 0.3, 6.0


def modes_of(law: Law) -> tuple[str, ...]:
    """The modes in which a law has an answer: volumetric only where its volume changes."""
    return MODES[:-1] if law.incompressible else MODES


def nominal_stress(law: Law, mode: str, strain: ArrayLike) -> Array:
    """Nominal stress of a law as it stands, without relaxation.

    Parameters
    ----------
    law
        Any law.
    mode
        One of `MODES`: uniaxial, biaxial, planar, shear, volumetric.
    strain
        Nominal strains, any shape, compression negative; gamma in shear, J in volumetric.

    Returns
    -------
    array
        Nominal stress of the shape of `strain`, Pa; the mean Cauchy stress in volumetric.

    Raises
    ------
    ValueError
        For an unknown mode or a strain that no body can have.

    Examples
    --------
    >>> import matcal
    >>> matcal.nominal_stress(matcal.Hyperfoam([12e3], [2.0], [0.0]), "uniaxial", [-0.5, 0.0]).round()
    array([-18000.,      0.])
    """
    e = _checked(mode, strain)
    return np.sum(push_forward(mode, e) * second_piola(law, mode, e), axis=-1)


def hereditary_stress(law: Law, prony: Prony, mode: str, time_s: ArrayLike, strain: ArrayLike) -> Array:
    """Nominal stress, Pa, (n,), along a strain history (n,) at times (n,), s, from rest; `law` is instantaneous.
    Quasi-linear viscoelasticity on the second Piola-Kirchhoff stress, see `matcal.laws.prony.convolve`."""
    if law.moduli != "instantaneous":
        raise ValueError(f"hereditary_stress needs instantaneous moduli, got {law.moduli}. "
                         "Use matcal.card.with_moduli(card, 'instantaneous').")
    e = _checked(mode, strain)
    return np.sum(push_forward(mode, e) * convolve(prony, time_s, second_piola(law, mode, e)), axis=-1)


def design(mode: str, strain: ArrayLike, alpha: ArrayLike, nu: float = 0.0, kernel: Array | None = None) -> Array:
    """d stress/d mu_i, (n, N), at strains (n,) for exponents alpha (N,) and one nu; stress = design @ mu. `kernel`
    (n, n) maps an instantaneous history of second Piola-Kirchhoff stress to the relaxed one."""
    e = _checked(mode, strain)
    unit = second_piola_per_modulus(mode, e, alpha, nu)
    if kernel is not None:
        unit = kernel @ unit
    return np.sum(push_forward(mode, e) * unit, axis=-1).T


def second_piola_per_modulus(mode: str, strain: ArrayLike, alpha: ArrayLike, nu: float = 0.0) -> Array:
    """d S_c/d mu_i, (N, n, C), of single terms with exponents alpha (N,) and one nu, at strains (n,)."""
    e = _checked(mode, strain)
    x = _shared_nu_stretches(mode, e, nu)
    return _components(mode, e, x, kirchhoff_per_modulus(alpha, nu / (1 - 2 * nu), x))


def hereditary_kernel(prony: Prony, time_s: ArrayLike) -> Array:
    """(n, n) matrix of `prony.convolve` on histories sampled at times (n,), s, linear between samples."""
    t = np.asarray(time_s, dtype=float)
    return convolve(prony, t, np.eye(t.size))


def second_piola(law: Law, mode: str, strain: ArrayLike) -> Array:
    """Second Piola-Kirchhoff components that the mode needs, Pa, (..., C), C = 2 in shear and 1 elsewhere."""
    e = _checked(mode, strain)
    x = log_stretches(law, mode, e)
    return _components(mode, e, x, law.kirchhoff(x), law.incompressible)


def stacked_second_piola(laws: LawStack, mode: str, strain: ArrayLike, near: Array | None = None) -> Array:
    """`second_piola` of D laws at strains (n,), (D, n, C); NaN where one has no free faces without stress. `near`
    (n, 3): the stretches of a law like them, from which free faces are sought."""
    e = np.broadcast_to(_checked(mode, strain), (len(laws.vectors), np.size(strain)))
    x = _shared_nu_stretches(mode, e, laws.hencky_ratio[0]) if near is None else np.broadcast_to(near, (*e.shape, 3))
    try:
        x = _freed(laws, mode, x) if mode in _AXES and not laws.incompressible else x
    except NotConverged as error:
        x = np.asarray(error.estimate)
    return _components(mode, e, x, laws.kirchhoff(x), laws.incompressible)


def lateral_strain(law: Law, mode: str, strain: ArrayLike) -> Array:
    """Nominal strain of the free faces, of the shape of `strain`, of a uniaxial, biaxial or planar test."""
    if mode not in _AXES:
        raise ValueError(f"mode '{mode}' has no free face; modes that have: {', '.join(_AXES)}.")
    return np.expm1(log_stretches(law, mode, strain)[..., _AXES[mode][1][0]])


def push_forward(mode: str, strain: ArrayLike) -> Array:
    """Weights w_c, (..., C), with which the second Piola-Kirchhoff components make the nominal stress."""
    e = _checked(mode, strain)
    if mode == "shear":
        return np.stack([np.ones_like(e), e], axis=-1)
    return (np.cbrt(1 / e) if mode == "volumetric" else 1 + e)[..., None]


def log_stretches(law: Law, mode: str, strain: ArrayLike) -> Array:
    """Logarithmic principal stretches, (..., 3); free faces are solved for unless the law has x_2 = -nu x_1 at every
    strain. Raises NotConverged where no stress-free lateral stretch is found."""
    e = _checked(mode, strain)
    if law.incompressible and mode == "volumetric" and np.any(e != 1):
        raise ValueError(f"volumetric: {law.name} with nu = 0.5 keeps its volume, so that no J but 1 has an answer. "
                         "Give a nu below 0.5, or fit it with a volumetric test.")
    nu, holds = law.hencky_ratio
    x = _shared_nu_stretches(mode, e, nu)
    if mode in ("shear", "volumetric") or holds:
        return x
    return _freed(law, mode, x)


def existing(law: Law, mode: str, strain: Array) -> NDArray[np.bool_]:
    """Whether free faces find a stretch without stress at increasing strains (n,), and at the neighbours of each."""
    try:
        log_stretches(law, mode, strain)
    except NotConverged as error:
        padded = np.pad(np.all(np.isfinite(error.estimate), axis=-1), 1, mode="edge")
        return padded[:-2] & padded[1:-1] & padded[2:]
    return np.ones(strain.size, dtype=bool)


def _checked(mode: str, strain: ArrayLike) -> Array:
    e = np.asarray(strain, dtype=float)
    if mode not in MODES:
        raise ValueError(f"mode '{mode}' is unknown; known: {', '.join(MODES)}.")
    lowest, name = {"shear": (-np.inf, "gamma"), "volumetric": (0.0, "J")}.get(mode, (-1.0, "nominal strain"))
    if not (np.all(np.isfinite(e)) and np.all(e > lowest)):
        raise ValueError(f"{mode}: {name} must be finite and above {lowest:g}, got {np.min(e):g}.")
    return e


def _shared_nu_stretches(mode: str, e: Array, nu: float) -> Array:
    """Logarithmic stretches when every term has the same nu: x_free = -nu x (uniaxial), J^-beta = lambda_free."""
    x = np.zeros((*e.shape, 3))
    if mode == "shear":
        x[..., 0] = np.arcsinh(e / 2)
        x[..., 1] = -x[..., 0]
        return x
    if mode == "volumetric":
        x[...] = np.log(e)[..., None] / 3
        return x
    driven, free = _AXES[mode]
    if nu == 0.5:
        follow = -len(driven) / len(free)
    else:
        beta = nu / (1 - 2 * nu)
        follow = -beta * len(driven) / (1 + beta * len(free))
    x[..., driven] = np.log1p(e)[..., None]
    x[..., free] = follow * np.log1p(e)[..., None]
    return x


def _freed(law: Law, mode: str, x: Array) -> Array:
    """x with the free faces where they carry no stress; NotConverged carries x with NaN where no such place is found.
    """
    free, x = _AXES[mode][1], x.copy()
    for _ in range(60):
        with np.errstate(over="ignore", invalid="ignore"):  # a stray step is caught below
            slope = law.tangent(x)[..., free[0], :][..., free].sum(axis=-1)
            step = law.kirchhoff(x)[..., free[0]] / np.where(slope == 0, np.finfo(float).tiny, slope)
        step = np.clip(np.where(np.isfinite(step), step, _LONGEST_STEP), -_LONGEST_STEP, _LONGEST_STEP)
        x[..., free] = np.clip(x[..., free] - step[..., None], -_FARTHEST, _FARTHEST)
        if np.all(np.abs(step) <= 1e-12):
            return x
    found = np.where((np.abs(step) <= 1e-12)[..., None], x, np.nan)
    raise NotConverged(f"{mode}: no lateral stretch without stress was found; the law, {law.name}, may have lost "
                       "stability at this strain. Stay at smaller strains.", estimate=found)


def _components(mode: str, e: Array, x: Array, tau: Array, incompressible: bool = False) -> Array:
    """S components (..., C) from principal Kirchhoff stresses tau (..., 3), known but for a pressure where the law is
    incompressible, at stretches x."""
    if incompressible and mode in _AXES:
        tau = tau - tau[..., _AXES[mode][1][0], None]
    s = tau * np.exp(-2 * x)
    if mode != "shear":
        return s[..., :1]
    half_sum, twist = (s[..., 0] + s[..., 1]) / 2, (s[..., 0] - s[..., 1]) / (2 * np.hypot(1, e / 2))
    return np.stack([twist, half_sum + e / 2 * twist], axis=-1)
