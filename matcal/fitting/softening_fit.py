"""Softening and set fitted to the cycles of tests, around the law that was fitted to their first loadings.

The numbers are least squares of the stress along the whole path, each test over its largest stress. What the law itself
leaves open, one standard deviation along each principal direction of its parameters, is in the intervals, as are
residuals that are correlated. Cycles of one amplitude determine m + beta W_max alone: beta is then 0.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from matcal.fitting.uncertainty.intervals import Uncertainty
from matcal.laws.histories.damage import Damage
from matcal.laws.histories.strain_paths import along, eta, follow
from matcal.laws.law import Law, scaled, vector, with_vector
from matcal.laws.prony import Prony
from matcal.reduction.experiment import NO_UNLOADING, Experiment, StrainPath
from matcal.statistics.residual_correlation import correlated_errors, propagated
from touchcal.arrays import Array
from touchcal.number_words import percent

NAMES = ("r", "m_Pa", "beta", "set_share")
# shares of m over the largest energy, and r, from which a search starts; ratio of energies from which on amplitudes are
# several
_STARTS, _SEVERAL = ((1.3, 0.05), (2.0, 0.2), (4.0, 0.5), (1.5, 1.0)), 1.15
_LEAST_R, _MOST_R, _MOST_BETA, _MOST_SET = 1.0 + 1e-6, 1e3, 10.0, 0.9
_SMALL = 1e-9  # share of the largest energy that m is at least
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

    def stress(self, damage: Damage, law: Law | None = None) -> Array:
        return follow(law or self.law, self.mode, self.path.strain, damage, self.path.time_s, self.prony)


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

    def damage(at: Array) -> Damage:
        values = np.array([2.0, energy, 0.0, 0.0])
        values[free] = at * np.array([1.0, energy, 1.0, 1.0])[free]
        return Damage(*values.tolist())

    def misses(at: Array) -> Array:
        found = damage(at)
        return np.concatenate([(s.stress(found) - s.path.stress_Pa) / s.scale_Pa for s in seen])

    low = np.array([_LEAST_R, _SMALL, 0.0, 0.0])[free]
    high = np.array([_MOST_R, 1e3, _MOST_BETA, _MOST_SET])[free]
    starts = [np.array([r, share, 0.1, 0.02])[free] for r, share in _STARTS]
    found = min((least_squares(misses, start, bounds=(low, high), x_scale=np.maximum(start, 0.05))
                 for start in starts), key=lambda row: row.cost)
    best = damage(found.x)
    sd, spare = _errors(found.x, found.jac, seen, best, uncertainty)
    names = [name for name, used in zip(NAMES, free, strict=True) if used]
    unit = {"m_Pa": energy}
    errors = {name: float(s) * unit.get(name, 1.0) for name, s in zip(names, sd, strict=True) if np.isfinite(s)}
    least = {"r": 1.0, "m_Pa": 0.0, "beta": 0.0, "set_share": 0.0}
    reach = float(stdtrit(spare, 0.975))
    ends = {name: (max(getattr(best, name) - reach * e, least[name]), getattr(best, name) + reach * e)
            for name, e in errors.items()}
    none = np.where(np.array(names) == "m_Pa", low, found.x)
    if "m_Pa" in ends and float(np.sum(misses(none) ** 2)) <= 2 * found.cost * (1 + reach**2 / spare):
        ends["m_Pa"] = (0.0, ends["m_Pa"][1])  # below it paths change too little to tell, which no derivative shows
    fitted = tuple(s.stress(best) for s in seen)
    rms = tuple(float(np.sqrt(np.mean((f - s.path.stress_Pa) ** 2) / np.mean(s.path.stress_Pa**2)))
                for f, s in zip(fitted, seen, strict=True))
    lost = tuple((_lost(s.path, s.path.stress_Pa), _lost(s.path, f)) for f, s in zip(fitted, seen, strict=True))
    softest = float(eta(best, np.array([energy, 0.0]))[1])
    return SofteningFit(best, errors, ends, rms, fitted, lost, softest, _sentences(rms, several, prony),
                        time.process_time() - started)


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


def _errors(at: Array, jacobian: Array, seen: Sequence[_Seen], best: Damage, law: Uncertainty) -> tuple[Array, float]:
    """Standard deviations of the numbers that were searched, infinite where the paths leave one open, and how
    many independent residuals are to spare."""
    ends = np.cumsum([s.path.strain.size for s in seen])[:-1]
    effects = _law_effects(seen, best, law)
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-12)
    columns = np.hstack([jacobian / size, effects])
    residual = np.concatenate([(s.stress(best) - s.path.stress_Pa) / s.scale_Pa for s in seen])
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
    """Work lost in the last cycle over the work put in."""
    e, p = np.abs(path.strain), np.abs(stress_Pa)
    low = e < 0.6 * e.max()
    before = int(np.flatnonzero(low[:np.flatnonzero(e >= 0.95 * e.max())[-1]])[-1])
    first = before + 1 - int(np.argmin(low[before::-1])) if not low[:before].all() else 0
    begin = first + int(np.argmin(e[first:before + 1]))
    top = before + int(np.argmax(e[before:]))
    put = float(np.trapezoid(p[begin:top + 1], e[begin:top + 1]))
    return (put + float(np.trapezoid(p[top:], e[top:]))) / put if put > 0 else 0.0


def _sentences(rms: Sequence[float], several: bool, prony: Prony | None) -> tuple[str, ...]:
    said = [f"Softening (Ogden-Roxburgh) and set fitted along the whole path around the law of the first loading: "
            f"relative RMS {', '.join(percent(r) for r in rms)}."]
    if not several:
        said.append("All cycles have one amplitude, which determines m + beta W_max alone: beta is 0.")
    if prony is not None:
        said.append("The stress relaxes by the Prony series before it is softened.")
    return tuple(said)
