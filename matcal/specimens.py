"""How much specimens of one foam differ: a stiffness factor of each, inferred where replicates show it.

ln s_k ~ N(0, omega^2), one s_k a specimen, omega half-normal. To first order the record of specimen k is off by
ln s_k times the fitted stress. Where a file states the scatter from specimen to specimen, that takes the place of the
factor: one standard normal number moves the record along its stated deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.curves import Curve, weighted_model
from matcal.hyperfoam import Hyperfoam

Array = NDArray[np.float64]

# scale of the half-normal prior of omega; share of the shorter strain range that replicates must have in common
PRIOR_OMEGA, _SHARED = 0.2, 0.5


@dataclass(frozen=True)
class Specimens:
    """What differences between specimens do to the weighted stress."""

    # (n, S) weighted stress for ln s_k = 1 of each specimen; no columns where no kind has replicates
    factor: Array
    # (n, D) weighted stress for one stated deviation, one column a curve that states it
    stated: Array
    # what was assumed, one sentence each
    decisions: tuple[str, ...]


def specimens(curves: Sequence[Curve], law: Hyperfoam) -> Specimens:
    """Factors where some kind was tested twice over the same strains, stated deviations where files give them."""
    ends = np.cumsum([c.experiment.value.size for c in curves])
    model = weighted_model(curves, law)
    stating = [k for k, c in enumerate(curves) if c.experiment.deviation is not None]
    repeated = _replicates(curves)
    free = [k for k in range(len(curves)) if k not in stating] if repeated else []
    factor, stated = np.zeros((model.size, len(free))), np.zeros((model.size, len(stating)))
    for column, k in enumerate(free):
        rows = slice(ends[k] - curves[k].experiment.value.size, ends[k])
        factor[rows, column] = model[rows]
    for column, k in enumerate(stating):
        rows = slice(ends[k] - curves[k].experiment.value.size, ends[k])
        deviation = np.abs(np.asarray(curves[k].experiment.deviation)) * np.sign(curves[k].experiment.value)
        stated[rows, column] = deviation / curves[k].scale_Pa
    return Specimens(factor, stated, _sentences(curves, repeated, stating))


def scatter(found: Specimens, residual: Array) -> float:
    """Standard deviation of ln s that the weighted residuals (n,) of a fit show, 0 without replicates."""
    if not found.factor.shape[1]:
        return 0.0
    ln_s = (found.factor.T @ residual) / np.sum(found.factor**2, axis=0)
    return float(np.sqrt(np.sum(ln_s**2) / max(ln_s.size - 1, 1)))


def _replicates(curves: Sequence[Curve]) -> list[str]:
    """Labels of the curves that share their kind and most of their strains with another."""
    out = []
    for a in curves:
        for b in curves:
            if a is not b and a.experiment.kind == b.experiment.kind and _overlap(a, b) > _SHARED:
                out.append(a.label)
                break
    return out


def _overlap(a: Curve, b: Curve) -> float:
    low = max(a.experiment.strain.min(), b.experiment.strain.min())
    high = min(a.experiment.strain.max(), b.experiment.strain.max())
    return float((high - low) / max(min(np.ptp(a.experiment.strain), np.ptp(b.experiment.strain)), 1e-300))


def _sentences(curves: Sequence[Curve], repeated: list[str], stating: list[int]) -> tuple[str, ...]:
    out = []
    if repeated:
        out.append(f"{', '.join(repeated)} are replicates: every specimen has a stiffness factor of its own, and mu_0 "
                   "is that of the mean foam; the value for a new specimen is given beside it.")
    elif not stating:
        out.append("No replicates and no stated scatter: differences from specimen to specimen are not in the "
                   "intervals.")
    if stating:
        names = ", ".join(curves[k].label for k in stating)
        out.append(f"Scatter stated in the files of {names} is taken as that between specimens: it moves a whole curve "
                   "at once, and the intervals hold it.")
    return tuple(out)
