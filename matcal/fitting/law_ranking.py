"""Rubber laws compared by how well they predict what they were not fitted to, and what they say together.

Each law is fitted without each mode in turn and predicts it; of one mode, without each third of its strains. With e_k
its error there, over the stress that was left out, law k has the weight exp(-(e_k^2 - e^2)/(2 (e^2 + 0.1^2))), e the
least: laws that predict one mode equally well miss another by some 10 %. Of several modes e_k^2 is a mean of few that
may disagree: a law whose mean is above the least by no more than one standard error, of the differences from mode to
mode, has the weight 1. A law that loses Drucker stability at the stretches of the tests has none, nor one whose own
interval leaves a mode without a test open by more than a factor. Of several laws the band about the mean has the half
width t s, s^2 the mean of their own variances and the variance between them, t Student's of as many laws as the weights
amount to. Source: Burnham & Anderson, Model Selection and Multimodel Inference (2002), 4; Breiman et al.,
Classification and Regression Trees (1984), 3.4.3 (one standard error).
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from matcal.fitting.general_fit import fit_law
from matcal.fitting.hyperfoam.curves import Curve
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit
from matcal.fitting.uncertainty.intervals import FACTOR, linearised
from matcal.laws.deformation_modes import modes_of, push_forward, stacked_second_piola
from matcal.laws.known_laws import LAWS, law_type
from matcal.laws.law import Law, has_terms, units, vector
from matcal.laws.law_stack import LawStack
from matcal.laws.stability import unstable_ranges
from touchcal.arrays import Array
from touchcal.errors import NotConverged

_PARTS, _SCANNED = 3, 41  # parts of one mode; points of a scan for stability
_WORST = 10.0  # error of a prediction that does not exist
_LEAST_SPARE = 2.0  # least degrees of freedom of Student's law
_OTHERWISE = 0.1  # error in a mode that nothing shows


@dataclass(frozen=True, eq=False)
class Ranked:
    """One law, and how it did."""

    law: Law
    covariance: Array  # (K, K) of its parameters
    fitted: float  # relative RMS of the fit to all curves
    predicted: float  # that of what it was not fitted to
    lost: tuple[str, ...]  # modes in which it loses Drucker stability
    left_open: tuple[str, ...]  # modes that its own interval leaves open
    weight: float = 0.0
    errors: tuple[float, ...] = ()  # relative RMS of each mode or part that was left out


def ranked(curves: Sequence[Curve], given: dict[str, float]) -> tuple[Ranked, ...]:
    """All rubber laws that the curves allow, the best first, with weights that add up to 1."""
    tried = [row for name in LAWS if name == "neo_hooke" or law_type(name).keeps_volume
             for row in _tried(tuple(curves), law_type(name), given)]
    usable = [row for row in tried if not row.lost and not row.left_open] or [r for r in tried if not r.lost] or tried
    best = min(usable, key=lambda row: row.predicted)
    several = len({curve.experiment.kind for curve in curves}) > 1
    weight = [0.0 if row not in usable else 1.0 if several and not _clearly_worse(row.errors, best.errors)
              else support(row.predicted, best.predicted) for row in tried]
    rows = [replace(row, weight=w / sum(weight)) for row, w in zip(tried, weight, strict=True)]
    return tuple(sorted(rows, key=lambda row: (-row.weight, row.predicted)))


def _clearly_worse(errors: Sequence[float], best: Sequence[float]) -> bool:
    """Whether the mean square of errors, one a mode, is above that of the best law by more than its standard error."""
    more = np.square(errors) - np.square(best)
    return bool(np.mean(more) > np.std(more, ddof=1) / np.sqrt(more.size))


def support(error: float, least: float) -> float:
    """Weight of a law that predicts with an error, over that of the law that does with the least one."""
    return float(np.exp((least**2 - error**2) / (2 * (least**2 + _OTHERWISE**2))))


def band_over(laws: Sequence[Ranked], mode: str, strain: Array) -> tuple[Array, Array]:
    """Ends of the 95 % band of all weighted laws in a mode at strains (n,), Pa."""
    rows = [row for row in laws if row.weight > 0]
    weight = np.array([row.weight for row in rows])
    found = [_stress_and_variance(row, mode, strain) for row in rows]
    stress, variance = (np.stack(each) for each in zip(*found, strict=True))
    exists = np.isfinite(stress) & np.isfinite(variance)
    share = np.where(exists, weight[:, None], 0.0)
    share = share / np.maximum(share.sum(axis=0), 1e-300)
    stress, variance = np.where(exists, stress, 0.0), np.where(exists, variance, 0.0)
    mean = np.sum(share * stress, axis=0)
    spread = np.sqrt(np.sum(share * (variance + (stress - mean) ** 2), axis=0))
    count = 1 / np.maximum(np.sum(share**2, axis=0), 1e-300)
    reach = np.where(count > 1 + 1e-9, stdtrit(np.maximum(count - 1, _LEAST_SPARE), 0.975), 1.96)
    return mean - reach * spread, mean + reach * spread


def deciding(laws: Sequence[Ranked]) -> tuple[str, float] | None:
    """Mode without a test in which the weighted laws differ most at the stretches of the tests, and the standard
    deviation between them there over their mean; None where each mode has a test."""
    rows, found = [row for row in laws if row.weight > 0], {}
    fitted = rows[0].law.strain_range
    for mode, ends in _stretches([(kind, lo, hi) for kind, (lo, hi) in fitted.items()]).items():
        if mode in fitted:
            continue
        far, weight = np.array([max(ends, key=abs)]), np.array([row.weight for row in rows])
        stress = np.array([_stress_and_variance(row, mode, far)[0][0] for row in rows])
        weight, stress = weight[np.isfinite(stress)], stress[np.isfinite(stress)]
        if not np.any(stress):
            continue
        mean = np.average(stress, weights=weight)
        found[mode] = float(np.sqrt(np.average((stress - mean) ** 2, weights=weight)) / abs(mean))
    return max(found.items(), key=lambda item: item[1]) if found else None


def _tried(curves: tuple[Curve, ...], kind: type[Law], given: dict[str, float]) -> Iterator[Ranked]:
    kept = given if "nu" in given or kind.keeps_volume else {"nu": 0.5}
    try:
        fit = fit_law(curves, kind, kept, thorough=False)
        covariance = linearised(fit).covariance
        errors = tuple(_miss(fit, kept, seen, unseen) for seen, unseen in _folds(curves))
    except (ValueError, NotConverged):
        return  # too few strains for this law
    predicted = float(np.sqrt(np.mean(np.square(errors))))
    row = Ranked(fit.law, covariance, fit.optimum.cost**0.5, predicted, (), (), errors=errors)
    reached = _stretches([(c.experiment.kind, float(c.experiment.strain.min()), float(c.experiment.strain.max()))
                          for c in curves])
    yield replace(row, lost=tuple(_lost(fit.law, reached)), left_open=tuple(_open(row, reached)))


def _folds(curves: tuple[Curve, ...]) -> Iterator[tuple[tuple[Curve, ...], tuple[Curve, ...]]]:
    """(curves to fit, curves to predict): each mode in turn, or each part of the strains of one."""
    kinds = list(dict.fromkeys(c.experiment.kind for c in curves))
    if len(kinds) > 1:
        for kind in kinds:
            yield (tuple(c for c in curves if c.experiment.kind != kind),
                   tuple(c for c in curves if c.experiment.kind == kind))
        return
    ends = np.quantile(np.concatenate([c.experiment.strain for c in curves]), np.linspace(0, 1, _PARTS + 1))
    for low, high in itertools.pairwise(ends):
        inside = [(c.experiment.strain >= low) & (c.experiment.strain <= high) for c in curves]
        yield (tuple(_rows(c, ~i) for c, i in zip(curves, inside, strict=True) if np.any(~i)),
               tuple(_rows(c, i) for c, i in zip(curves, inside, strict=True) if np.any(i)))


def _rows(curve: Curve, chosen: NDArray[np.bool_]) -> Curve:
    """The chosen rows (n,); of a curve with a history all rows, of which the others count nothing."""
    e = curve.experiment
    if curve.kernel is not None:
        return replace(curve, scale_Pa=np.where(chosen, curve.scale_Pa, np.inf))
    part: dict[str, Any] = {name: None if getattr(e, name) is None else getattr(e, name)[chosen]
                            for name in ("strain", "value", "time_s", "samples", "deviation", "lateral", "held")}
    return replace(curve, experiment=replace(e, **part), scale_Pa=curve.scale_Pa[chosen])


def _miss(fit: Fit, given: dict[str, float], seen: tuple[Curve, ...], unseen: tuple[Curve, ...]) -> float:
    """Relative RMS on curves that were left out, by the law of the others."""
    order = np.size(getattr(fit.law, fit.law.parameters[0].name)) if has_terms(type(fit.law)) else "auto"
    law = fit_law(seen, type(fit.law), given, order, thorough=False, near=fit.law).law
    counts = [np.isfinite(c.scale_Pa) for c in unseen]
    measured = np.concatenate([c.experiment.value[own] for c, own in zip(unseen, counts, strict=True)])
    try:
        model = np.concatenate([c.model(law)[own] for c, own in zip(unseen, counts, strict=True)])
    except NotConverged:
        return _WORST
    share = float(np.sqrt(np.mean((measured - model) ** 2) / np.mean(measured**2)))
    return min(share, _WORST) if np.isfinite(share) else _WORST


def _stretches(ends: Sequence[tuple[str, float, float]]) -> dict[str, tuple[float, float]]:
    """mode -> strains of it at the principal stretches that tests (mode, lowest and highest strain) drive, and in their
    own modes those tested."""
    free = [(lo, hi) for kind, lo, hi in ends if kind in ("uniaxial", "biaxial", "planar")]
    lo, hi = min([0.0, *(lo for lo, _ in free)]), max([0.0, *(hi for _, hi in free)])
    gamma = max([0.0, *(max(abs(lo), abs(hi)) for kind, lo, hi in ends if kind == "shear")])
    most = gamma / 2 + np.hypot(1.0, gamma / 2)
    lo, hi = min(lo, 1 / most - 1), max(hi, most - 1)
    # biaxial of a stretch l has 1/l^2 across: it is judged to the stretches that uniaxial drives across, l^(1/2)
    across = max(np.sqrt(1 + hi), 1 / (1 + lo) ** 0.5)
    own = {kind: (min(low for k, low, _ in ends if k == kind), max(high for k, _, high in ends if k == kind))
           for kind, *_ in ends}
    return {"uniaxial": (lo, hi), "planar": (lo, hi), "biaxial": (1 / across - 1, across - 1),
            "shear": (0.0, max(gamma, most - 1 / most))} | own


def _lost(law: Law, reached: dict[str, tuple[float, float]]) -> Iterator[str]:
    for mode in modes_of(law):
        if mode in reached and unstable_ranges(law, "drucker", mode, np.linspace(*reached[mode], _SCANNED)):
            yield mode


def _open(row: Ranked, reached: dict[str, tuple[float, float]]) -> Iterator[str]:
    """Modes without a test in which the law's own 95 % interval spans more than a factor of FACTOR."""
    for mode in modes_of(row.law):
        if mode not in reached or mode in row.law.strain_range:
            continue
        strain = np.array([max(reached[mode], key=abs)])
        stress, variance = _stress_and_variance(row, mode, strain)
        half = 1.96 * np.sqrt(variance)
        if np.any(~np.isfinite(stress)) or np.any(np.abs(stress) + half > FACTOR * (np.abs(stress) - half)):
            yield mode


def _stress_and_variance(row: Ranked, mode: str, strain: Array) -> tuple[Array, Array]:
    """(n,) stress of a law, Pa, and its variance to first order in the parameters."""
    law, sizes = row.law, units(row.law)
    step = 1e-5 * sizes
    free = np.flatnonzero(np.diag(row.covariance) > 0)
    moves = np.eye(sizes.size)[free] * step
    stack = LawStack(law, np.vstack([vector(law), vector(law) + moves, vector(law) - moves]))
    try:
        stress = np.sum(push_forward(mode, strain) * stacked_second_piola(stack, mode, strain), axis=-1)
    except NotConverged:
        return np.full(strain.size, np.nan), np.full(strain.size, np.nan)
    slopes = (stress[1:1 + free.size] - stress[1 + free.size:]) / (2 * step[free, None])
    return stress[0], np.einsum("kn,km,mn->n", slopes, row.covariance[np.ix_(free, free)], slopes)
