"""Whether tests are those of a rubber, which keeps its volume, or of a foam: the first evidence that there is.

A ratio that was given; lateral strains; a volumetric test; a stretch to more than twice the length, which foams do not
stand; compression, in which Mooney's stress P/(lambda - lambda^-2) of a rubber stays about what it is at small strain,
while the plateau of a foam lowers it to a fraction; of several modes, whether a rubber's law follows them together as
a foam's does. Without any, a foam. Source: Treloar, The Physics of Rubber
Elasticity (1975), 5; Gibson & Ashby, Cellular Solids (1997), 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from matcal.fitting.general_fit import fit_law
from matcal.fitting.hyperfoam.curves import Curve
from matcal.fitting.hyperfoam.hyperfoam_fit import fit
from matcal.fitting.hyperfoam.poisson import Poisson, lateral_nu, stress_says_nu
from matcal.laws.rubbers.ogden import Ogden

RUBBER_NU = 0.45  # Poisson's ratio from which on a material counts as a rubber
STRETCHED = 1.0  # tensile strain from which on it does
_DEEP, _EARLY = -0.15, 0.3  # compression needed, and the share of it that counts as small
_KEPT = (0.85, 1.6)  # Mooney's stress deep in compression over that at small strain, of a rubber
_WORSE, _WELL = 1.5, 0.02  # misfit of a rubber's law over that of a foam's, and misfit, from which on it is no rubber
_FEW = 3  # starts of a fit on the way
_PRESSED = 0.9  # volume ratio down to which only foams are pressed


@dataclass(frozen=True)
class Kind:
    """What the tests are of, and why."""

    rubber: bool
    because: str  # half a sentence


def kind_of(curves: Sequence[Curve], poisson: Poisson | None) -> Kind:
    """Rubber or foam."""
    if isinstance(poisson, int | float):
        return Kind(poisson >= RUBBER_NU, f"nu = {poisson:g} was given")
    if poisson is not None:
        return Kind(False, "nu is fitted")
    if lateral := [c for c in curves if c.experiment.lateral is not None]:
        nu = lateral_nu(lateral)
        return Kind(nu >= RUBBER_NU, f"the lateral strains say nu = {nu:.3g}")
    if any(c.experiment.kind == "volumetric" and float(c.experiment.strain.min()) < _PRESSED for c in curves):
        return Kind(False, f"its volume was pressed below {_PRESSED:g}")
    free = [c for c in curves if c.experiment.kind in ("uniaxial", "planar", "biaxial")]
    if (most := max((float(c.experiment.strain.max()) for c in free), default=0.0)) > STRETCHED:
        return Kind(True, f"it was stretched by {most:.0%}")
    kept = [share for c in free if c.experiment.kind == "uniaxial" and (share := _kept(c)) is not None]
    if kept:
        share = float(np.mean(kept))
        what = f"deep in compression Mooney's stress is {share:.2g} of that at small strain"
        if not _KEPT[0] < share < _KEPT[1]:
            return Kind(False, what)
        return _together(curves) if stress_says_nu(curves) else Kind(True, what)
    return Kind(False, "nothing in the tests shows a rubber")


def _together(curves: Sequence[Curve]) -> Kind:
    rubber = fit_law(curves, Ogden, {}, thorough=False).optimum.cost ** 0.5
    foam = fit(curves, "auto", "fit", starts=_FEW, thorough=False).optimum.cost ** 0.5
    return Kind(rubber < max(_WORSE * foam, _WELL),
                f"an Ogden law that keeps the volume misses the modes together by {rubber:.2%}, a foam's by {foam:.2%}")


def _kept(curve: Curve) -> float | None:
    """Mooney's stress in the second half of a compression over that in its first part; None without such a record."""
    e, stress = curve.experiment.strain, curve.experiment.value
    deepest = float(e.min())
    early = (e < 0) & (e > _EARLY * deepest)
    deep = e < 0.5 * deepest
    if deepest > _DEEP or not early.any() or not deep.any():
        return None
    unit = (1 + e) - (1 + e) ** -2.0
    first, last = (float(unit[rows] @ stress[rows] / (unit[rows] @ unit[rows])) for rows in (early, deep))
    return last / first if first > 0 else None
