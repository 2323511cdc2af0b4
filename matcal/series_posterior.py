"""The series' part of the posterior: ln tau, g and the noise sampled, amplitudes and doubtful numbers integrated out.

Each held stress is A w (g_inf S_0 + sum g_i D(tau_i)) + V z + e, linear in the amplitude A of its test and in what the
test doubts of itself (contact point, load drift), z ~ N(0, 1). The shape of the instantaneous curve is the fitted one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from matcal.hold_table import HoldTable, tabulate_hold
from matcal.marginal import log_marginal, triangles
from matcal.relaxation_fit import PronyFit
from matcal.series_search import LEAST_RATIO

Array = NDArray[np.float64]

# standard deviation of the prior of an amplitude, over its fitted value
_AMPLITUDE = 100.0


@dataclass(frozen=True)
class SeriesPart:
    """Everything that one evaluation of the series' part needs."""

    # tests on their bases, with the effects of what they doubt
    tables: tuple[HoldTable, ...]
    # fitted amplitude of each test
    amplitude: Array
    # ln of the shortest and longest time
    bounds: tuple[float, float]
    # number of terms
    terms: int
    # residuals, and the independent ones that they are worth
    count: float
    points: float

    @property
    def size(self) -> int:
        """Sampled numbers: ln tau, g, ln of the noise over the stated one."""
        return 2 * self.terms + 1


def series_part(prony: PronyFit) -> SeriesPart:
    """Tables of the holds that a series was fitted to."""
    tables = tuple(tabulate_hold(h, prony.bounds_s, d) for h, d in zip(prony.holds, prony.doubts, strict=True))
    count = float(sum(t.basis.shape[0] for t in tables))
    low, high = np.log(prony.bounds_s)
    return SeriesPart(tables, np.array(prony.amplitude), (float(low), float(high)), prony.prony.g.size, count,
                      min(prony.points, count))


def log_series(part: SeriesPart, x: Array, share: float = 1.0) -> Array:
    """(W,) log density at (ln tau, g, ln noise) (W, size), amplitudes and doubts integrated out."""
    m = part.terms
    ln_tau, g, ln_noise = x[:, :m], x[:, m:2 * m], x[:, -1]
    inside = (ln_tau[:, 0] > part.bounds[0]) & (ln_tau[:, -1] < part.bounds[1]) & (np.abs(ln_noise) < 15)
    inside &= np.all(np.diff(ln_tau, axis=1) >= np.log(LEAST_RATIO), axis=1)
    inside &= np.all(g >= 0, axis=1) & (g.sum(axis=1) < 1)
    out = np.full(x.shape[0], -np.inf)
    if inside.any():
        y = x[inside]
        points = share * part.points
        precision = np.exp(-y[:, -1]) * np.sqrt(points / part.count)
        out[inside] = -points * y[:, -1]
        for table, amplitude in zip(part.tables, part.amplitude, strict=True):
            out[inside] += log_marginal(_triangles(table, float(amplitude), y[:, :m], y[:, m:2 * m], precision))
    return out


def start_series(part: SeriesPart, prony: PronyFit) -> Array:
    """(size,) the fit in the coordinates that are sampled."""
    series = prony.prony
    units = [series.g_infinity * t.unit(np.log(series.tau_s)[None], _share(series.g[None]))[0] for t in part.tables]
    miss = [np.linalg.norm(a * unit - t.target)
            for a, unit, t in zip(part.amplitude, units, part.tables, strict=True)]
    noise = max(float(np.sqrt(np.sum(np.square(miss)) / part.count)), 1e-6)
    return np.r_[np.log(prony.prony.tau_s), prony.prony.g, np.log(noise)]


def prior_words(part: SeriesPart) -> str:
    """The prior of everything in the series' part."""
    low, high = np.exp(part.bounds)
    return (f"ln tau uniform between {low:.3g} and {high:.3g} s, in order, a ratio of {LEAST_RATIO:g} apart; g uniform "
            f"over g_i >= 0 with a sum below 1; amplitudes of the holds normal about 0 with {_AMPLITUDE:g} times the "
            f"fitted one; ln of their noise flat; {part.points:.0f} effective points in the holds")


def _share(g: Array) -> Array:
    return g / (1 - g.sum(axis=1, keepdims=True))


def _triangles(table: HoldTable, amplitude: float, ln_tau: Array, g: Array, precision: Array) -> Array:
    unit = amplitude * (1 - g.sum(axis=1, keepdims=True)) * table.unit(ln_tau, _share(g))
    doubt = np.broadcast_to(table.more, (g.shape[0], *table.more.shape))
    columns = np.concatenate([unit[:, :, None], doubt], axis=2) * precision[:, None, None]
    width = columns.shape[2]
    root = np.r_[1 / _AMPLITUDE, np.ones(width - 1)]
    return triangles(columns, precision[:, None] * table.target, root, np.zeros(width))
