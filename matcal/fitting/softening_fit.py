"""Softening, set and loop fitted to the cycles of tests, around the law that was fitted to their first loadings.

The numbers are least squares of the stress along the whole path, each test over its largest stress. What the law itself
leaves open, one standard deviation along each principal direction of its parameters, is in the intervals, as are
residuals that are correlated. Cycles of one amplitude determine m + beta W_max alone: beta is then 0. A loop is kept
where paths load again below their largest strain and its share, or what they lose there, is above 0 in 99 of 100.
"""

import functools
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from matcal.fitting.reloadings import lost_by_reloading
from matcal.fitting.uncertainty.intervals import Uncertainty
from matcal.laws.histories.damage import MOST_LOOP, Damage
from matcal.laws.histories.strain_paths import LawAlong, along, eta, follow
from matcal.laws.law import Law, scaled, vector, with_vector
from matcal.laws.prony import Prony
from matcal.reduction.experiment import NO_UNLOADING, Experiment, StrainPath
from matcal.statistics.residual_correlation import correlated_errors, propagated
from touchcal.arrays import Array
from touchcal.number_words import percent

_LOOP = ("loop_share", "loop_turn")
NAMES = ("r", "m_Pa", "beta", "set_share", *_LOOP)
# numbers, energies over the largest one, from which searches start, and those of a loop, from where they ended;
# ratio of energies from which on amplitudes are several
_STARTS = ((1.3, 0.05, 0.1, 0.02), (2.0, 0.2, 0.1, 0.02), (4.0, 0.5, 0.1, 0.02), (1.5, 1.0, 0.1, 0.02))
_LOOPS, _SEVERAL = ((0.2, 0.5), (0.1, 0.1), (0.5, 1.3)), 1.15
_SURE, _LEAST_LOSS = 0.99, 1e-3  # how sure a loop is; loss over the work put in that is none
_SMALL = 1e-9  # share of the largest energy that m is at least
_BOUNDS = {"r": (1.0 + 1e-6, 1e3), "m_Pa": (_SMALL, 1e3), "beta": (0.0, 10.0), "set_share": (0.0, 0.9),
           "loop_share": (0.0, MOST_LOOP), "loop_turn": (0.01, 2.0)}  # m over the largest energy
_SEEN = 1e-3  # principal directions of the law smaller than this share of the largest are left out


@dataclass(frozen=True)
class SofteningFit:
    """Fitted softening, its intervals, and what it leaves of each path."""

    damage: Damage
    sd: dict[str, float]  # of the numbers that the paths determine
    interval: dict[str, tuple[float, float]]  # 95 %, of the same
    relative_rms: tuple[float, ...]  # of each path, over its rms stress
    fitted: tuple[Array, ...]  # (n,) stress along each path, Pa
    lost: tuple[tuple[float, float], ...]  # work lost in the last cycle over the work put in, measured and fitted
    softest: float  # eta after unloading from the largest energy
    decisions: tuple[str, ...]
    cpu_s: float


@dataclass(frozen=True)
class _Seen:
    """A path of one test as the fit sees it."""

    mode: str
    path: StrainPath
    law: Law  # instantaneous where there is a series and a clock
    prony: Prony | None
    scale_Pa: float

    @functools.cached_property
    def table(self) -> LawAlong:
        return along(self.law, self.mode, self.path.strain)

    def stress(self, damage: Damage, law: Law | None = None) -> Array:
        return follow(law or self.law, self.mode, self.path.strain, damage, self.path.time_s, self.prony,
                      None if law else self.table)


def fit_softening(experiments: Sequence[Experiment], law: Law, uncertainty: Uncertainty,
                  prony: Prony | None) -> SofteningFit | None:
    """The softening of tests with a whole path; None where no test has one. ValueError where no test unloads of those
    of which it was asked for."""
    started = time.process_time()
    seen = [_seen(e, e.path, law, prony) for e in experiments if e.path is not None]
    if not seen and (loaded := [name for e in experiments if NO_UNLOADING in e.facts for name in e.source]):
        raise ValueError(f"{', '.join(loaded)}: no unloading is recorded. Leave `unloading` out, or give the whole "
                         "cycle.")
    if not seen:
        return None
    work = [along(law, s.mode, s.path.strain).at(s.path.strain)[1] for s in seen]
    energy = max(float(w.max()) for w in work)
    several = _amplitudes(work) > _SEVERAL
    free = np.array([True, True, several, True])
    names = tuple(name for name, used in zip(NAMES, free, strict=False) if used)
    found = _search(seen, energy, names, [np.array(start)[free] for start in _STARTS])
    sd, spare = _errors(found, seen, uncertainty)
    loops = [lost for s in seen for lost in lost_by_reloading(s.path, s.path.stress_Pa - s.stress(found.damage()))]
    if loops:
        looped = _search(seen, energy, (*names, *_LOOP), [np.r_[found.at, loop] for loop in _LOOPS])
        looped_sd, looped_spare = _errors(looped, seen, uncertainty)
        if _shown(loops, looped.at[len(names)], looped_sd[len(names)], looped_spare):
            found, sd, spare = looped, looped_sd, looped_spare
    best = found.damage()
    errors = {name: float(s) * found.unit(name) for name, s in zip(found.names, sd, strict=True) if np.isfinite(s)}
    ends = _ends(found, seen, errors, spare)
    fitted = tuple(s.stress(best) for s in seen)
    rms = tuple(float(np.sqrt(np.mean((f - s.path.stress_Pa) ** 2) / np.mean(s.path.stress_Pa**2)))
                for f, s in zip(fitted, seen, strict=True))
    lost = tuple((_lost(s.path, s.path.stress_Pa), _lost(s.path, f)) for f, s in zip(fitted, seen, strict=True))
    softest = float(eta(best, np.array([energy, 0.0]))[1])
    return SofteningFit(best, errors, ends, rms, fitted, lost, softest, _sentences(rms, found, bool(loops), prony),
                        time.process_time() - started)


@dataclass(frozen=True)
class _Found:
    """Numbers that were searched, their least squares, and what they mean."""

    names: tuple[str, ...]
    at: Array  # (K,) the numbers, m over the energy
    jacobian: Array  # (n, K) of the relative stress
    cost: float  # half the sum of the squares
    energy_Pa: float  # largest of all paths

    def unit(self, name: str) -> float:
        return self.energy_Pa if name == "m_Pa" else 1.0

    def damage(self, at: Array | None = None) -> Damage:
        values = self.at if at is None else at
        own = {name: float(v) * self.unit(name) for name, v in zip(self.names, values, strict=True)}
        return Damage(**{"r": 2.0, "m_Pa": self.energy_Pa, **own})


def _search(seen: Sequence[_Seen], energy_Pa: float, names: tuple[str, ...], starts: Sequence[Array]) -> _Found:
    empty = _Found(names, np.zeros(len(names)), np.zeros((0, len(names))), np.inf, energy_Pa)
    low, high = np.array([_BOUNDS[name] for name in names]).T
    best = min((least_squares(lambda at: _misses(seen, empty.damage(at)), np.clip(start, low + 1e-3, high - 1e-3),
                              bounds=(low, high), x_scale=np.maximum(start, 0.05)) for start in starts),
               key=lambda row: row.cost)
    return _Found(names, best.x, best.jac, float(best.cost), energy_Pa)


def _misses(seen: Sequence[_Seen], damage: Damage) -> Array:
    return np.concatenate([(s.stress(damage) - s.path.stress_Pa) / s.scale_Pa for s in seen])


def _shown(loops: Sequence[tuple[float, float]], share: float, sd: float, spare: float) -> bool:
    """Whether a loop is above 0 in 99 of 100: its share, or the work that each cycle loses and the softened law does
    not, over the work put in, as a ratio of sums over the cycles. The first is weak where the loop is another law's,
    the second where cycles are few."""
    if share > max(_LEAST_LOSS, float(stdtrit(spare, _SURE)) * sd):
        return True
    lost, put = np.array(loops).T
    count, ratio = len(loops), float(lost.sum() / put.sum())
    if count < 2:
        return False
    error = float(np.sqrt(count / (count - 1) * np.sum((lost - ratio * put) ** 2)) / put.sum())
    return ratio > max(_LEAST_LOSS, float(stdtrit(count - 1, _SURE)) * error)


def _ends(found: _Found, seen: Sequence[_Seen], errors: dict[str, float], spare: float
          ) -> dict[str, tuple[float, float]]:
    """95 % intervals of the numbers that have an error."""
    best, reach = found.damage(), float(stdtrit(spare, 0.975))
    ends = {name: (max(getattr(best, name) - reach * e, 1.0 if name == "r" else 0.0), getattr(best, name) + reach * e)
            for name, e in errors.items()}
    none = np.where(np.array(found.names) == "m_Pa", _SMALL, found.at)
    squares = float(np.sum(_misses(seen, found.damage(none)) ** 2))
    if "m_Pa" in ends and squares <= 2 * found.cost * (1 + reach**2 / spare):
        ends["m_Pa"] = (0.0, ends["m_Pa"][1])  # below it paths change too little to tell, which no derivative shows
    return ends


def _seen(experiment: Experiment, path: StrainPath, law: Law, prony: Prony | None) -> _Seen:
    relaxing = prony if prony is not None and path.time_s is not None and law.moduli == "longterm" else None
    own = scaled(law, 1 / relaxing.g_infinity) if relaxing is not None else law
    return _Seen(experiment.kind, path, own, relaxing, float(np.abs(path.stress_Pa).max()))


def _amplitudes(work: Sequence[Array]) -> float:
    """Largest energy at which a path turns over the smallest, of all paths."""
    turns: list[float] = []
    for w in work:
        most = np.maximum.accumulate(w)
        held = np.flatnonzero((w < 0.9 * most) & (np.r_[False, w[:-1] >= 0.9 * most[:-1]]))
        turns += most[held].tolist()
    return max(turns, default=1.0) / max(min(turns, default=1.0), 1e-300)


def _errors(found: _Found, seen: Sequence[_Seen], law: Uncertainty) -> tuple[Array, float]:
    """Standard deviations of the numbers that were searched, infinite where the paths leave one open, and how
    many independent residuals are to spare."""
    at, jacobian, best = found.at, found.jacobian, found.damage()
    ends = np.cumsum([s.path.strain.size for s in seen])[:-1]
    effects = _law_effects(seen, best, law)
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-12)
    columns = np.hstack([jacobian / size, effects])
    residual = _misses(seen, best)
    variance = max(float(residual @ residual) / max(residual.size - at.size, 1), 1e-16)
    prior = np.diag(np.r_[np.full(at.size, 1e-9), np.full(effects.shape[1], variance)])
    errors = correlated_errors(np.split(residual, ends), np.split(columns, ends), prior, [0.0] * len(seen))
    gain = np.asarray(np.linalg.pinv(columns[:, :at.size], rcond=1e-10), dtype=float)
    covariance = propagated(errors, gain) + (gain @ effects) @ (gain @ effects).T
    spare = max(sum(e.effective_sample_size for e in errors) - at.size, 3.0)
    seen_alone = np.diag(gain @ columns[:, :at.size]) > 0.5  # the others move with one that no residual shows
    return np.where(seen_alone, np.sqrt(np.diag(covariance)) / size, np.inf), spare


def _law_effects(seen: Sequence[_Seen], best: Damage, law: Uncertainty) -> Array:
    """(n, J) change of the relative stress for one standard deviation along each principal direction of the law."""
    count = len(law.covariance)
    size = np.sqrt(np.maximum(np.diag(law.covariance), 1e-300))
    variance, axes = np.linalg.eigh(law.covariance / np.outer(size, size))
    base = np.concatenate([s.stress(best) / s.scale_Pa for s in seen])
    out = []
    for v, axis in zip(variance, axes.T, strict=True):
        if v < _SEEN**2 * variance.max():
            continue
        step = np.zeros(vector(law.law).size)
        step[:count] = 0.1 * np.sqrt(v) * axis * size
        try:
            moved = with_vector(law.law, vector(law.law) + step)
        except ValueError:
            continue
        factor = [s.law.mu_0_Pa / law.law.mu_0_Pa for s in seen]
        out.append(10 * (np.concatenate([s.stress(best, scaled(moved, f)) / s.scale_Pa
                                         for s, f in zip(seen, factor, strict=True)]) - base))
    return np.column_stack(out) if out else np.zeros((base.size, 0))


def _lost(path: StrainPath, stress_Pa: Array) -> float:
    """Work lost in the last cycle that unloads, over the work put in."""
    e, p = np.abs(path.strain), np.abs(stress_Pa)
    low = e < 0.6 * e.max()
    end = int(np.flatnonzero(low)[-1]) + 1
    if not low[:end].all():
        e, p = e[:end], p[:end]
        low = e < 0.6 * e.max()
    before = int(np.flatnonzero(low[:np.flatnonzero(e >= 0.95 * e.max())[-1]])[-1])
    first = before + 1 - int(np.argmin(low[before::-1])) if not low[:before].all() else 0
    begin = first + int(np.argmin(e[first:before + 1]))
    top = before + int(np.argmax(e[before:]))
    put = float(np.trapezoid(p[begin:top + 1], e[begin:top + 1]))
    return (put + float(np.trapezoid(p[top:], e[top:]))) / put if put > 0 else 0.0


def _sentences(rms: Sequence[float], found: _Found, reloaded: bool, prony: Prony | None) -> tuple[str, ...]:
    looped = "loop_share" in found.names
    what = "Softening (Ogden-Roxburgh), set and loop" if looped else "Softening (Ogden-Roxburgh) and set"
    said = [f"{what} fitted along the whole path around the law of the first loading: relative RMS "
            f"{', '.join(percent(r) for r in rms)}."]
    if not looped:
        said.append("The cycles show no loop that repeats itself." if reloaded else
                    "Nothing loads again below its largest strain, which alone tells a loop from softening: no loop is "
                    "fitted.")
    if "beta" not in found.names:
        said.append("All cycles have one amplitude, which determines m + beta W_max alone: beta is 0.")
    if prony is not None:
        said.append("The stress relaxes by the Prony series before it is softened.")
    return tuple(said)
