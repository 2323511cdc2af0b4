"""Prony series fitted to relaxation tests with the ramp that they really had.

The recorded strain history drives an instantaneous curve (`matcal.fitting.relaxation.instantaneous_curve`), whose
second Piola-Kirchhoff stress is convolved with the series: a term faster than the ramp has decayed in part before the
hold begins, and a fit that takes the ramp for a step loses it. With a law only what is held is compared, each hold with
its own size; without one the stress of the ramps is compared too and shapes the curve. Source: paper, equation 5; ISO
3384-1.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from matcal.fitting.relaxation.further_term import MATERIAL, covariance_of, further_term
from matcal.fitting.relaxation.hold_table import Hold, HoldTable, doubted, hold_of, tabulate_hold
from matcal.fitting.relaxation.instantaneous_curve import bent, runs
from matcal.fitting.relaxation.prony_search import (
    LEAST_RATIO,
    best_series,
    residual,
    series_at,
    series_with,
)
from matcal.fitting.relaxation.seen_sweep import SeenSweep, tabulate_sweep
from matcal.fitting.relaxation.slowest_time import Slowest, series_sentences, slowest_time
from matcal.laws.law import Law
from matcal.laws.prony import Prony, convolve, relaxation
from matcal.reduction.experiment import Experiment
from matcal.statistics.central_differences import slopes
from matcal.statistics.residual_correlation import (
    Errors,
    correlated_errors,
    integrated_autocorrelation_time,
)
from touchcal.arrays import Array

# terms that "auto" chooses among: up to the sixth always, more for records that span as many decades
TERMS, _ALWAYS = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 30), 6
_OF_LOSS = 2  # terms in each decade that a loss modulus, in which each is a peak, needs at most; a hold needs one
_LONGEST = 20.0  # longest time over the length of the holds
# difference of BIC up to which fewer terms whose times the holds bound are preferred to more whose slowest they do not
_NEARLY = 10.0
_FINEST = 1e-4  # relative RMS below which no record distinguishes numbers of terms
_FLAT = 4.0  # least fall of the stress over its noise's standard deviation that counts as relaxation


@dataclass(frozen=True)
class SeriesRow:
    """One number of terms tried."""

    terms: int  # number of terms
    rms: float  # rms(residual)/rms(stress) over all holds
    bic: float  # Bayesian criterion n ln(rms^2) + 2 terms ln n, n the points that correlated residuals are worth
    bounded: bool | None = None  # whether the holds bound its slowest time above; None where that was not asked


@dataclass(frozen=True)
class PronyFit:
    """A fitted series and how well the tests determine it."""

    prony: Prony  # fitted series
    covariance: Array  # (2 M, 2 M) covariance of (g, tau_s)
    # measured over modelled hold stress of each test for a law with these instantaneous moduli; 1 without such a law
    amplitude: tuple[float, ...]
    sizes: tuple[Array, ...]  # (K,) fitted sizes of the columns of each test's instantaneous curve
    relative_rms: tuple[float, ...]  # rms(residual)/rms(stress) over the hold, each test
    stress_Pa: tuple[Array, ...]  # modelled stress of each test over its whole history, Pa
    decisions: tuple[str, ...]  # what was decided, one sentence each
    cpu_s: float  # CPU seconds
    bounds_s: tuple[float, float]  # shortest and longest time that was searched, s
    orders: tuple[SeriesRow, ...]  # every number of terms tried
    slowest: Slowest  # what the holds say about the slowest time
    holds: tuple[Hold, ...]  # each test through the law's curve
    doubts: tuple[Array, ...]  # its weighted change for one standard deviation of what it doubts, (n, J)
    effective_sample_size: float  # independent points that the residuals are worth
    # relative standard deviation of the instantaneous modulus, and so of every g, from what relaxed before the first
    # row of a step's table; 0 where a ramp was recorded
    early: float = 0.0
    # the series with a slower term that the holds do not exclude, one standard deviation away; None where there is none
    further: Prony | None = None
    sweeps: tuple[SeenSweep, ...] = ()  # dynamic tests that it was fitted to as well; their sizes, doubts are last

    def tables(self) -> tuple[HoldTable, ...]:
        """Every test on its basis, with what it doubts of itself."""
        holds = len(self.holds)
        return (*(tabulate_hold(h, self.bounds_s, d) for h, d in zip(self.holds, self.doubts[:holds], strict=True)),
                *(tabulate_sweep(s, self.bounds_s, d) for s, d in zip(self.sweeps, self.doubts[holds:], strict=True)))

    @property
    def g_sd(self) -> Array:
        """(M,) standard deviations of g."""
        terms = self.prony.g.size
        moved = 0.0 if self.further is None else self.further.g[:terms] - self.prony.g
        return np.sqrt(np.diag(self.covariance)[:terms] + (self.early * self.prony.g) ** 2 + moved**2)

    @property
    def tau_sd_s(self) -> Array:
        """(M,) standard deviations of the times, s."""
        terms = self.prony.g.size
        moved = 0.0 if self.further is None else self.further.tau_s[:terms] - self.prony.tau_s
        return np.sqrt(np.diag(self.covariance)[terms:] + moved**2)

    @property
    def g_infinity_sd(self) -> float:
        """Standard deviation of 1 - sum g_i."""
        terms = self.prony.g.size
        fitted = max(float(self.covariance[:terms, :terms].sum()), 0.0)
        moved = 0.0 if self.further is None else self.further.g_infinity - self.prony.g_infinity
        return float(np.sqrt(fitted + (self.early * self.prony.g_infinity) ** 2 + moved**2))

    def start_modulus(self, test: int) -> tuple[float, float]:
        """Instantaneous modulus that a table of moduli extrapolates to, and its standard deviation, in its unit."""
        first, g, tau = self.holds[test].time_s[0], self.prony.g, self.prony.tau_s
        fallen = np.exp(-first / tau)
        left = self.prony.g_infinity + float(g @ fallen)
        slope = np.r_[fallen - 1, g * fallen * first / tau**2]
        value = float(self.sizes[test][0])
        return value, value * float(np.hypot(np.sqrt(slope @ self.covariance @ slope) / left, self.early))


@dataclass(frozen=True)
class Together:
    """Dynamic tests that are fitted with holds, and how the noise of each hold compares with that it states."""

    sweeps: tuple[SeenSweep, ...] = ()
    over_stated: tuple[float, ...] = ()

    def weighed(self, holds: Sequence[Hold]) -> tuple[Hold, ...]:
        """The holds with the noise that their own series leaves of them, at least the stated one."""
        return tuple(replace(h, precision=h.precision / max(over, 1.0))
                     for h, over in zip(holds, self.over_stated, strict=True)) if self.sweeps else tuple(holds)


ALONE = Together()


def fit_prony(experiments: Sequence[Experiment], law: Law | None, terms: int | str = 3,
              times_s: Sequence[float] | None = None, together: Together = ALONE) -> PronyFit:
    """Series with least noise-weighted squares over the holds of relaxation tests, and over dynamic tests with them.

    terms: 1 to 30, or "auto" (up to 6, more where the record spans as many decades, by BIC over the points that
    correlated residuals are worth; fewer terms that fit nearly as well are preferred to more whose slowest time
    nothing bounds). `law` gives the shape of the instantaneous curve, each hold its own size; without one the ramps
    of the tests give it. With `times_s` the shares at these times alone are searched. Raises ValueError for another
    choice, for a test without clock, ramp or hold, and for too few points.
    """
    start = time.process_time()
    sweeps = together.sweeps
    holds = together.weighed([hold_of(e, law, 1 if terms == "auto" or sweeps else int(terms)) for e in experiments])
    bounds = _time_bounds(holds, sweeps)
    if _flat(holds) and not sweeps:
        return _without_relaxation(holds, bounds, start)
    if times_s is not None:
        return _at_times(experiments, holds, law, np.array(times_s, dtype=float), start, sweeps)
    tables = _tables(holds, sweeps, bounds)
    seen_s = max([holds[0].hold_s, *(s.ends_s[1] for s in sweeps)])
    tried = _tried(tables, _allowed(terms, holds, bounds, sweeps), bounds, seen_s,
                   [tables[0], *tables[len(holds):]])
    rows = _rows(tables, tried)
    seen: dict[int, _Judged] = {}

    def judged(n: int) -> _Judged:
        if n not in seen:
            seen[n] = _judge(experiments, holds, sweeps, tables, law, tried[n], bounds)
        return seen[n]

    vector = tried[preferred(rows, lambda n: judged(n).slowest.hi_s is not None)]
    found = judged(vector.size // 2)
    rows = tuple(replace(r, bounded=seen[r.terms].slowest.hi_s is not None) if r.terms in seen else r for r in rows)
    prony = series_at(vector)
    further = further_term(tables, found.doubts, found.errors, vector, bounds,
                           max([*(_longest_s(h) for h in holds), *(s.ends_s[1] for s in sweeps)]))
    slowest = found.slowest
    if further is not None and abs(further.g_infinity / prony.g_infinity - 1) > MATERIAL:
        slowest = replace(slowest, hi_s=None)
    fits = [_projected(hold, prony) for hold in holds]
    return PronyFit(prony, _covariance(tables, found.doubts, found.errors, vector),
                    tuple(_amplitude(h, prony) for h in holds), _sizes(fits, sweeps, prony),
                    tuple(_hold_rms(h, stress) for h, (_, stress) in zip(holds, fits, strict=True)),
                    tuple(stress for _, stress in fits),
                    (*order_sentences(terms, rows, prony.g.size), *series_sentences(holds, prony, slowest)),
                    time.process_time() - start, bounds, rows, slowest, holds, found.doubts,
                    sum(e.effective_sample_size for e in found.errors), _early(holds, sweeps, prony), further, sweeps)


def _tables(holds: Sequence[Hold], sweeps: Sequence[SeenSweep], bounds_s: tuple[float, float]) -> list[HoldTable]:
    return [*(tabulate_hold(h, bounds_s) for h in holds), *(tabulate_sweep(s, bounds_s) for s in sweeps)]


def _sizes(fits: Sequence[tuple[Array, Array]], sweeps: Sequence[SeenSweep], prony: Prony) -> tuple[Array, ...]:
    return (*(c for c, _ in fits), *(np.array([s.size(prony)]) for s in sweeps))


def _at_times(experiments: Sequence[Experiment], holds: tuple[Hold, ...], law: Law | None, times_s: Array,
              start: float, sweeps: tuple[SeenSweep, ...]) -> PronyFit:
    """The series with times that are given."""
    bounds = float(times_s[0]), float(times_s[-1])
    tables = _tables(holds, sweeps, (bounds[0] / 1.01, bounds[1] * 1.01))
    vector = series_with(tables, times_s)
    prony = Prony(series_at(vector).g, times_s)
    doubts = _all_doubts(experiments, holds, sweeps, law, prony)
    errors = _errors(tables, doubts, vector, fixed=True)
    fits = [_projected(hold, prony) for hold in holds]
    covariance = _covariance(tables, doubts, errors, vector, fixed=True)
    return PronyFit(prony, covariance, tuple(_amplitude(h, prony) for h in holds), _sizes(fits, sweeps, prony),
                    tuple(_hold_rms(h, stress) for h, (_, stress) in zip(holds, fits, strict=True)),
                    tuple(stress for _, stress in fits),
                    (f"Prony series of {times_s.size} terms at the times given; their shares alone were fitted.",),
                    time.process_time() - start, bounds, (), Slowest(bounds[1], bounds[1], bounds[1]), holds, doubts,
                    sum(e.effective_sample_size for e in errors), _early(holds, sweeps, prony), None, sweeps)


@dataclass(frozen=True)
class _Judged:
    doubts: tuple[Array, ...]
    errors: tuple[Errors, ...]
    slowest: Slowest


def _judge(experiments: Sequence[Experiment], holds: Sequence[Hold], sweeps: Sequence[SeenSweep],
           tables: Sequence[HoldTable], law: Law | None, vector: Array, bounds_s: tuple[float, float]) -> _Judged:
    doubts = _all_doubts(experiments, holds, sweeps, law, series_at(vector))
    errors = _errors(tables, doubts, vector)
    return _Judged(doubts, errors, slowest_time(tables, doubts, vector, bounds_s, errors))


def _all_doubts(experiments: Sequence[Experiment], holds: Sequence[Hold], sweeps: Sequence[SeenSweep],
                law: Law | None, prony: Prony) -> tuple[Array, ...]:
    return (*(_doubts(e, h, law, prony) for e, h in zip(experiments, holds, strict=True)),
            *(s.doubts(prony) for s in sweeps))


def preferred(rows: Sequence[SeriesRow], bounded: Callable[[int], bool]) -> int:
    """Number of terms with the least BIC; where nothing bounds its slowest time, the best lower one nearly as good."""
    best = min(rows, key=lambda r: r.bic)
    if len(rows) == 1 or bounded(best.terms):
        return best.terms
    near = sorted((r for r in rows if r.terms < best.terms and r.bic < best.bic + _NEARLY), key=lambda r: r.bic)
    return next((r.terms for r in near if bounded(r.terms)), best.terms)


def _tried(tables: Sequence[HoldTable], orders: Sequence[int], bounds_s: tuple[float, float],
           hold_s: float, leading: Sequence[HoldTable]) -> dict[int, Array]:
    """Vector of the best series of each number of terms, until two in a row do not lower the BIC."""
    out: dict[int, Array] = {}
    for n in orders:
        out[n] = best_series(tables, n, bounds_s, hold_s, leading)
        if n >= min(_rows(tables, out), key=lambda r: r.bic).terms + 2:
            break
    return out


def _allowed(terms: int | str, holds: Sequence[Hold], bounds_s: tuple[float, float],
             sweeps: Sequence[SeenSweep] = ()) -> tuple[int, ...]:
    if terms != "auto":
        if terms not in range(1, TERMS[-1] + 1):
            raise ValueError(f"`prony_terms` '{terms}' is unknown; known: auto, 1 to {TERMS[-1]}.")
        return (int(terms),)
    points = min(int(np.count_nonzero(h.held)) for h in holds) + sum(s.moduli_Pa.size for s in sweeps)
    room = int(np.log(bounds_s[1] / bounds_s[0]) / np.log(LEAST_RATIO))
    decades = np.log10(bounds_s[1] / _LONGEST / bounds_s[0])
    most = min(room, max(_ALWAYS, 1 + int((_OF_LOSS if sweeps else 1) * decades)), (points - 3) // 2)
    return tuple(n for n in TERMS if n <= most)


def _time_bounds(holds: Sequence[Hold], sweeps: Sequence[SeenSweep] = ()) -> tuple[float, float]:
    """Shortest and longest time that a term may have: a tenth of the last ramp before a hold, or the finest step of
    what is compared; many times the holds; with dynamic tests what these see as well."""
    ramp = min(h.last_ramp_s for h in holds)
    steps = [np.diff(h.time_s[h.precision > 0]) for h in holds]
    first = min(float(np.min(s[s > 0], initial=np.inf)) for s in steps)
    longest = max(h.hold_s for h in holds)
    shortest = min(max(first if ramp == 0 else min(first, ramp), 0.1 * ramp), longest / 4)
    return (min([shortest, *(s.shortest_s for s in sweeps)]),
            _LONGEST * max([longest, *(s.ends_s[1] for s in sweeps)]))


def _longest_s(hold: Hold) -> float:
    """Length of the longest single hold of a test, s."""
    return max(float(hold.time_s[run][-1] - hold.time_s[run][0]) for run in runs(hold.held, hold.push))


def _flat(holds: Sequence[Hold]) -> bool:
    """Whether no hold of any test is better described by a falling course than by a constant."""
    return not any(_falls(hold, run) for hold in holds for run in runs(hold.held, hold.push))


def _falls(hold: Hold, run: slice) -> bool:
    y, p, t = np.abs(hold.stress_Pa[run]), hold.precision[run], hold.time_s[run]
    strain = np.abs(hold.instantaneous[hold.at].sum(axis=1))[run]
    level = float((p * y) @ (p * strain) / max((p * strain) @ (p * strain), 1e-300))
    late = np.log1p(t - hold.time_s[max(run.start - 1, 0)])
    off = late - (p**2 @ late) / (p**2).sum()
    fall = -float((p**2 * off) @ (y - level * strain)) / max(float(p**2 @ off**2), 1e-300)
    left = p * (y - level * strain + fall * off)
    return bool(fall * np.sqrt(p**2 @ off**2) > _FLAT * max(1.0, float(np.sqrt(np.mean(left**2)))))


def _without_relaxation(holds: tuple[Hold, ...], bounds_s: tuple[float, float], start: float) -> PronyFit:
    tau = float(np.sqrt(bounds_s[0] * bounds_s[1]))
    prony = Prony(np.zeros(1), np.full(1, tau))
    fits = [_projected(hold, prony) for hold in holds]
    said = ("The stress does not fall during the hold by more than its noise: no relaxation was found, g is set to 0 "
            f"and its time ({tau:.3g} s) means nothing.")
    none = tuple(np.zeros((int(np.count_nonzero(h.precision)), 0)) for h in holds)
    return PronyFit(prony, np.zeros((2, 2)), tuple(_amplitude(h, prony) for h in holds), tuple(c for c, _ in fits),
                    tuple(_hold_rms(h, stress) for h, (_, stress) in zip(holds, fits, strict=True)),
                    tuple(stress for _, stress in fits), (said,), time.process_time() - start, bounds_s, (),
                    Slowest(tau, 0.0, None), holds, none, float(sum(x.shape[0] for x in none)))


def _rows(tables: Sequence[HoldTable], tried: Mapping[int, Array]) -> tuple[SeriesRow, ...]:
    """Every number of terms with its BIC over the points that the residuals of the best are worth."""
    count = sum(t.basis.shape[0] for t in tables)
    size = sum(float(t.target @ t.target) for t in tables)
    misses = {n: residual(tables, v) for n, v in tried.items()}
    ends = np.cumsum([t.rest.shape[0] for t in tables])[:-1]
    least = min(misses.values(), key=lambda m: float(m @ m))
    effective = sum(t.basis.shape[0] / integrated_autocorrelation_time(t.basis @ m)
                    for t, m in zip(tables, np.split(least, ends), strict=True))

    def row(terms: int, square: float) -> SeriesRow:
        floor = max(square, _FINEST**2 * size) / count
        return SeriesRow(terms, float(np.sqrt(square / size)),
                         float(effective * np.log(floor) + 2 * terms * np.log(effective)))

    return tuple(row(n, float(m @ m)) for n, m in misses.items())


def _projected(hold: Hold, prony: Prony) -> tuple[Array, Array]:
    """Best sizes (K,) of the columns and the history (n,) of nominal stress that they make."""
    unit = _history(hold, prony)
    c = np.asarray(np.linalg.lstsq(hold.precision[:, None] * unit, hold.precision * hold.stress_Pa)[0], dtype=float)
    return c, unit @ c


def _history(hold: Hold, prony: Prony) -> Array:
    """(n, K) nominal stress of each column."""
    return hold.push[:, None] * convolve(prony, hold.fine_s, hold.instantaneous)[hold.at]


def _amplitude(hold: Hold, prony: Prony) -> float:
    """Best size of the law as it is; 1 without a law."""
    if hold.shape != "law":
        return 1.0
    u, y = hold.precision * _history(hold, prony).sum(axis=1), hold.precision * hold.stress_Pa
    return float(u @ y / (u @ u))


def _doubts(experiment: Experiment, hold: Hold, law: Law | None, prony: Prony) -> Array:
    """(n_seen, J) weighted change of model minus record for one standard deviation of contact point and load drift, and
    of the shape of a ramp that is not known."""
    seen = hold.precision > 0
    sizes, stress = _projected(hold, prony)
    out = [np.zeros((int(np.count_nonzero(seen)), 0))]
    for moved in doubted(experiment):
        other = hold_of(moved, law, 1, hold.held)
        change = _history(other, prony) @ sizes - stress - (other.stress_Pa - hold.stress_Pa)
        out.append((hold.precision * change)[seen][:, None])
    if hold.shape == "straight":
        other = replace(hold, instantaneous=bent(hold.instantaneous))
        out.append((hold.precision * (_projected(other, prony)[1] - stress))[seen][:, None])
    return np.hstack(out)


def _errors(tables: Sequence[HoldTable], doubts: Sequence[Array], vector: Array, *,
            fixed: bool = False) -> tuple[Errors, ...]:
    """Errors of each hold, misfit among them, in units of the noise; the times of the series may be fixed."""
    width, first = vector.size + sum(d.shape[1] for d in doubts), 0
    free = sum(t.rest.shape[1] for t in tables)
    whole = slopes(lambda v: residual(tables, v), vector)
    miss, at, residuals, columns, doubt = residual(tables, vector), 0, [], [], vector.size
    for table, own in zip(tables, doubts, strict=True):
        rows, columns_here = slice(at, at := at + table.rest.shape[0]), table.rest.shape[1]
        block = np.zeros((table.basis.shape[0], width + free))
        block[:, :vector.size] = table.basis @ whole[rows]
        block[:, doubt:doubt + own.shape[1]] = own
        block[:, width + first:width + first + columns_here] = table.basis @ np.linalg.qr(table.rest)[0]
        doubt, first = doubt + own.shape[1], first + columns_here
        residuals.append(table.basis @ miss[rows])
        columns.append(block)
    terms = vector.size // 2
    prior = np.diag(np.r_[np.full(terms, 1e12 if fixed else 1e-6), np.full(terms, 1e-6),
                          np.ones(width - vector.size), np.full(free, 1e-12)])
    return correlated_errors(residuals, columns, prior, [1.0] * len(tables))


def _covariance(tables: Sequence[HoldTable], doubts: Sequence[Array], errors: Sequence[Errors], vector: Array, *,
                fixed: bool = False) -> Array:
    """Covariance of (g, tau): correlated noise and misfit, contact point and load drift."""
    terms = vector.size // 2
    turn = slopes(lambda v: np.r_[series_at(v).g, series_at(v).tau_s], vector)
    moves = np.eye(vector.size)[terms:][vector[terms:] > 0] if fixed else np.eye(vector.size)
    turn = turn @ moves.T
    return turn @ covariance_of(tables, doubts, errors, vector, moves) @ turn.T


def _early(holds: Sequence[Hold], sweeps: Sequence[SeenSweep], prony: Prony) -> float:
    """How much may have relaxed before the first row of steps that no test shows sooner: as large a share as the series
    loses over the first tenfold of time that is seen."""
    first = min(float(h.time_s[0]) if h.step else 0.0 for h in holds)
    if first <= 0 or any(s.ends_s[0] < first for s in sweeps):
        return 0.0
    now, later = relaxation(prony, [first, 10 * first])
    return float(1 - later / now)


def _hold_rms(hold: Hold, stress_Pa: Array) -> float:
    miss = (stress_Pa - hold.stress_Pa)[hold.held]
    return float(np.sqrt(np.mean(miss**2) / np.mean(hold.stress_Pa[hold.held] ** 2)))


def order_sentences(terms: int | str, rows: Sequence[SeriesRow], chosen: int) -> list[str]:
    """The numbers of terms tried, where the choice was open, and why the least BIC was passed over."""
    if terms != "auto":
        return []
    table = ", ".join(f"{r.terms}: {r.rms:.3%}, BIC {r.bic:.0f}" for r in rows)
    said = [f"Prony terms by BIC (terms: relative RMS of what was compared {table})."]
    best = min(rows, key=lambda r: r.bic)
    if best.terms != chosen:
        said.append(f"{chosen} terms were taken, not {best.terms} with the least BIC: nothing bounds the slowest time "
                    f"of {best.terms}, and fewer fit nearly as well.")
    return said
