"""What a hold of finite length can say about the slowest relaxation time, by its profile likelihood."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import root_scalar

from matcal.fitting.relaxation.hold_table import Hold, HoldTable
from matcal.fitting.relaxation.prony_search import residual, search_series
from matcal.laws.prony import Prony
from matcal.statistics.residual_correlation import Errors
from touchcal.arrays import Array

# where the instantaneous curve of a test comes from
_SHAPES = {"law": "the fitted hyperfoam curve, each level that is held with its own size",
           "ramp": "a spline that the stress recorded on the ramp itself shapes (no stress-strain curve was given)",
           "step": "a step of strain, since the strain is held from the first row on",
           "straight": "a stress straight between the strains that are held (no stress-strain curve was given, and the "
                       "ramp has too few samples to show its shape: what a bent curve would change is in the errors)"}
# fall of twice the log likelihood at the ends of a 95 % interval; steps of the profile over the way to either bound
_CHI_SQUARE, _STEPS = 3.84, np.geomspace(0.004, 1, 9)
_CLOSE = 5e-3  # how close, in ln tau, the ends are found


@dataclass(frozen=True)
class Slowest:
    """The slowest time and its 95 % profile interval."""

    tau_s: float  # fitted time, s
    lo_s: float  # lower end, s
    hi_s: float | None  # upper end, s; None where the record does not bound it


def slowest_time(tables: Sequence[HoldTable], doubts: Sequence[Array], vector: Array, bounds_s: tuple[float, float],
                 errors: Sequence[Errors]) -> Slowest:
    """Profile of the slowest time: every other number fitted again, contact points and drifts free within their errors.
    """
    terms = vector.size // 2
    best = float(np.sum(vector[:terms]))
    inflated = [float(e.covariance[0, 0]) * e.count / e.effective_sample_size for e in errors]
    ends = np.cumsum([t.rest.shape[0] for t in tables])[:-1]

    def misfit(at: Array) -> float:
        parts = np.split(residual(tables, at), ends)
        return sum(_square(p / np.sqrt(v), t.basis.T @ d / np.sqrt(v))
                   for p, t, d, v in zip(parts, tables, doubts, inflated, strict=True))

    def refitted(last: float, near: Array) -> Array:
        first = near.copy()
        first[terms - 1] += last - float(np.sum(near[:terms]))
        return search_series(tables, first, bounds_s, last)[1]

    def crossing(level: float, near: Array, one: float, other: float) -> float:
        found = root_scalar(lambda last: misfit(refitted(last, near)) - level, bracket=(one, other), xtol=_CLOSE)
        return float(found.root)

    def end(stops: Array) -> float | None:
        base, inside, here = misfit(vector), best, vector
        for stop in stops.tolist():
            found = refitted(stop, here)
            value = misfit(found)
            base = min(base, value)
            if value - base > _CHI_SQUARE:
                return crossing(base + _CHI_SQUARE, here, inside, stop)
            inside, here = stop, found
        return None

    low, high = np.log(bounds_s)
    down, up = end(best - (best - low) * _STEPS), end(best + (high - best) * _STEPS)
    return Slowest(float(np.exp(best)), float(np.exp(low if down is None else down)),
                   None if up is None else float(np.exp(up)))


def series_sentences(holds: Sequence[Hold], prony: Prony, slowest: Slowest) -> tuple[str, ...]:
    """How the series was fitted, and what the holds say about its slowest time."""
    ramp = ", ".join(f"{h.ramp_s:.3g} s" for h in holds)
    shape = ", ".join(dict.fromkeys(_SHAPES[h.shape] for h in holds))
    hold = max(h.hold_s for h in holds)
    how = ("seen from " + ramp + " after a step on" if all(h.step for h in holds) else
           f"with the recorded ramp ({ramp}) convolved")
    out = [f"Prony series of {prony.g.size} terms on the hold, {how} through {shape}."]
    if slowest.hi_s is None:
        out.append(f"The hold of {hold:.3g} s is too short for the slowest time, {slowest.tau_s:.3g} s as fitted: its "
                   f"95 % profile interval begins at {slowest.lo_s:.3g} s, nothing bounds it above, and the long-term "
                   "moduli are an extrapolation.")
    else:
        out.append(f"Slowest time {slowest.tau_s:.3g} s, between {slowest.lo_s:.3g} and {slowest.hi_s:.3g} s (95 % "
                   f"profile), from a hold of {hold:.3g} s.")
    return tuple(out)


def _square(miss: Array, doubt: Array) -> float:
    """Sum of squares with the doubtful numbers integrated out."""
    if not doubt.size:
        return float(miss @ miss)
    seen = doubt.T @ miss
    return float(miss @ miss - seen @ np.linalg.solve(np.eye(doubt.shape[1]) + doubt.T @ doubt, seen))
