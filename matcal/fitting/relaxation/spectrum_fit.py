"""Prony series of a dynamic test or of a creep: non-negative shares at times that are given, evenly in log time, or
that are searched, whichever has the lower BIC.

Residuals are relative to the measured value; each channel counts by its own misfit. Errors of neighbouring points may
be correlated.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from matcal.fitting.relaxation.free_times import free_times
from matcal.fitting.relaxation.linear_spectrum import AtTimes, LinearSpectrum, at_times, of_creep, of_sweep, stacked
from matcal.fitting.relaxation.sweep_shift import ShiftFit, shifted
from matcal.laws.prony import Prony
from matcal.reduction.experiment import Experiment
from matcal.statistics.central_differences import slopes
from matcal.statistics.residual_correlation import correlated_errors
from touchcal.arrays import Array
from touchcal.number_words import percent

MOST_TERMS = 60
_PER_DECADE = (1, 2, 4)  # times in each decade that are compared
_LEAST = 1e-9  # share of the whole modulus that stays where no long-term modulus is seen


@dataclass(frozen=True)
class SpectrumFit:
    """A series with its instantaneous modulus, of one dynamic test or creep."""

    prony: Prony
    covariance: Array  # (2 M, 2 M) covariance of (g, tau_s); times of a sweep that were not searched have none
    modulus_Pa: float  # instantaneous modulus
    modulus_sd_Pa: float
    g_infinity_sd: float
    fitted: tuple[Array, ...]  # (n,) each channel: storage and loss modulus, Pa, or compliance, 1/Pa
    relative_rms: tuple[float, ...]  # of each channel
    orders: tuple[tuple[int, float, float], ...]  # (times, relative rms, BIC) of all tried, searched ones last
    bounds_s: tuple[float, float]  # shortest and longest time that the test sees
    decisions: tuple[str, ...]
    cpu_s: float
    shift: ShiftFit | None = None  # of sweeps at several temperatures
    master_Hz: Array | None = None  # (n,) frequencies at the reference temperature; None of a creep
    further: None = None  # as that of a series of holds, where a slower term is not excluded

    @property
    def g_sd(self) -> Array:
        """(M,) standard deviations of g."""
        return np.sqrt(np.diag(self.covariance)[:self.prony.g.size])

    @property
    def tau_sd_s(self) -> Array:
        """(M,) standard deviations of the times, s."""
        return np.sqrt(np.diag(self.covariance)[self.prony.g.size:])


def fit_spectrum(experiment: Experiment, terms: int | str = "auto", times_s: Sequence[float] | None = None,
                 reference_K: float | None = None, *, search: bool = True) -> SpectrumFit:
    """The series of a dynamic test or a creep.

    terms: "auto" (by BIC one, two or four times a decade, two and four where the storage modulus or the creep has more
    values than that, or searched ones), or how many; `times_s` are the times themselves; `reference_K` is the
    temperature of the series where there are sweeps at several. Without `search` no times are searched. Raises
    ValueError for more terms than data.
    """
    start = time.process_time()
    shift = master = None
    if experiment.sweep is not None:
        sweep = experiment.sweep
        shift = shifted(experiment.value, sweep, reference_K) if sweep.temperature_K.size > 1 else None
        master = sweep.frequency_Hz * (10 ** shift.log10_a[sweep.group] if shift else 1.0)
        model, ends = of_sweep(experiment.value, sweep, 2 * np.pi * master), (
            1 / (2 * np.pi * master.max()), 1 / (2 * np.pi * master.min()))
    else:
        assert experiment.time_s is not None
        model, ends = of_creep(experiment), (float(experiment.time_s[experiment.time_s > 0].min()),
                                              float(experiment.time_s.max()))
    least, *more = _times(terms, times_s, ends)
    if least.size >= model.points:
        raise ValueError(f"{least.size} Prony terms need more than the {model.points} values of "
                         f"{', '.join(experiment.source)}. Give fewer.")
    sets = [least, *(times for times in more if times.size < model.channels[0].size)]
    tried = [(one, one.row(model)) for one in (at_times(model, times) for times in sets)]
    if search and terms == "auto" and times_s is None:
        free = free_times(model, ends, min(tried, key=lambda one: one[1][2])[0])
        tried.append((free, free.row(model, free.times_s.size)))
    rows = [row for _, row in tried]
    best = int(np.argmin([bic for *_, bic in rows]))
    return _finished(experiment, model, tried[best][0], tuple(rows), ends, shift, master, start,
                     given=times_s is not None, searched=best >= len(sets))


def _times(terms: int | str, times_s: Sequence[float] | None, ends: tuple[float, float]) -> list[Array]:
    """Sets of times to compare: as given, so many over what was seen, or one, two and four a decade."""
    if times_s is not None:
        return [np.array(times_s, dtype=float)]
    if terms != "auto":
        return [np.geomspace(*ends, int(terms)) if int(terms) > 1 else np.array([np.sqrt(ends[0] * ends[1])])]
    low, high = np.floor(np.log10(ends[0]) + 1e-9), np.ceil(np.log10(ends[1]) - 1e-9)
    sets = [np.logspace(low, high, int(k * (high - low)) + 1) for k in _PER_DECADE]
    return [sets[0], *(s for s in sets[1:] if s.size <= MOST_TERMS)]


def _finished(experiment: Experiment, model: LinearSpectrum, best: AtTimes, rows: tuple[tuple[int, float, float], ...],
              ends: tuple[float, float], shift: ShiftFit | None, master: Array | None, start: float, *, given: bool,
              searched: bool) -> SpectrumFit:
    covariance = _covariance(model, best, searched=searched)
    moduli, tau = model.series(best.found, best.times_s)
    g = moduli[1:] / moduli.sum()
    if g.sum() > 1 - _LEAST:
        g = g * (1 - _LEAST) / g.sum()
    seen = np.ones(g.size, dtype=bool) if given else g > 0
    prony, both = Prony(g[seen], tau[seen]), np.r_[seen, seen]
    how = ("at the times given" if given else "at times that were searched, as the BIC asks" if searched else
           f"evenly in log time{', their number a decade by BIC' if len(rows) > 1 else ''}")
    said = _sentences(experiment, prony, best.rms, ends, shift, float(moduli.sum()), how)
    shares = slice(1, 1 + g.size)
    return SpectrumFit(prony, covariance[1:, 1:][np.ix_(both, both)], float(moduli.sum()),
                       float(np.sqrt(covariance[0, 0])), float(np.sqrt(max(covariance[shares, shares].sum(), 0.0))),
                       tuple(c @ best.found for c in model.columns(best.times_s)), best.rms, rows, ends, said,
                       time.process_time() - start, shift, master)


def _covariance(model: LinearSpectrum, best: AtTimes, *, searched: bool) -> Array:
    """(1 + 2 M, 1 + 2 M) covariance of (E_0, g, tau_s), by the coefficients that are not 0 and by searched times."""
    active = np.flatnonzero(best.found)
    free = active[active > 0] - 1 if searched else active[:0]

    def moved(by: Array) -> tuple[Array, Array]:
        """Coefficients and times with relative changes."""
        found, times = best.found.copy(), best.times_s.copy()
        found[active] *= 1 + by[:active.size]
        times[free] *= np.exp(by[active.size:])
        return found, times

    def followed(by: Array) -> Array:
        found, times = moved(by)
        return np.concatenate([b @ found / r for b, r in zip(model.relative(times), best.rms, strict=True)])

    def numbers(by: Array) -> Array:
        moduli, tau = model.series(*moved(by))
        return np.r_[moduli.sum(), moduli[1:] / moduli.sum(), tau]

    at = np.zeros(active.size + free.size)
    ends = np.cumsum([y.size for y in model.channels])[:-1]
    columns = slopes(followed, at)
    size = np.linalg.norm(columns, axis=0)
    residuals = np.split(followed(at) - stacked(model.relative(best.times_s), best.rms)[1], ends)
    errors = correlated_errors(residuals, np.split(columns / size, ends), 1e-9 * np.eye(at.size),
                               [0.0] * len(residuals))
    gain = np.split(np.linalg.pinv(columns / size, rcond=1e-10), ends, axis=1)
    covariance = sum(e.of(part) for e, part in zip(errors, gain, strict=True)) / np.outer(size, size)
    turn = slopes(numbers, at)
    return np.asarray(turn @ covariance @ turn.T)


def _sentences(experiment: Experiment, prony: Prony, rms: Sequence[float], ends: tuple[float, float],
               shift: ShiftFit | None, modulus_Pa: float, how: str) -> tuple[str, ...]:
    what = "storage and loss modulus" if experiment.kind == "dma" else "compliance, which relaxes by exact conversion"
    out = [f"Prony series of {prony.g.size} terms on {what}, non-negative, {how}: relative RMS "
           f"{', '.join(percent(r) for r in rms)}; times from {ends[0]:.3g} to {ends[1]:.3g} s are seen.",
           f"Instantaneous modulus {modulus_Pa:.5g} Pa, that at {ends[0]:.3g} s and shorter."]
    if shift is not None:
        reference = shift.law.reference_K - 273.15
        out.append(f"{shift.temperature_K.size} sweeps shifted along the frequency to {reference:.4g} C, neighbours by "
                   "least misfit of their overlap: log10 a_T " + ", ".join(
                       f"{t - 273.15:.3g} C {a:.3f} ± {sd:.2g}" for t, a, sd in zip(
                           shift.temperature_K, shift.log10_a, shift.sd, strict=True)) + ".")
    return tuple(out)
