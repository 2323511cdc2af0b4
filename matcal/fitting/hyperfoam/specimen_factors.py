"""How much specimens of one foam differ: a stiffness factor of each, inferred where replicates show it.

ln s_k ~ N(0, omega^2), one s_k a specimen, omega half-normal. Least squares find the factors of replicates first, with
a geometric mean of 1, so that scatter is not taken for misfit. To first order the record of specimen k is off by ln s_k
times the fitted stress. Where a file states the scatter from specimen to specimen, that takes the place of the
factor: one standard normal number moves the record along its stated deviation. It widens intervals about the fit and
is not inferred: how well a law can follow the record says nothing about it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import root_scalar
from scipy.special import ndtr

from matcal.fitting.hyperfoam.curves import Curve, of_mean_foam, weighted_model
from matcal.laws.law import Law
from touchcal.arrays import Array

# scale of the half-normal prior of omega; share of the shorter strain range that replicates must have in common
PRIOR_OMEGA, _SHARED = 0.2, 0.5
_ANOTHER_RATE = 2.0  # ratio of loading rates from which replicates are reported as tests at another rate


@dataclass(frozen=True)
class Specimens:
    """What differences between specimens do to the weighted stress."""

    factor: Array  # (n, S) weighted stress for ln s_k = 1 of each specimen; no columns where no kind has replicates
    stated: Array  # (n, D) weighted stress for one stated deviation, one column a curve that states it
    reach: float  # half the width of the 95 % interval of a single ln s, 0 without replicates
    decisions: tuple[str, ...]  # what was assumed, one sentence each


def specimens(curves: Sequence[Curve], law: Law) -> Specimens:
    """Factors where some kind was tested twice over the same strains, stated deviations where files give them."""
    ends = np.cumsum([c.experiment.value.size for c in curves])
    model = weighted_model(curves, law)
    stating = [k for k, c in enumerate(curves) if c.experiment.deviation is not None]
    groups = replicates(curves)
    repeated = [c.label for group in groups for c in group]
    free = [k for k in range(len(curves)) if k not in stating] if repeated else []
    factor, stated = np.zeros((model.size, len(free))), np.zeros((model.size, len(stating)))
    for column, k in enumerate(free):
        rows = slice(ends[k] - curves[k].experiment.value.size, ends[k])
        factor[rows, column] = model[rows]
    for column, k in enumerate(stating):
        rows = slice(ends[k] - curves[k].experiment.value.size, ends[k])
        deviation = np.abs(np.asarray(curves[k].experiment.deviation)) * np.sign(curves[k].experiment.value)
        stated[rows, column] = deviation / curves[k].scale_Pa
    return Specimens(factor, stated, _reach(groups, law), _sentences(curves, repeated, stating))


def with_factors(curves: Sequence[Curve], law: Law) -> tuple[Curve, ...]:
    """Replicates with the factor by which each is stiffer than the mean foam of `law`, geometric mean 1."""
    found: dict[str, float] = {}
    for group in replicates(curves):
        ln_s = np.array([_ln_factor(curve, law) for curve in group])
        found |= {curve.label: float(np.exp(s)) for curve, s in zip(group, ln_s - ln_s.mean(), strict=True)}
    return tuple(replace(c, factor=found.get(c.label, 1.0)) for c in curves)


def replicated(curves: Sequence[Curve]) -> bool:
    """Whether any kind was tested twice over the same strains."""
    return bool(replicates(curves))


def factor_sentences(curves: Sequence[Curve]) -> list[str]:
    """The factors of replicates, one sentence."""
    groups = replicates(curves)
    named = ", ".join(f"{c.label} {c.factor:.4g}" for group in groups for c in group)
    said = [f"Stiffness of each specimen over that of the mean foam (geometric mean 1): {named}; orders are compared "
            "and residuals judged with these factors."] if named else []
    return said + [sentence for group in groups for sentence in _rate_sentences(group)]


def _rate_sentences(group: Sequence[Curve]) -> list[str]:
    """Whether factors of one group may be the rate of its tests, which nothing corrected."""
    loose = [c for c in group if c.kernel is None and c.experiment.time_s is not None]
    rates = [float(np.ptp(c.experiment.strain) / max(np.ptp(np.asarray(c.experiment.time_s)), 1e-300)) for c in loose]
    if len(rates) < 2 or max(rates) < _ANOTHER_RATE * min(rates):
        return []
    return [f"{', '.join(c.label for c in loose)} were loaded at rates that differ by a factor of "
            f"{max(rates) / min(rates):.3g} and no relaxation was given: their stiffness factors may be rate and not "
            "scatter. Give a relaxation test."]


def _ln_factor(curve: Curve, law: Law) -> float:
    model, value = of_mean_foam(curve).model(law), curve.experiment.value
    share = float(value @ model / (model @ model))
    if share <= 0:
        raise ValueError(f"{curve.label} ({', '.join(curve.experiment.source)}): its stress runs against that of the "
                         "other specimens of its kind. Check its signs and its columns.")
    return float(np.log(share))


def _reach(groups: Sequence[Sequence[Curve]], law: Law) -> float:
    """Half the 95 % interval of a single ln s, by the factors of all replicates."""
    squares = sum(float(np.var([_ln_factor(c, law) for c in group])) * len(group) for group in groups)
    return reach(squares, sum(len(group) - 1 for group in groups))


def reach(squares: float, spare: int) -> float:
    """Half the 95 % interval of omega z, z standard normal, omega being as likely as its prior and the squares about
    the mean of `spare` + 1 such numbers make it: Student's law with a prior; 0 for none to spare."""
    if not spare:
        return 0.0
    omega = np.geomspace(1e-6, 2.0, 600)
    log = (1 - spare) * np.log(omega) - squares / (2 * omega**2) - omega**2 / (2 * PRIOR_OMEGA**2)
    weight = np.exp(log - log.max()) / np.exp(log - log.max()).sum()
    return float(root_scalar(lambda q: float(weight @ ndtr(q / omega)) - 0.975, bracket=(0.0, 10.0)).root)


def replicates(curves: Sequence[Curve]) -> list[list[Curve]]:
    """Curves without a stated deviation that share their kind and most of their strains with others, by groups."""
    groups: list[list[Curve]] = []
    for curve in (c for c in curves if c.experiment.deviation is None):
        identical = [g for g in groups if g[0].experiment.kind == curve.experiment.kind
                     and any(_overlap(curve, other) > _SHARED for other in g)]
        if identical:
            identical[0].append(curve)
        else:
            groups.append([curve])
    return [group for group in groups if len(group) > 1]


def _overlap(a: Curve, b: Curve) -> float:
    low = max(a.experiment.strain.min(), b.experiment.strain.min())
    high = min(a.experiment.strain.max(), b.experiment.strain.max())
    return float((high - low) / max(min(np.ptp(a.experiment.strain), np.ptp(b.experiment.strain)), 1e-300))


def _sentences(curves: Sequence[Curve], repeated: list[str], stating: list[int]) -> tuple[str, ...]:
    out = []
    if repeated:
        out.append(f"{', '.join(repeated)} are replicates: every specimen has a stiffness factor of its own, and mu_0 "
                   "is that of the mean foam; the value for a new specimen is given separately.")
    elif not stating:
        out.append("No replicates and no stated scatter: differences from specimen to specimen are not in the "
                   "intervals.")
    if stating:
        names = ", ".join(curves[k].label for k in stating)
        out.append(f"Scatter stated in the files of {names} is taken as that between specimens: it moves a whole curve "
                   "at once, widens the intervals about the fit, and is not inferred from the misfit.")
    return tuple(out)
