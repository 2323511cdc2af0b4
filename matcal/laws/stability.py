"""Where along each test mode a law loses Drucker stability or strong ellipticity.

- drucker: the Kirchhoff stress works positively on every increment of logarithmic strain, d tau : d ln V > 0. For
  principal stretches that is positive definiteness of its tangent; of a hyperfoam with beta = 0 it is
  sum mu_i lambda^alpha_i > 0 at each stretch. (The twist of the axes adds (tau_i - tau_j)/(x_i - x_j) > 0, which
  follows from it along these paths.)
- elliptic: the acoustic tensor Q(n) is positive definite for every direction n, so that waves of every polarisation
  travel and no band of localised strain can form: `matcal.laws.ellipticity` in closed form. The worst direction is
  found numerically: in principal axes Q depends on n_i^2 only, so n_i^2 runs over a triangular grid which is then
  refined about its worst point.

Source: Abaqus Analysis User's Guide, "Hyperelastic behavior in elastomeric foams" (Drucker); Ogden, Non-linear
Elastic Deformations (1984), 6.2.7 (acoustic tensor in principal axes).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from matcal.laws.deformation_modes import log_stretches, modes_of
from matcal.laws.ellipticity import strongly_elliptic
from matcal.laws.law import Law, moduli_of
from matcal.laws.volumetric import nearly_incompressible
from touchcal.errors import NotConverged

Array = NDArray[np.float64]

CRITERIA = ("drucker", "elliptic")
# mode -> (lowest, highest) strain scanned; gamma in shear, J in volumetric
SCANNED = {"uniaxial": (-0.95, 1.0), "biaxial": (-0.95, 1.0), "planar": (-0.95, 1.0), "shear": (0.0, 3.0),
           "volumetric": (0.05, 2.0)}
# points of a scan; an unstable range narrower than the spacing can be missed
_POINTS = 391
# moduli over mu_0 up to which states are judged: those of laws nearly without change of volume overflow near J = 0.05
_STIFFEST = 1e10
_STIFF_NU = 0.4999999  # Poisson's ratio for which laws that keep their volume are judged
# strain to which the ends of an unstable range are found
_END = 1e-7


def stability(law: Law) -> dict[str, dict[str, dict[str, object]]]:
    """Where along each mode a law is not Drucker stable or loses ellipticity, over the strains SCANNED, as far as its
    moduli are finite there.

    Parameters
    ----------
    law
        Any law; `matcal.check` takes a card.

    Returns
    -------
    dict
        Criterion -> mode -> {stable, unstable_strain [[lo, hi], ...], scanned [lo, hi]}.

    Examples
    --------
    >>> import matcal
    >>> matcal.stability(matcal.Hyperfoam([12e3], [2.0], [0.0]))["elliptic"]["shear"]["stable"]
    True
    """
    return {criterion: {mode: _scan(law, criterion, mode) for mode in modes_of(law)} for criterion in CRITERIA}


def is_stable(law: Law, criterion: str, mode: str, strain: ArrayLike) -> NDArray[np.bool_]:
    """Whether the law keeps a criterion, (n,), at strains (n,) of a mode.

    It does not where the free faces find no stress-free stretch (unequal nu): such a state does not exist.
    """
    x, exists = _states(law, mode, np.atleast_1d(strain))
    law = nearly_incompressible(law, _STIFF_NU)  # neither criterion depends on the pressure where kappa is large
    if criterion == "drucker":
        return exists & (np.linalg.eigvalsh(law.tangent(x))[..., 0] > 0)
    if criterion == "elliptic":
        return exists & strongly_elliptic(law, x)
    raise ValueError(f"criterion '{criterion}' is unknown; known: {', '.join(CRITERIA)}.")


def _states(law: Law, mode: str, strain: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Logarithmic stretches (n, 3), 0 where there are none, and whether there are."""
    try:
        return log_stretches(law, mode, strain), np.ones(strain.size, dtype=bool)
    except NotConverged as error:
        exists = np.all(np.isfinite(error.estimate), axis=-1)
        return np.where(exists[:, None], error.estimate, 0.0), exists


def unstable_ranges(law: Law, criterion: str, mode: str, strain: Array) -> list[list[float]]:
    """[[lo, hi], ...] where the law loses a criterion, scanned at increasing strains (n,); ends found by bisection."""
    stable = is_stable(law, criterion, mode, strain)
    edges = np.flatnonzero(stable[1:] != stable[:-1])
    low, high = strain[edges], strain[edges + 1]
    while edges.size and np.ptp([low, high], axis=0).max() > _END:
        middle = (low + high) / 2
        before = is_stable(law, criterion, mode, middle) == stable[edges]
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    ends = [*strain[:1][~stable[:1]], *(low + high) / 2, *strain[-1:][~stable[-1:]]]
    return [[float(lo), float(hi)] for lo, hi in zip(ends[::2], ends[1::2], strict=True)]


def _scan(law: Law, criterion: str, mode: str) -> dict[str, object]:
    strain = np.linspace(*SCANNED[mode], _POINTS)
    with np.errstate(over="ignore", invalid="ignore"):
        stiffness = np.abs(law.tangent(_states(law, mode, strain)[0])).max(axis=(1, 2))
    strain = strain[stiffness < _STIFFEST * sum(np.abs(getattr(law, name)).sum() for name in moduli_of(law))]
    ranges = unstable_ranges(law, criterion, mode, strain)
    return {"stable": not ranges, "unstable_strain": ranges, "scanned": [float(strain[0]), float(strain[-1])]}


def acoustic_form(law: Law, x: Array, n: Array, m: Array) -> Array:
    """m . J Q(n) m, Pa, (k,), of unit directions n, m (k, 3) in principal axes at logarithmic stretches x (k, 3)."""
    normal, shear, cross = _instantaneous_moduli(law, x)
    on_axis = normal * n**2 + np.einsum("kpi,kp->ki", shear, n**2)
    return np.sum(on_axis * m**2, axis=1) + np.einsum("kij,ki,kj->k", cross, n * m, n * m)


def worst_acoustic_directions(law: Law, x: Array) -> tuple[Array, Array, Array]:
    """(least eigenvalue of J Q(n) over n, (k,), Pa; that n (k, 3); its polarisation m (k, 3)) at x (k, 3)."""
    squares = _worst_squares(law, x)
    n = np.sqrt(squares)
    value, vectors = np.linalg.eigh(_acoustic(*_instantaneous_moduli(law, x), squares[:, None]))
    return value[:, 0, 0], n, vectors[:, 0, :, 0]


def _worst_squares(law: Law, x: Array) -> Array:
    """Squared direction cosines (n, 3) of the worst direction, from a grid refined twice about its worst point."""
    moduli = _instantaneous_moduli(law, x)
    each = np.arange(x.shape[0])
    squares = np.broadcast_to(_triangle(12), (x.shape[0], 91, 3))
    for step in (1 / 12, 1 / 60, None):
        worst = squares[each, np.argmin(_least(*moduli, squares), axis=1)]
        squares = _around(worst, step) if step else worst
    return squares


def _instantaneous_moduli(law: Law, x: Array) -> tuple[Array, Array, Array]:
    """J A_iiii (n, 3); J A_pipi (n, 3, 3) indexed [p, i]; J (A_iijj + A_jiij) (n, 3, 3), zero where i = j."""
    tau, tangent = law.kirchhoff(x), law.tangent(x)
    diagonal = np.einsum("nii->ni", tangent)
    gap = x[:, :, None] - x[:, None, :]
    separation = np.abs(gap) > 1e-6
    safe = np.where(separation, gap, 1.0)
    slope = np.where(separation, (tau[:, :, None] - tau[:, None, :]) / safe, (diagonal[:, :, None] - tangent))
    shear = slope * np.where(separation, safe / -np.expm1(-2 * safe), 0.5)
    off = 1 - np.eye(3)
    return diagonal - tau, shear * off, (tangent + shear.transpose(0, 2, 1) - tau[:, None, :]) * off


def _least(normal: Array, shear: Array, cross: Array, squares: Array) -> Array:
    """Least eigenvalue of J Q, (n, m), at squared direction cosines (n, m, 3)."""
    return np.asarray(np.linalg.eigvalsh(_acoustic(normal, shear, cross, squares))[..., 0], dtype=float)


def _acoustic(normal: Array, shear: Array, cross: Array, squares: Array) -> Array:
    """J Q, (n, m, 3, 3), at squared direction cosines (n, m, 3)."""
    cosines = np.sqrt(squares)
    q = cross[:, None] * (cosines[..., :, None] * cosines[..., None, :])
    on_axis = normal[:, None] * squares + np.einsum("npi,nmp->nmi", shear, squares)
    return q + on_axis[..., None] * np.eye(3)


def _triangle(parts: int) -> Array:
    """Barycentric grid (m, 3) with `parts` intervals a side."""
    i, j = np.meshgrid(np.arange(parts + 1), np.arange(parts + 1), indexing="ij")
    keep = i + j <= parts
    return np.stack([i[keep], j[keep], parts - i[keep] - j[keep]], axis=-1) / parts


def _around(worst: Array, step: float) -> Array:
    """Barycentric points (n, m, 3) within `step` of `worst` (n, 3), kept inside the triangle."""
    a = np.linspace(-step, step, 11)
    first, second = (v.ravel() for v in np.meshgrid(a, a, indexing="ij"))
    moved = np.clip(worst[:, None] + np.stack([first, second, -first - second], axis=-1), 0, None)
    return moved / moved.sum(axis=-1, keepdims=True)
