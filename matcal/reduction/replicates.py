"""Repeated tests of one kind: how much specimens differ, point by point and in their stiffness as a whole."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from matcal.reduction.experiment import Experiment
from touchcal.arrays import Array

_POINTS = 60  # points of the common range
_FEW = 4  # specimens below which a standard deviation says little
_COMPARED = ("uniaxial", "biaxial", "planar", "shear", "volumetric", "conductivity")


@dataclass(frozen=True)
class Scatter:
    """What the specimens of one kind share and how they differ; descriptive, nothing is fitted to them."""

    kind: str  # one of experiment.KINDS
    strain: Array  # (m,) strain (gamma, J) over the range that all specimens cover
    mean: Array  # (m,) mean of their values, Pa (S/m)
    sd: Array  # (m,) standard deviation from specimen to specimen, same unit
    factor: Array  # (k,) each specimen's value over the mean, least squares over the range
    factor_sd: float  # standard deviation of `factor`
    shape_sd: float  # rms over the range of what a factor does not explain, of the rms of the mean


def scatter(experiments: Sequence[Experiment], kind: str) -> Scatter | None:
    """Between-specimen scatter of all experiments of a kind; None for fewer than two or without a common range.
    Compression and tension are kept separate: only specimens strained to the side of the first are compared."""
    rest = 1.0 if kind == "volumetric" else 0.0
    chosen = [e for e in experiments if e.kind == kind]
    chosen = [e for e in chosen if _side(e, rest) == _side(chosen[0], rest)]
    if kind not in _COMPARED or len(chosen) < 2:
        return None
    lo, hi = max(float(e.strain.min()) for e in chosen), min(float(e.strain.max()) for e in chosen)
    if lo >= hi:
        return None
    strain = np.linspace(lo, hi, _POINTS)
    values = np.stack([_at(e, strain) for e in chosen])
    mean = values.mean(axis=0)
    factor = values @ mean / (mean @ mean)
    left = values - factor[:, None] * mean
    freedom = len(chosen) - 1
    return Scatter(kind, strain, mean, values.std(axis=0, ddof=1), factor, float(factor.std(ddof=1)),
                   float(np.sqrt(np.sum(left**2) / freedom / (mean @ mean))))


def with_scatter(experiments: Sequence[Experiment]) -> list[Experiment]:
    """The experiments, each replicate with what it is among the others: facts and a sentence."""
    out = list(experiments)
    for kind in dict.fromkeys(e.kind for e in experiments):
        if (found := scatter(experiments, kind)) is None:
            continue
        rest = 1.0 if kind == "volumetric" else 0.0
        first = next(e for e in experiments if e.kind == kind)
        members = [k for k, e in enumerate(out) if e.kind == kind and _side(e, rest) == _side(first, rest)]
        for k, factor in zip(members, found.factor, strict=True):
            facts = {**out[k].facts, "replicates": float(len(members)), "stiffness_factor": float(factor),
                     "stiffness_factor_sd": found.factor_sd, "shape_scatter": found.shape_sd}
            out[k] = replace(out[k], facts=facts, decisions=(*out[k].decisions, _sentence(found, float(factor))))
    return out


def _sentence(found: Scatter, factor: float) -> str:
    few = " Two or three specimens say little about a standard deviation." if found.factor.size < _FEW else ""
    lo, hi = found.strain[[0, -1]]
    what = "J" if found.kind == "volumetric" else "gamma" if found.kind == "shear" else "strains"
    return (f"One of {found.factor.size} {found.kind} specimens: its values are {factor:.3f} times their mean for "
            f"{what} {lo:.3f} to {hi:.3f}; such factors have a standard deviation of {found.factor_sd:.3f}, and shapes "
            f"differ on top of them by {found.shape_sd:.1%} of the rms.{few}")


def _side(experiment: Experiment, rest: float) -> float:
    away = experiment.strain - rest
    return float(np.sign(away[np.argmax(np.abs(away))]))


def _at(experiment: Experiment, strain: Array) -> Array:
    """Values at strains inside its range, linear between its points, repeated strains averaged."""
    known, place = np.unique(experiment.strain, return_inverse=True)
    total = np.bincount(place, weights=experiment.value)
    return np.interp(strain, known, total / np.bincount(place))
