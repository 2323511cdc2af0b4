"""Prony series fitted to relaxation tests with the ramp that they really had.

The recorded strain history drives the foam's own instantaneous curve, whose second Piola-Kirchhoff stress is convolved
with the series: a term faster than the ramp has decayed in part before the hold begins, and a fit that takes the ramp
for a step loses it. Only what is held is compared, one hold or several, each test with its own amplitude, so that only
the shape of the instantaneous curve matters. Source: paper, equation 5; ISO 3384-1.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.correlation import Errors, correlated_errors
from matcal.experiment import Experiment
from matcal.hold_table import Hold, HoldTable, doubted, hold_of, tabulate_hold
from matcal.hyperfoam import Hyperfoam
from matcal.linear_response import propagated
from matcal.prony import Prony, convolve
from matcal.series_search import LEAST_RATIO, best_series, residual, series_at, slopes
from matcal.slowest import Slowest, series_sentences, slowest_time

Array = NDArray[np.float64]

# terms that "auto" chooses among
TERMS = (1, 2, 3, 4, 5, 6)
# longest time over the length of the holds
_LONGEST = 20.0
# least fall of the stress over its noise's standard deviation that counts as relaxation
_FLAT = 4.0


@dataclass(frozen=True)
class SeriesRow:
    """One number of terms tried."""

    # number of terms
    terms: int
    # rms(residual)/rms(stress) over all holds
    rms: float
    # Bayesian information criterion n ln(rms^2) + 2 terms ln n, n points worth
    bic: float


@dataclass(frozen=True)
class PronyFit:
    """A fitted series and how well the tests determine it."""

    # fitted series
    prony: Prony
    # (2 M, 2 M) covariance of (g, tau_s)
    covariance: Array
    # measured over modelled hold stress of each test for a law with these instantaneous moduli; 1 without such a law
    amplitude: tuple[float, ...]
    # rms(residual)/rms(stress) over the hold, each test
    relative_rms: tuple[float, ...]
    # modelled stress of each test over its whole history, Pa
    stress_Pa: tuple[Array, ...]
    # what was decided, one sentence each
    decisions: tuple[str, ...]
    # CPU seconds
    cpu_s: float
    # shortest and longest time that was searched, s
    bounds_s: tuple[float, float]
    # every number of terms tried
    orders: tuple[SeriesRow, ...]
    # what the holds say about the slowest time
    slowest: Slowest
    # each test through the law's curve, and its weighted change for one standard deviation of what it doubts, (n, J)
    holds: tuple[Hold, ...]
    doubts: tuple[Array, ...]
    # independent points that the residuals are worth
    points: float


def fit_prony(experiments: Sequence[Experiment], law: Hyperfoam | None, terms: int | str = 3) -> PronyFit:
    """Series with least noise-weighted squares over the holds of relaxation tests.

    terms: 1 to 6, or "auto" (by BIC). `law` gives the shape of the instantaneous curve (its scale only enters
    `amplitude`); None takes stress as proportional to strain. Raises ValueError for another choice, for a test without
    clock, ramp or hold, and for too few points.
    """
    start = time.process_time()
    holds = tuple(hold_of(e, law, 1 if terms == "auto" else int(terms)) for e in experiments)
    bounds = _time_bounds(holds)
    tables = [tabulate_hold(h, bounds) for h in holds]
    if _flat(holds):
        return _without_relaxation(holds, bounds, start)
    tried = {n: best_series(tables, n, bounds, holds[0].hold_s) for n in _allowed(terms, holds, bounds)}
    rows = tuple(_row(tables, holds, n, v) for n, v in tried.items())
    vector = tried[min(rows, key=lambda r: r.bic).terms]
    prony = series_at(vector)
    pairs = [_projected(hold, prony) for hold in holds]
    doubts = tuple(_doubts(e, h, law, prony) for e, h in zip(experiments, holds, strict=True))
    errors = _errors(tables, doubts, vector)
    slowest = slowest_time(tables, doubts, vector, bounds, errors)
    return PronyFit(prony, _covariance(tables, doubts, errors, vector), tuple(a for a, _ in pairs),
                    tuple(map(_hold_rms, holds, pairs)), tuple(a * unit for a, unit in pairs),
                    (*order_sentences(terms, rows), *series_sentences(holds, law, prony, slowest)),
                    time.process_time() - start, bounds, rows, slowest, holds, doubts, sum(e.points for e in errors))


def _allowed(terms: int | str, holds: Sequence[Hold], bounds_s: tuple[float, float]) -> tuple[int, ...]:
    if terms != "auto" and terms not in TERMS:
        raise ValueError(f"--prony-terms '{terms}' is unknown; known: auto, {', '.join(map(str, TERMS))}.")
    if terms != "auto":
        return (int(terms),)
    points = min(int(np.count_nonzero(h.precision)) for h in holds)
    room = int(np.log(bounds_s[1] / bounds_s[0]) / np.log(LEAST_RATIO))
    return tuple(n for n in TERMS if 2 * n + 3 <= points and n <= room)


def _time_bounds(holds: Sequence[Hold]) -> tuple[float, float]:
    """Shortest and longest time that a term may have: a tenth of the ramp, many times the holds."""
    ramp = min(h.ramp_s for h in holds)
    steps = [np.diff(h.time_s[h.precision > 0]) for h in holds]
    first = min(float(np.min(s[s > 0], initial=np.inf)) for s in steps)
    longest = max(h.hold_s for h in holds)
    return min(max(first if ramp == 0 else min(first, ramp), 0.1 * ramp), longest / 4), _LONGEST * longest


def _flat(holds: Sequence[Hold]) -> bool:
    """Whether no test's hold is better described by a falling course than by a constant."""
    for hold in holds:
        seen = hold.precision > 0
        y, p = np.abs(hold.stress_Pa[seen]), hold.precision[seen]
        strain = np.abs(hold.instantaneous * hold.push)[seen]
        level = float((p * y) @ (p * strain) / max((p * strain) @ (p * strain), 1e-300))
        late = np.log1p(hold.time_s[seen] - hold.ramp_s + 1e-9)
        off = late - (p**2 @ late) / (p**2).sum()
        fall = -float((p**2 * off) @ (y - level * strain)) / max(float(p**2 @ off**2), 1e-300)
        left = p * (y - level * strain + fall * off)
        if fall * np.sqrt(p**2 @ off**2) > _FLAT * max(1.0, float(np.sqrt(np.mean(left**2)))):
            return False
    return True


def _without_relaxation(holds: tuple[Hold, ...], bounds_s: tuple[float, float], start: float) -> PronyFit:
    tau = float(np.sqrt(bounds_s[0] * bounds_s[1]))
    prony = Prony(np.zeros(1), np.full(1, tau))
    pairs = [_projected(hold, prony) for hold in holds]
    said = ("The stress does not fall during the hold by more than its noise: no relaxation was found, g is set to 0 "
            f"and its time ({tau:.3g} s) means nothing.")
    none = tuple(np.zeros((int(np.count_nonzero(h.precision)), 0)) for h in holds)
    return PronyFit(prony, np.zeros((2, 2)), tuple(a for a, _ in pairs), tuple(map(_hold_rms, holds, pairs)),
                    tuple(a * unit for a, unit in pairs), (said,), time.process_time() - start, bounds_s, (),
                    Slowest(tau, 0.0, None), holds, none, float(sum(x.shape[0] for x in none)))


def _row(tables: Sequence[HoldTable], holds: Sequence[Hold], terms: int, vector: Array) -> SeriesRow:
    square = float(np.sum(residual(tables, vector) ** 2))
    n = sum(int(np.count_nonzero(h.precision)) for h in holds)
    size = sum(float(t.target @ t.target) for t in tables)
    floor = max(square / n, 1e-14 * size / n)
    return SeriesRow(terms, float(np.sqrt(square / size)), float(n * np.log(floor) + 2 * terms * np.log(n)))


def _projected(hold: Hold, prony: Prony) -> tuple[float, Array]:
    """Best amplitude and unit history of nominal stress."""
    unit = hold.push * convolve(prony, hold.time_s, hold.instantaneous)
    u, y = hold.precision * unit, hold.precision * hold.stress_Pa
    return float(u @ y / (u @ u)), unit


def _doubts(experiment: Experiment, hold: Hold, law: Hyperfoam | None, prony: Prony) -> Array:
    """(n_held, J) weighted change of model minus record for one standard deviation of contact point and load drift."""
    seen = hold.precision > 0
    amplitude, unit = _projected(hold, prony)
    out = [np.zeros((int(np.count_nonzero(seen)), 0))]
    for moved in doubted(experiment):
        other = hold_of(moved, law, 1, seen)
        change = amplitude * (_projected(other, prony)[1] - unit) - (other.stress_Pa - hold.stress_Pa)
        out.append((hold.precision * change)[seen][:, None])
    return np.hstack(out)


def _errors(tables: Sequence[HoldTable], doubts: Sequence[Array], vector: Array) -> tuple[Errors, ...]:
    """Errors of each hold, misfit among them, in units of the noise."""
    width, first = vector.size + sum(d.shape[1] for d in doubts), 0
    whole = slopes(lambda v: residual(tables, v), vector)
    miss, at, residuals, columns, doubt = residual(tables, vector), 0, [], [], vector.size
    for table, own in zip(tables, doubts, strict=True):
        rows = slice(at, at := at + table.rest.size)
        block = np.zeros((table.basis.shape[0], width + len(tables)))
        block[:, :vector.size] = table.basis @ whole[rows]
        block[:, doubt:doubt + own.shape[1]] = own
        block[:, width + first] = table.basis @ (table.rest / np.linalg.norm(table.rest))
        doubt, first = doubt + own.shape[1], first + 1
        residuals.append(table.basis @ miss[rows])
        columns.append(block)
    prior = np.diag(np.r_[np.full(vector.size, 1e-6), np.ones(width - vector.size), np.full(len(tables), 1e-12)])
    return correlated_errors(residuals, columns, prior, [1.0] * len(tables))


def _covariance(tables: Sequence[HoldTable], doubts: Sequence[Array], errors: Sequence[Errors],
                vector: Array) -> Array:
    """Covariance of (g, tau): correlated noise and misfit, contact point and load drift."""
    jacobian = slopes(lambda v: residual(tables, v), vector)
    free = np.linalg.norm(jacobian, axis=0) > 0
    inverse = np.linalg.pinv(jacobian[:, free], rcond=1e-12)
    ends = np.cumsum([t.rest.size for t in tables])[:-1]
    gains = [part @ t.basis.T for part, t in zip(np.split(inverse, ends, axis=1), tables, strict=True)]
    covariance = propagated(errors, np.hstack(gains))
    for gain, doubt in zip(gains, doubts, strict=True):
        covariance = covariance + (gain @ doubt) @ (gain @ doubt).T
    turn = slopes(lambda v: np.r_[series_at(v).g, series_at(v).tau_s], vector)[:, free]
    return turn @ covariance @ turn.T


def _hold_rms(hold: Hold, pair: tuple[float, Array]) -> float:
    seen = hold.precision > 0
    miss = pair[0] * pair[1][seen] - hold.stress_Pa[seen]
    return float(np.sqrt(np.mean(miss**2) / np.mean(hold.stress_Pa[seen] ** 2)))


def order_sentences(terms: int | str, rows: Sequence[SeriesRow]) -> list[str]:
    """The numbers of terms tried, where the choice was open."""
    if terms != "auto":
        return []
    table = ", ".join(f"{r.terms}: {r.rms:.3%}, BIC {r.bic:.0f}" for r in rows)
    return [f"Prony terms by BIC (terms: relative RMS of the hold {table})."]
