"""Whether tests are those of a rubber, which keeps its volume, or of a foam: the first evidence that there is.

A ratio that was given; lateral strains; a volumetric test; a stretch to more than twice the length, which foams do not
stand; compression, in which Mooney's stress P/(lambda - lambda^-2) of a rubber stays about what it is at small strain,
while the plateau of a foam lowers it somewhere to a fraction; of several modes, whether a rubber's law follows them
together as a foam's does; tension or planar tension, in which that stress of a rubber falls before its chains are
stretched, while a foam that narrows less makes it rise. Without any it is not decided, and the law is a foam's. Source:
Treloar, The Physics of Rubber Elasticity (1975), 5; Gibson & Ashby, Cellular Solids (1997), 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.fitting.general_fit import fit_law
from matcal.fitting.hyperfoam.curves import Curve
from matcal.fitting.hyperfoam.hyperfoam_fit import fit
from matcal.fitting.hyperfoam.poisson import Poisson, lateral_nu, stress_says_nu
from matcal.laws.rubbers.ogden import Ogden

RUBBER_NU = 0.45  # Poisson's ratio from which on a material counts as a rubber
STRETCHED = 1.0  # tensile strain from which on it does
_DEEP, _EARLY = -0.15, 0.3  # compression needed, and the share of it that counts as small
# least Mooney's stress deeper in compression over that at small strain, of a foam below and of a rubber above, and its
# most. That of seven rubbers' laws with noise of 1 % stays above 0.945, that of a foam with nu = 0.2 may be 0.91
_FOAM, _RUBBER, _MOST = 0.8, 0.94, 1.6
_WINDOW, _WINDOWS = 0.2, 6  # share of the compression that is looked at together, and places of it
# misfit of a rubber's law over that of a foam's, and misfit, from which on it is no rubber, and from which on a foam
_WORSE, _WELL, _FAR = 1.5, 0.02, 3.0
# Tensile strain up to which Mooney's stress is compared with that in its first part, the ratio from which on it is a
# foam, and the power of the stretch in P/(lambda - lambda^n) of a mode. Gent's law with chains that end at a stretch of
# 1.9 has 1.1, silicone and Treloar's rubber have 0.7 to 0.9; a real foam and those of two laws had 1.7 to 1.9
_MODERATE, _STIFFER, _POWER = 0.3, 1.5, {"uniaxial": -2.0, "planar": -3.0}
_FEW = 3  # starts of a fit on the way
_PRESSED = 0.9  # volume ratio down to which only foams are pressed


@dataclass(frozen=True)
class Kind:
    """What the tests are of, and why."""

    rubber: bool  # False where it is not decided
    because: str  # half a sentence
    decided: bool = True
    by_shape: bool = False  # whether only the shape of one curve says so, which some of the others share


def kind_of(curves: Sequence[Curve], poisson: Poisson | None) -> Kind:
    """Rubber or foam, or that neither is shown."""
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
    least, largest = np.mean(kept, axis=0).tolist() if kept else (np.nan, np.nan)
    what = f"deeper in compression Mooney's stress is {least:.2g} to {largest:.2g} of that at small strain"
    if least < _FOAM:
        return Kind(False, what)
    if stress_says_nu(curves):
        return _together(curves)
    if least > _RUBBER and largest < _MOST:
        return Kind(True, what, by_shape=True)
    if (stiffer := max((_stiffened(c) for c in free), default=np.nan)) > _STIFFER:
        return Kind(False, f"up to a stretch of {1 + _MODERATE:g} Mooney's stress grows to {stiffer:.2g} times that at "
                           "small strain", by_shape=True)
    return Kind(False, what if kept else "no compression below -0.15, no stretch to twice the length and no lateral "
                                         "strain is in the tests", decided=False)


def _together(curves: Sequence[Curve]) -> Kind:
    """By the misfit of all modes; what lies between belongs to neither."""
    rubber = fit_law(curves, Ogden, {}, thorough=False).optimum.cost ** 0.5
    foam = fit(curves, "auto", "fit", starts=_FEW, thorough=False).optimum.cost ** 0.5
    is_rubber = rubber < max(_WORSE * foam, _WELL)
    return Kind(is_rubber, f"an Ogden law that keeps the volume misses the modes together by {rubber:.2%}, a foam's "
                           f"by {foam:.2%}", is_rubber or rubber > _FAR * max(foam, _WELL))


def _mooney(curve: Curve, rows: NDArray[np.bool_]) -> float:
    """Mooney's stress, Pa, of some rows, by least squares; NaN without any."""
    stretch, stress = 1 + curve.experiment.strain[rows], curve.experiment.value[rows]
    unit = stretch - stretch ** _POWER[curve.experiment.kind]
    return float(unit @ stress / (unit @ unit)) if rows.any() else np.nan


def _stiffened(curve: Curve) -> float:
    """Mooney's stress towards _MODERATE in tension over that in its first part; 0 without such a record."""
    e = curve.experiment.strain
    if curve.experiment.kind not in _POWER or e.max() < _MODERATE - 1e-9:
        return 0.0
    early, late = (_mooney(curve, (e > low * _MODERATE) & (e <= high * _MODERATE + 1e-9))
                   for low, high in ((0.0, _EARLY), (1 - _EARLY, 1.0)))
    return late / early if early > 0 and late > 0 else 0.0


def _kept(curve: Curve) -> tuple[float, float] | None:
    """Least and largest Mooney's stress deeper in a compression over that in its first part; None without such a
    record."""
    e = curve.experiment.strain
    share = e / float(e.min()) if e.min() < 0 else np.zeros_like(e)
    first, *deeper = (_mooney(curve, (e < 0) & (share >= low) & (share <= high)) for low, high in (
        (0.0, _EARLY), *((low, low + _WINDOW) for low in np.linspace(_EARLY, 1 - _WINDOW, _WINDOWS))))
    deeper = [one / first for one in deeper]
    if e.min() > _DEEP or not first > 0 or np.all(np.isnan(deeper)):
        return None
    return float(np.nanmin(deeper)), float(np.nanmax(deeper))
