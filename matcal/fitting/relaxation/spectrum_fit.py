"""Prony series of a dynamic test or of a creep: non-negative shares at times that are given, evenly in log time.

Storage and loss modulus of every frequency are linear in the moduli E_inf, E_i of given times; so is a compliance in
J_0, J_i, which relaxes as `matcal.laws.histories.creep_series` says. Residuals are relative to the measured value; each
channel counts by its own misfit. Errors of neighbouring points may be correlated.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from matcal.fitting.relaxation.sweep_shift import ShiftFit, shifted
from matcal.laws.histories.creep_series import relaxation_of
from matcal.laws.prony import Prony
from matcal.reduction.experiment import Experiment, Sweep
from matcal.statistics.residual_correlation import correlated_errors
from touchcal.arrays import Array
from touchcal.number_words import percent

MOST_TERMS = 60
_PER_DECADE = (1, 2, 4)  # times in each decade that are compared
_TURNS, _FINEST = 4, 1e-5  # turns of weights; least relative misfit of a channel
_LEAST = 1e-9  # share of the whole modulus that stays where no long-term modulus is seen


@dataclass(frozen=True)
class SpectrumFit:
    """A series with its instantaneous modulus, of one dynamic test or creep."""

    prony: Prony
    covariance: Array  # (2 M, 2 M) covariance of (g, tau_s); the times have none
    modulus_Pa: float  # instantaneous modulus
    modulus_sd_Pa: float
    g_infinity_sd: float
    fitted: tuple[Array, ...]  # (n,) each channel: storage and loss modulus, Pa, or compliance, 1/Pa
    relative_rms: tuple[float, ...]  # of each channel
    orders: tuple[tuple[int, float, float], ...]  # (terms, relative rms, BIC) of every number of times tried
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


@dataclass(frozen=True)
class _Moduli:
    """Linear model: channels (n,) are columns(times) (n, M + 1) @ what is to be found."""

    channels: tuple[Array, ...]
    columns: Callable[[Array], tuple[Array, ...]]
    series: Callable[[Array, Array], tuple[Array, Array]]  # (found, times) -> ((E_inf, E_i), tau_s)


def fit_spectrum(experiment: Experiment, terms: int | str = "auto", times_s: Sequence[float] | None = None,
                 reference_K: float | None = None) -> SpectrumFit:
    """The series of a dynamic test or a creep.

    terms: "auto" (one, two or four times a decade, two and four where the storage modulus or the creep has more values
    than that, by BIC), or how many; `times_s` are the times themselves; `reference_K` is the temperature of the series
    where there are sweeps at several. Raises ValueError for more terms than data.
    """
    start = time.process_time()
    shift = master = None
    if experiment.sweep is not None:
        sweep = experiment.sweep
        shift = shifted(experiment.value, sweep, reference_K) if sweep.temperature_K.size > 1 else None
        master = sweep.frequency_Hz * (10 ** shift.log10_a[sweep.group] if shift else 1.0)
        model, ends = _of_sweep(experiment.value, sweep, 2 * np.pi * master), (
            1 / (2 * np.pi * master.max()), 1 / (2 * np.pi * master.min()))
    else:
        assert experiment.time_s is not None
        model, ends = _of_creep(experiment), (float(experiment.time_s[experiment.time_s > 0].min()),
                                              float(experiment.time_s.max()))
    least, *more = _times(terms, times_s, ends)
    points = sum(c.size for c in model.channels)
    if least.size >= points:
        raise ValueError(f"{least.size} Prony terms need more than the {points} values of "
                         f"{', '.join(experiment.source)}. Give fewer.")
    sets = [least, *(times for times in more if times.size < model.channels[0].size)]
    tried = [(times, *_solved(model, times)) for times in sets]
    rows = [_row(model, *one) for one in tried]
    best = int(np.argmin([bic for *_, bic in rows]))
    times, found, weight = tried[best]
    return _finished(experiment, model, times, found, weight, tuple(rows), ends, shift, master, start,
                     keep=times_s is not None)


def _times(terms: int | str, times_s: Sequence[float] | None, ends: tuple[float, float]) -> list[Array]:
    """Sets of times to compare: as given, so many over what was seen, or one, two and four a decade."""
    if times_s is not None:
        return [np.array(times_s, dtype=float)]
    if terms != "auto":
        return [np.geomspace(*ends, int(terms)) if int(terms) > 1 else np.array([np.sqrt(ends[0] * ends[1])])]
    low, high = np.floor(np.log10(ends[0]) + 1e-9), np.ceil(np.log10(ends[1]) - 1e-9)
    sets = [np.logspace(low, high, int(k * (high - low)) + 1) for k in _PER_DECADE]
    return [sets[0], *(s for s in sets[1:] if s.size <= MOST_TERMS)]


def _of_sweep(storage_Pa: Array, sweep: Sweep, omega: Array) -> _Moduli:
    def columns(times: Array) -> tuple[Array, ...]:
        turn = 1j * omega[:, None] * times
        each = np.column_stack([np.ones(omega.size), turn / (1 + turn)])
        return each.real, each.imag

    return _Moduli((storage_Pa, sweep.loss_Pa), columns, lambda found, times: (found, times))


def _of_creep(experiment: Experiment) -> _Moduli:
    t = experiment.time_s
    assert t is not None

    def columns(times: Array) -> tuple[Array, ...]:
        return (np.column_stack([np.ones(t.size), -np.expm1(-t[:, None] / times)]),)

    def series(found: Array, times: Array) -> tuple[Array, Array]:
        seen = found[1:] > 0
        rest, moduli, tau = relaxation_of(found[0], found[1:][seen], times[seen])
        return np.r_[rest, moduli], tau

    return _Moduli((experiment.value,), columns, series)


def _solved(model: _Moduli, times: Array) -> tuple[Array, list[float]]:
    """Non-negative least squares of relative residuals, and the rms of each channel. The first is fitted alone, then
    all, each counting by its own misfit and none more than the first: a loss modulus that no linear material has next
    to the storage modulus does not pull that from its values."""
    blocks = [c / y[:, None] for c, y in zip(model.columns(times), model.channels, strict=True)]

    def misfits(found: Array) -> list[float]:
        return [max(float(np.sqrt(np.mean((b @ found - 1) ** 2))), _FINEST) for b in blocks]

    found = _positive(blocks[:1], [1.0])
    for _ in range(_TURNS if len(blocks) > 1 else 0):
        rms = misfits(found)
        found = _positive(blocks, [max(r, rms[0]) for r in rms])
    return found, misfits(found)


def _positive(blocks: Sequence[Array], rms: Sequence[float]) -> Array:
    """Coefficients >= 0 with which every row of the blocks is nearest 1."""
    rows = np.vstack([b / r for b, r in zip(blocks, rms, strict=True)])
    right = np.concatenate([np.full(b.shape[0], 1 / r) for b, r in zip(blocks, rms, strict=True)])
    size = np.linalg.norm(rows, axis=0)
    return np.asarray(nnls(rows / size, right, maxiter=100 * rows.shape[1])[0] / size)


def _row(model: _Moduli, times: Array, found: Array, rms: Sequence[float]) -> tuple[int, float, float]:
    counts = [c.size for c in model.channels]
    square = sum(n * r**2 for n, r in zip(counts, rms, strict=True))
    bic = sum(2 * n * np.log(r) for n, r in zip(counts, rms, strict=True)) + np.count_nonzero(found) * np.log(
        sum(counts))
    return times.size, float(np.sqrt(square / sum(counts))), float(bic)


def _finished(experiment: Experiment, model: _Moduli, times: Array, found: Array, rms: Sequence[float],
              rows: tuple[tuple[int, float, float], ...], ends: tuple[float, float], shift: ShiftFit | None,
              master: Array | None, start: float, *, keep: bool) -> SpectrumFit:
    columns = model.columns(times)
    fitted = tuple(c @ found for c in columns)
    active = np.flatnonzero(found)
    slopes = [c[:, active] / y[:, None] / r for c, y, r in zip(columns, model.channels, rms, strict=True)]
    residuals = [(f / y - 1) / r for f, y, r in zip(fitted, model.channels, rms, strict=True)]
    size = np.linalg.norm(np.vstack(slopes), axis=0)
    errors = correlated_errors(residuals, [s / size for s in slopes], 1e-9 * np.eye(active.size), [0.0] * len(slopes))
    gain = np.linalg.pinv(np.vstack([s / size for s in slopes]), rcond=1e-10)
    parts = np.split(gain, np.cumsum([y.size for y in model.channels])[:-1], axis=1)
    covariance = sum(e.of(g) for e, g in zip(errors, parts, strict=True)) / np.outer(size, size)

    def numbers(moved: Array) -> Array:
        """(E_0, g...) of the active coefficients."""
        at = np.zeros(found.size)
        at[active] = moved
        moduli, _ = model.series(at, times)
        return np.r_[moduli.sum(), moduli[1:] / moduli.sum()]

    moduli, tau = model.series(found, times)
    step = 1e-4 * found[active]
    turn = np.column_stack([(numbers(found[active] + s) - numbers(found[active] - s)) / (2 * h)
                            for s, h in zip(np.diag(step), step, strict=True)])
    spread = turn @ covariance @ turn.T
    g = moduli[1:] / moduli.sum()
    if g.sum() > 1 - _LEAST:
        g = g * (1 - _LEAST) / g.sum()
    seen = np.ones(g.size, dtype=bool) if keep else g > 0
    out = np.zeros((2 * int(seen.sum()), 2 * int(seen.sum())))
    out[:seen.sum(), :seen.sum()] = spread[1:, 1:][np.ix_(seen, seen)]
    prony = Prony(g[seen], tau[seen])
    said = _sentences(experiment, prony, rms, ends, shift, float(moduli.sum()), keep, len(rows) > 1)
    return SpectrumFit(prony, out, float(moduli.sum()), float(np.sqrt(spread[0, 0])),
                       float(np.sqrt(max(spread[1:, 1:].sum(), 0.0))), fitted, tuple(rms), rows, ends, said,
                       time.process_time() - start, shift, master)


def _sentences(experiment: Experiment, prony: Prony, rms: Sequence[float], ends: tuple[float, float],
               shift: ShiftFit | None, modulus_Pa: float, given: bool, tried: bool) -> tuple[str, ...]:
    what = "storage and loss modulus" if experiment.kind == "dma" else "compliance, which relaxes by exact conversion"
    how = "at the times given" if given else f"evenly in log time{', their number a decade by BIC' if tried else ''}"
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
