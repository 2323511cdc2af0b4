"""Poisson-like ratios of the terms: given, one fitted to all, or fitted term by term, and what data allow which.

With one nu for all terms the lateral stretch is lambda_2 = lambda_1^-nu whatever the moduli, so a lateral record is
fitted in closed form. Source: Storakers, J. Mech. Phys. Solids 34 (1986) 125, DOI 10.1016/0022-5096(86)90033-5.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from matcal.fitting.hyperfoam.curves import Curve
from matcal.laws.deformation_modes import lateral_strain
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law

Array = NDArray[np.float64]
# one value, one a term in the order of increasing alpha, "fit" (one for all) or "fit-each"
Poisson = float | str | Sequence[float]

FITTED = ("fit", "fit-each")
# a foam's, which is taken where nothing is said
FOAM = 0.0
# values that a fit may take
NU_BOUNDS = (-0.4, 0.4999)
# standard deviation of a nu that is uniform between them
PRIOR_NU = (NU_BOUNDS[1] - NU_BOUNDS[0]) / 12**0.5
# values between which a material counts as one that nearly keeps its volume
KEPT_VOLUME = (0.45, 0.4999)
# share of the range of NU_BOUNDS within which a value counts as at the bound; coarse values tried first
AT_BOUND, _COARSE = 2e-3, 9


def checked_poisson(poisson: Poisson | None, curves: Sequence[Curve]) -> float | str | tuple[float, ...]:
    """The choice, a list of equal values as one, FOAM where there is none; ValueError for a value outside (-1, 0.5), or
    where the data cannot tell what is to be fitted."""
    if poisson is None:
        return FOAM
    if isinstance(poisson, str) and poisson in FITTED:
        _require_data(poisson, curves)
        return poisson
    try:
        values = tuple(np.atleast_1d(np.asarray(poisson, dtype=float)).tolist())
    except ValueError:
        raise ValueError(f"poisson '{poisson}' is unknown; known: a value, one a term, {', '.join(FITTED)}.") from None
    if bad := [v for v in values if not -1 < v < 0.5]:
        raise ValueError(f"poisson {bad[0]:g} must lie between -1 and 0.5, or be one of {', '.join(FITTED)}.")
    return values[0] if len(set(values)) == 1 else values


def lateral_nu(curves: Sequence[Curve]) -> float:
    """The one nu of least `lateral_cost`, first on a coarse grid, then by bounded search about its best."""
    def total(nu: float) -> float:
        return lateral_cost(curves, Hyperfoam(np.ones(1), np.ones(1), np.array([nu])))

    grid = np.linspace(*NU_BOUNDS, _COARSE)
    best = int(np.argmin([total(float(nu)) for nu in grid]))
    ends = (float(grid[max(best - 1, 0)]), float(grid[min(best + 1, _COARSE - 1)]))
    found = minimize_scalar(total, bounds=ends, method="bounded", options={"xatol": 1e-5})
    return float(found.x)  # pyright: ignore[reportAttributeAccessIssue]


def lateral_cost(curves: Sequence[Curve], law: Hyperfoam) -> float:
    """Sum of squares of `lateral_residual`."""
    return float(np.sum(lateral_residual(curves, law) ** 2))


def lateral_residual(curves: Sequence[Curve], law: Law) -> Array:
    """Lateral strain of the law minus the record over the rms axial strain, each curve with the weight of its stress,
    (n,); empty without a lateral record."""
    parts = [np.zeros(0)]
    for curve in curves:
        e = curve.experiment
        if e.lateral is not None:
            unit = np.sqrt(np.mean(e.strain**2) * e.strain.size / curve.weight)
            parts.append((lateral_strain(law, e.kind, e.strain) - e.lateral) / unit)
    return np.concatenate(parts)


def nu_sentences(nu: Sequence[float], poisson: Poisson | None, curves: Sequence[Curve]) -> list[str]:
    """Which nu the law has and why, and what a lateral record that was not used says."""
    nu = [float(f"{v:.4g}") for v in nu]
    values = list(dict.fromkeys(f"{v:g}" for v in nu))
    text = f"nu = {values[0]} for every term" if len(values) == 1 else (
        "nu = " + ", ".join(f"{v:.4g}" for v in nu) + ", a term each in the order of increasing alpha")
    if not isinstance(poisson, str):
        why = "taken as a foam's, since nothing was said of it" if poisson is None else "as given"
        return [f"{text}, {why}.", *_unused_lateral(float(np.mean(nu)), curves)]
    low, high = NU_BOUNDS
    at = [f"{v:.4g}" for v in dict.fromkeys(nu) if min(v - low, high - v) < AT_BOUND * (high - low)]
    how = "the lateral strains among the data" if any(c.experiment.lateral is not None for c in curves) else (
        "the volumetric data among the data" if any(c.experiment.kind == "volumetric" for c in curves) else
        "stress alone, from how the modes differ")
    out = f"{text}, fitted to {how}, between {low:g} and {high:g}"
    return [out + (f"; {', '.join(at)} stopped at that bound: do not read it." if at else ".")]


def stress_says_nu(curves: Sequence[Curve]) -> bool:
    """Whether stresses alone may say nu: of two modes, one of which is not shear."""
    kinds = {c.experiment.kind for c in curves}
    return len(kinds - {"shear"}) > 0 and len(kinds) > 1


def _require_data(poisson: str, curves: Sequence[Curve]) -> None:
    kinds = {c.experiment.kind for c in curves}
    lateral = any(c.experiment.lateral is not None for c in curves)
    volumetric = "volumetric" in kinds and len(kinds) > 1
    if lateral or volumetric or (poisson == "fit" and stress_says_nu(curves)):
        return
    requested = (
        "the lateral strain next to the axial one (a column lateral strain), or a volumetric test next to another mode"
    ) + ("" if poisson == "fit-each" else ", or a second mode next to shear")
    raise ValueError(f"poisson '{poisson}': {', '.join(sorted(kinds))} alone does not tell nu"
                     f"{' term by term' if poisson == 'fit-each' else ''}. Add {requested}, or give a value.")


def _unused_lateral(nu: float, curves: Sequence[Curve]) -> list[str]:
    own = [c for c in curves if c.experiment.lateral is not None]
    if not own:
        return []
    seen = lateral_nu(own)
    return [f"The lateral strains of {', '.join(c.label for c in own)} say nu = {seen:.3g}; they were not used, the "
            f"law has {nu:.3g}."]
