"""Whether a record itself, whatever the law, violates a stability criterion: where a smoothed measure of it falls.

Along a loading path that keeps its principal axes a Drucker stable material has d tau : d ln V > 0, so the Kirchhoff
stress tau = lambda P must rise with ln lambda (uniaxial, planar and biaxial with free faces, any nu; volumetric: J
times the mean stress with ln J). A strongly elliptic one has a rising nominal stress where the other stretches stand
still: in shear, and with nu = 0 in every other mode. Slopes are those of straight lines through overlapping windows; a
fall counts where the slope lies below zero by several of its standard errors and the record really drops.
Source: Ogden, Non-linear Elastic Deformations (1984), 6.2.7; Abaqus Theory Guide, "Hyperelastic material behavior".
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from matcal.fitting.hyperfoam.curves import Curve
from matcal.reduction.experiment import Experiment
from touchcal.arrays import Array

# least points of a window, windows that a record is long at each width, positions in half a window, chance that a fall
# is none, least drop as a share of the largest value of the measure
_LEAST_POINTS, _WIDTHS, _PER_HALF, _CHANCE, _DROP = 7, (30, 12, 6, 4), 2, 1e-5, 0.005


@dataclass(frozen=True)
class DataCheck:
    """What one record says about one criterion."""

    label: str  # KIND_i
    criterion: str  # "drucker" or "elliptic"
    violated: list[list[float]]  # [[lo, hi], ...] of nominal strain where it is violated by the record itself
    covered: list[float]  # [lo, hi] of nominal strain that the record covers


def check_data(curves: Sequence[Curve], nu_is_zero: bool) -> tuple[DataCheck, ...]:
    """One check a record and criterion that says something there; ellipticity outside shear needs nu = 0."""
    out = []
    for curve in curves:
        e = curve.experiment
        for criterion, measure in _measures(e, nu_is_zero).items():
            covered = [float(e.strain.min()), float(e.strain.max())]
            out.append(DataCheck(curve.label, criterion, falling(*measure), covered))
    return tuple(out)


def check_sentences(checks: Sequence[DataCheck], nu_is_zero: bool) -> list[str]:
    """What the checks found, one sentence each; one for all records where nothing was found."""
    out = []
    for check in checks:
        if check.violated:
            where = " and ".join(f"{lo:.3g} to {hi:.3g}" for lo, hi in check.violated)
            what = "lambda P" if check.criterion == "drucker" else "the nominal stress"
            out.append(f"{check.label}: in the record itself {what} falls with loading at strains {where}, so no law"
                       f"{' with nu = 0' if nu_is_zero else ''} that follows it is {check.criterion} stable there"
                       + ("; legitimate foam plateaus do that, and --stable drucker shows what stability costs."
                          if check.criterion == "drucker" else "."))
    clear = sorted({c.criterion for c in checks} - {c.criterion for c in checks if c.violated})
    return [*out, *(f"No record falls where {c} stability would forbid it." for c in clear)]


def as_lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The checks of a card's records, `fit.data_stability`, one line each, with the range that each record covers."""
    return [f"{row['test']}, record itself, {row['criterion']}: "
            + (", ".join(f"violated at {lo:.3g} to {hi:.3g}" for lo, hi in row["violated_strain"]) or "not violated")
            + " within the strains {:.3g} to {:.3g}".format(*row["covered_strain"]) for row in rows]


def falling(strain: Array, coordinate: Array, measure: Array) -> list[list[float]]:
    """[[lo, hi], ...] of `strain` (n,) where `measure` falls with `coordinate`, by more than its own noise."""
    order = np.argsort(coordinate, kind="stable")
    s, x, y = strain[order], coordinate[order], measure[order]
    flags = np.zeros(s.size, dtype=bool)
    for size in sorted({max(_LEAST_POINTS, s.size // parts) for parts in _WIDTHS}):
        limit = float(stdtrit(size - 2, 1 - _CHANCE))
        for k in range(0, s.size - size + 1, max(1, size // (2 * _PER_HALF))):
            slope, error = _slope(x[k:k + size], y[k:k + size])
            flags[k + size // 4:k + size - size // 4] |= slope < -limit * error
    return [[float(s[a]), float(s[b])] for a, b in _runs(flags)
            if -_slope(x[a:b + 1], y[a:b + 1])[0] * (x[b] - x[a]) > _DROP * np.abs(y).max()]


def _measures(e: Experiment, nu_is_zero: bool) -> dict[str, tuple[Array, Array, Array]]:
    """Criterion -> (strain, coordinate, measure that must rise with it) of a record."""
    strain, stress = e.strain, e.value
    if e.kind == "shear":
        return {"elliptic": (strain, strain, stress)}
    if e.kind == "volumetric":
        found = {"drucker": (strain, np.log(strain), strain * stress)}
        return found | ({"elliptic": (strain, strain, np.cbrt(strain) ** 2 * stress)} if nu_is_zero else {})
    found = {"drucker": (strain, np.log1p(strain), (1 + strain) * stress)}
    return found | ({"elliptic": (strain, strain, stress)} if nu_is_zero else {})


def _slope(x: Array, y: Array) -> tuple[float, float]:
    """Slope of the straight line through a window and its standard error, (0, 0) where x does not vary."""
    separation = x - x.mean()
    spread = float(separation @ separation)
    if spread <= 1e-24:
        return 0.0, 0.0
    slope = float(separation @ y) / spread
    miss = y - y.mean() - slope * separation
    return slope, float(np.sqrt(miss @ miss / max(x.size - 2, 1) / spread))


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """(first, last) of each run of true flags."""
    edges = np.flatnonzero(np.diff(np.r_[False, flags, False].astype(int)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]
