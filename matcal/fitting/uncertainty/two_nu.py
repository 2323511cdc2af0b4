"""What lateral strains say of nu against what else does: the other tests' stresses, or a value that was given."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from matcal.fitting.hyperfoam.curves import Curve
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, fit
from matcal.fitting.hyperfoam.poisson import lateral_nu, lateral_residual, stress_says_nu
from matcal.fitting.relaxation.series import Series
from matcal.fitting.uncertainty.intervals import linearised
from matcal.laws.hyperfoam import Hyperfoam

# standard deviations of the interval of lateral strains; least difference that counts; step in nu; starts of a fit
_SDS, _LEAST, _STEP, _FEW = 2.0, 0.02, 1e-4, 3


@dataclass(frozen=True)
class TwoNu:
    """Intervals of nu."""

    lateral: tuple[float, float]
    other: tuple[float, float]  # of the stresses alone, or the value that the law was given

    @property
    def contradict(self) -> bool:
        """Whether they exclude each other."""
        return max(self.lateral[0], self.other[0]) > min(self.lateral[1], self.other[1]) + _LEAST


def two_nu(found: Fit, prony: Series | None) -> TwoNu | None:
    """nu by lateral strains and without them; None where there are none, or the stresses alone do not say it."""
    lateral = [c for c in found.curves if c.experiment.lateral is not None]
    if not lateral or found.moves is not None:
        return None
    if found.nu_fitted is None:
        return TwoNu(_by_lateral(lateral), (float(found.law.nu.min()), float(found.law.nu.max())))
    curves = [replace(c, experiment=replace(c.experiment, lateral=None)) for c in found.curves]
    if not stress_says_nu(curves):
        return None
    (alone,) = linearised(fit(curves, found.law.alpha.size, "fit", starts=_FEW, thorough=False), prony).nu
    return TwoNu(_by_lateral(lateral), (alone.lo, alone.hi))


def _by_lateral(curves: Sequence[Curve]) -> tuple[float, float]:
    """Interval of the nu of lateral strains, whose errors are taken as one for all readings."""
    nu = lateral_nu(curves)
    here, there = (lateral_residual(curves, Hyperfoam(np.ones(1), np.ones(1), np.full(1, v)))
                   for v in (nu, nu - _STEP))
    sd = np.linalg.norm(here) / np.linalg.norm((there - here) / _STEP)
    return float(nu - _SDS * sd), float(nu + _SDS * sd)
