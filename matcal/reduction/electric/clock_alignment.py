"""Two machines, two clocks: the shift between a load frame's time and a potentiostat's."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.optimize import minimize_scalar

from matcal.statistics.residual_correlation import integrated_autocorrelation_time
from touchcal.arrays import Array

# conductivity = polynomial of the strain + (1 + strain) x polynomial of the time, for the settling of the coating
_STRAIN_DEGREE, _TIME_DEGREE = 3, 7
_POINTS, _SHIFTS = 400, 600
_SLACKS = 13  # sizes of backlash that are compared


@dataclass(frozen=True)
class Shift:
    """Potentiostat time minus frame time."""

    seconds: float  # s
    sd_s: float  # standard deviation, s
    how: str  # what it was read from


def combined(first: Shift, second: Shift) -> Shift:
    """The mean of two shifts weighted by their inverse variances."""
    weights = np.array([first.sd_s, second.sd_s]) ** -2
    mean = float(weights @ [first.seconds, second.seconds] / weights.sum())
    how = (f"{first.how} (± {first.sd_s:.3f} s) and {second.how} (± {second.sd_s:.3f} s), which differ by "
           f"{second.seconds - first.seconds:.3f} s")
    return Shift(mean, float(weights.sum() ** -0.5), how)


def shift_by_break(frame_time: Array, load: Array, pot_time: Array, current: Array) -> Shift | None:
    """The shift that brings the tearing of the specimen together on both clocks; None where either record has none. In
    both it lies within one sampling interval, taken as uniform."""
    torn, open_circuit = _collapse(np.abs(load - np.median(load[:20]))), _collapse(np.abs(current))
    if torn is None or open_circuit is None:
        return None
    steps = [t[k] - t[k - 1] for t, k in ((frame_time, torn), (pot_time, open_circuit))]
    middle = [(t[k] + t[k - 1]) / 2 for t, k in ((frame_time, torn), (pot_time, open_circuit))]
    return Shift(float(middle[1] - middle[0]), float(np.hypot(*steps) / np.sqrt(12)),
                 "the moment of tearing: load and current collapse")


def with_backlash(travel: Array, slack: float) -> Array:
    """What a gripped specimen does, (n,), behind a crosshead at `travel` (n,) that turns with `slack`, same unit. At
    the first loading there is none; after each reversal the specimen stands still until the slack is taken up."""
    out, at = np.empty_like(travel), float(travel[0])
    for n, value in enumerate(travel):
        at = min(max(at, value), value + slack)
        out[n] = at
    return out


def shift_with_backlash(frame_time: Array, travel: Array, length_m: float, pot_time: Array, conductance: Array,
                        first: Shift) -> tuple[Shift, float, float]:
    """Shift and slack, m, under which the conductance of a cycled strip agrees with its motion; the slack's error, m.

    A slack delays each later half cycle by one time, as a shift does, so the record tells hardly more than their sum:
    both are posterior means over slacks from 0 to a tenth of the largest travel, equally likely beforehand, the shift
    taken at its best for each slack under the regression of `shift_by_motion`, from the shift `first`.
    """
    used = pot_time - first.seconds < frame_time[-1] - 0.01 * np.ptp(frame_time)
    pot_time, conductance = pot_time[used], conductance[used]
    slacks = np.linspace(0.0, 0.1 * float(travel.max()), _SLACKS)
    delay = float(np.ptp(frame_time)) / max(float(np.abs(np.diff(travel)).sum()), 1e-12)
    best = [_best_shift(first.seconds - slack * delay / 2, 10 * first.sd_s + slack * delay, frame_time,
                        with_backlash(travel, slack) / length_m, pot_time, conductance) for slack in slacks]
    shift, square = np.array(best).T
    at = int(np.argmin(square))
    basis, c = _regression(float(shift[at]), frame_time, with_backlash(travel, slacks[at]) / length_m, pot_time,
                           conductance, _TIME_DEGREE)
    points = pot_time.size / integrated_autocorrelation_time(c - basis @ np.linalg.lstsq(basis, c, rcond=None)[0])
    weight = np.exp(-(square / square[at] - 1) * points / 2)
    weight = weight / weight.sum()
    mean, slack = float(weight @ shift), float(weight @ slacks)
    spread = float(np.sqrt(weight @ (shift - mean) ** 2 + first.sd_s**2))
    wide = max(float(np.sqrt(weight @ (slacks - slack) ** 2)), float(slacks[1]) / 4)
    return Shift(mean, spread, "the best agreement of conductance with motion, backlash included"), slack, wide


def _best_shift(start: float, reach: float, frame_time: Array, strain: Array, pot_time: Array,
                conductance: Array) -> tuple[float, float]:
    """The shift within `reach` of `start` with the least misfit, and that misfit."""
    found: Any = minimize_scalar(lambda s: _misfit(start + s, frame_time, strain, pot_time, conductance, _TIME_DEGREE),
                                 method="bounded", bounds=(-reach, reach), options={"xatol": 1e-3 * reach})
    return start + float(found.x), float(found.fun)


def _collapse(signal: Array) -> int | None:
    """Index of the first sample after the signal falls for good to under a quarter of what it was just before."""
    reach = max(3, signal.size // 100)
    tail = signal[-3:].max()
    high = np.flatnonzero(signal > max(4 * tail, 0.25 * signal.max()))
    if not high.size or high[-1] + 3 > signal.size - 1:
        return None
    last = int(high[-1])
    before = float(np.median(signal[max(0, last - reach):last + 1]))
    after = float(np.median(signal[last + 1:last + 1 + reach]))
    return last + 1 if after < 0.25 * before else None


def shift_by_motion(frame_time: Array, strain: Array, pot_time: Array, conductance: Array, settling: bool) -> Shift:
    """The shift under which (1 + strain) x conductance is best a cubic of the strain and, if `settling`, with
    level and slope of a course of seventh degree in the time.

    Its standard deviation comes from the curvature of the sum of squares. The frame is taken to stand still before its
    record begins; potentiostat samples after its end are left out. ValueError where the records cannot overlap.
    """
    little = 0.01 * np.abs(strain).max()
    first = float(frame_time[np.flatnonzero(np.abs(strain) > little)[0]])
    # a strip that is held stretched at the end does not move there
    last = float(frame_time[np.flatnonzero(np.abs(strain - strain[-1]) > little)[-1]])
    slack = 0.1 * (last - first)
    lo, hi = pot_time[0] - first - slack, pot_time[-1] - last + slack
    if lo >= hi:
        raise ValueError(f"the potentiostat's record of {np.ptp(pot_time):.0f} s is too short for a motion of "
                         f"{last - first:.0f} s")
    degree = _TIME_DEGREE if settling else 0
    every = max(1, pot_time.size // _POINTS)
    coarse = np.linspace(lo, hi, _SHIFTS)
    cost = [_misfit(s, frame_time, strain, pot_time[::every], conductance[::every], degree) for s in coarse]
    best, step = float(coarse[int(np.argmin(cost))]), float(coarse[1] - coarse[0])
    # over the way from `best`, since the search ends at a share of its argument, which a clock's zero must not set
    found: Any = minimize_scalar(lambda s: _misfit(best + s, frame_time, strain, pot_time, conductance, degree),
                                 method="bounded", bounds=(-step, step), options={"xatol": 1e-4 * step})
    at = best + float(found.x)
    return Shift(at, _standard_deviation(at, frame_time, strain, pot_time, conductance, degree),
                 "the best agreement of conductance with motion")


def _misfit(shift: float, frame_time: Array, strain: Array, pot_time: Array, conductance: Array, degree: int) -> float:
    """Mean squared residual of (1 + strain) x conductance; infinite where less than half of the records overlap."""
    if np.count_nonzero(pot_time - shift <= frame_time[-1]) < 0.5 * pot_time.size:
        return np.inf
    basis, c = _regression(shift, frame_time, strain, pot_time, conductance, degree)
    coefficients, *_ = np.linalg.lstsq(basis, c, rcond=None)
    return float(np.mean((c - basis @ coefficients) ** 2))


def _regression(shift: float, frame_time: Array, strain: Array, pot_time: Array, conductance: Array,
                degree: int) -> tuple[Array, Array]:
    """Basis and left side of the regression at one shift."""
    used = pot_time - shift <= frame_time[-1]
    e = np.interp(pot_time[used] - shift, frame_time, strain)
    u = e / np.abs(strain).max()
    tau = 2 * (pot_time[used] - pot_time[0]) / np.ptp(pot_time) - 1
    settling = legvander(tau, degree)[:, 1:]
    basis = np.column_stack([u[:, None] ** np.arange(_STRAIN_DEGREE + 1), settling, u[:, None] * settling])
    return basis, (1 + e) * conductance[used]


def _standard_deviation(shift: float, frame_time: Array, strain: Array, pot_time: Array, conductance: Array,
                        degree: int) -> float:
    """Of the shift, by linearising: what a shift changes that the polynomials cannot follow."""
    h = 4 * float(np.median(np.diff(pot_time)))
    basis, c = _regression(shift, frame_time, strain, pot_time, conductance, degree)
    coefficients, *_ = np.linalg.lstsq(basis, c, rcond=None)
    (later, _), (earlier, _) = (_regression(s, frame_time, strain, pot_time, conductance, degree)
                                for s in (shift + h, shift - h))
    n = min(len(later), len(earlier), len(basis))
    slope = (later[:n] - earlier[:n]) @ coefficients / (2 * h)
    left = slope - basis[:n] @ np.linalg.lstsq(basis[:n], slope, rcond=None)[0]
    residual = c - basis @ coefficients
    return float(np.sqrt(np.mean(residual**2) / np.sum(left**2)))
