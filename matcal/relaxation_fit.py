"""Prony series fitted to relaxation tests with the ramp that they really had.

The recorded strain history drives the foam's own instantaneous curve, whose second Piola-Kirchhoff stress is convolved
with the series: a term faster than the ramp has decayed in part before the hold begins, and a fit that takes the ramp
for a step loses it. Only the hold is compared, each test with its own amplitude, so that only the shape of the
instantaneous curve matters. Source: paper, equation 5; ISO 3384-1.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from matcal.autocorrelation import inflation
from matcal.experiment import Experiment
from matcal.hyperfoam import Hyperfoam
from matcal.modes import push_forward, second_piola
from matcal.prony import Prony, convolve

Array = NDArray[np.float64]

TERMS = 3
# neighbouring times are kept at least this ratio apart
_LEAST_RATIO = 2.0
# the hold begins where the strain first reaches this share of its largest value
_HELD = 0.999


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


@dataclass(frozen=True)
class _Hold:
    """One test, ready to be compared."""

    # (n,) times, s, from rest
    time_s: Array
    # (n,) instantaneous second Piola-Kirchhoff stress of the law (or nominal strain), at the recorded strain
    instantaneous: Array
    # (n,) push-forward to nominal stress
    push: Array
    # (n,) measured nominal stress, Pa
    stress_Pa: Array
    # (n,) one over the standard deviation of the noise, 0 before the hold
    precision: Array


def fit_prony(experiments: Sequence[Experiment], law: Hyperfoam | None, terms: int = TERMS) -> PronyFit:
    """Series of `terms` terms with least noise-weighted squares over the holds of relaxation tests.

    `law` gives the shape of the instantaneous curve (its scale only enters `amplitude`); None takes stress as
    proportional to strain. Raises ValueError for a test without clock, ramp or hold.
    """
    start = time.process_time()
    holds = [_hold(e, law) for e in experiments]
    least, most = _time_bounds(holds)
    found = [_search(holds, first, least, most) for first in _starts(holds[0], terms, least, most)]
    vector = min(found, key=lambda pair: pair[0])[1]
    prony = _series(vector)
    pairs = [_projected(hold, prony) for hold in holds]
    covariance = _covariance(experiments, holds, law, vector)
    return PronyFit(prony, covariance, tuple(a for a, _ in pairs), tuple(map(_hold_rms, holds, pairs)),
                    tuple(a * unit for a, unit in pairs), _sentences(holds, law, prony, covariance, most),
                    time.process_time() - start)


def _hold(experiment: Experiment, law: Hyperfoam | None, held: NDArray[np.bool_] | None = None) -> _Hold:
    """The test through the law's curve; `held` (n,) marks the hold where it is known already."""
    where = f"relaxation ({', '.join(experiment.source) or 'no file'})"
    e, t = experiment.strain, experiment.time_s
    if t is None:
        raise ValueError(f"{where}: a relaxation test needs a time column.")
    if held is None:
        held = np.asarray(np.maximum.accumulate(np.abs(e)) >= _HELD * np.abs(e).max())
    if np.count_nonzero(held) < 2 * TERMS + 3 or not np.any(e):
        raise ValueError(f"{where}: {np.count_nonzero(held)} points lie in the hold; a fit needs {2 * TERMS + 3}.")
    count = np.ones(t.size) if experiment.samples is None else experiment.samples
    noise = experiment.noise or 1e-3 * float(np.abs(experiment.value).max())
    precision = np.where(held, np.sqrt(count) / noise, 0.0)
    curve = e.copy() if law is None else second_piola(law, "uniaxial", e)[:, 0]
    push = np.ones(t.size) if law is None else push_forward("uniaxial", e)[:, 0]
    return _Hold(t, curve, push, experiment.value, precision)


def _time_bounds(holds: Sequence[_Hold]) -> tuple[float, float]:
    """Shortest and longest time that a term may have: a tenth of the ramp, twice the hold."""
    ramp = min(float(h.time_s[np.argmax(h.precision > 0)]) for h in holds)
    first = min(float(np.diff(h.time_s[h.precision > 0])[0]) for h in holds)
    longest = max(float(h.time_s[-1] - h.time_s[np.argmax(h.precision > 0)]) for h in holds)
    return max(first, 0.1 * ramp), 2 * longest


def _series(vector: Array) -> Prony:
    """(ln tau_1, ln of ratios, g_i/g_inf) -> series."""
    terms = vector.size // 2
    q = np.maximum(vector[terms:], 0.0)
    return Prony(q / (1 + q.sum()), np.exp(np.cumsum(vector[:terms])))


def _projected(hold: _Hold, prony: Prony) -> tuple[float, Array]:
    """Best amplitude and unit history of nominal stress."""
    unit = hold.push * convolve(prony, hold.time_s, hold.instantaneous)
    u, y = hold.precision * unit, hold.precision * hold.stress_Pa
    return float(u @ y / (u @ u)), unit


def _residual(holds: Sequence[_Hold], vector: Array) -> Array:
    prony = _series(vector)
    out = []
    for hold in holds:
        amplitude, unit = _projected(hold, prony)
        out.append((hold.precision * (amplitude * unit - hold.stress_Pa))[hold.precision > 0])
    return np.concatenate(out)


def _search(holds: Sequence[_Hold], first: Array, least: float, most: float) -> tuple[float, Array]:
    terms = first.size // 2
    low = np.r_[np.log(least), np.full(terms - 1, np.log(_LEAST_RATIO)), np.zeros(terms)]
    high = np.r_[np.log(most), np.full(terms - 1, np.log(most / least)), np.full(terms, 20.0)]
    out = least_squares(lambda v: _residual(holds, v), np.clip(first, low + 1e-6, high - 1e-6), bounds=(low, high),
                        x_scale=np.r_[np.ones(terms), np.full(terms, 0.2)], xtol=1e-8, ftol=1e-10, max_nfev=60)
    return float(out.cost), out.x


def _starts(hold: _Hold, terms: int, least: float, most: float, count: int = 2) -> list[Array]:
    """Best combinations of times on a grid, each with its non-negative shares."""
    grid = np.geomspace(1.5 * least, most / 3, 9)
    seen = hold.precision > 0
    halves = [convolve(Prony(np.array([0.5]), np.array([tau])), hold.time_s, hold.instantaneous) for tau in grid]
    rest = 0.5 * hold.instantaneous
    columns = np.stack([hold.push * c for c in (rest, *(half - rest for half in halves))], axis=1)[seen]
    sign = np.sign(columns[-1, 0] * hold.stress_Pa[-1])
    scaled = sign * columns * hold.precision[seen, None]
    target = (hold.precision * hold.stress_Pa)[seen]
    tried = []
    for chosen in combinations(range(grid.size), terms):
        share, miss = nnls(scaled[:, [0, *(k + 1 for k in chosen)]], target)
        tau = grid[list(chosen)]
        steps = np.diff(np.log(tau), prepend=0.0)
        tried.append((miss, np.r_[steps, share[1:] / max(share[0], 1e-12)]))
    tried.sort(key=lambda pair: pair[0])
    return [vector for _, vector in tried[:count]]


def _covariance(experiments: Sequence[Experiment], holds: Sequence[_Hold], law: Hyperfoam | None,
                vector: Array) -> Array:
    """Gauss-Newton covariance of (g, tau): noise, widened for correlated residuals, contact point and load drift."""
    jacobian = _slopes(lambda v: _residual(holds, v), vector)
    residual = _residual(holds, vector)
    free = np.linalg.norm(jacobian, axis=0) > 0
    spread = max(1.0, float(residual @ residual) / max(residual.size - vector.size, 1)) * inflation(residual)
    inverse = np.linalg.pinv(jacobian[:, free])
    covariance = spread * inverse @ inverse.T
    for k, experiment in enumerate(experiments):
        for moved in _doubted(experiment):
            shifted = [*holds[:k], _hold(moved, law, holds[k].precision > 0), *holds[k + 1:]]
            effect = inverse @ (_residual(shifted, vector) - residual)
            covariance = covariance + np.outer(effect, effect)
    turn = _slopes(lambda v: np.r_[_series(v).g, _series(v).tau_s], vector)[:, free]
    return turn @ covariance @ turn.T


def _doubted(experiment: Experiment) -> list[Experiment]:
    """The experiment with its contact point, and with its load drift, one standard deviation elsewhere."""
    facts, out = experiment.facts, []
    if shift := facts.get("strain_zero_sd", 0.0):
        out.append(replace(experiment, strain=np.where(experiment.strain == 0, 0.0, experiment.strain + shift)))
    if (drift := facts.get("drift_sd_N_per_s", 0.0)) and experiment.time_s is not None:
        out.append(replace(experiment, value=experiment.value + drift / (facts["area_mm2"] * 1e-6) * experiment.time_s))
    return out


def _slopes(function, vector: Array) -> Array:
    steps = 1e-5 * np.eye(vector.size)
    return np.stack([(function(vector + s) - function(vector - s)) / 2e-5 for s in steps], axis=-1)


def _hold_rms(hold: _Hold, pair: tuple[float, Array]) -> float:
    seen = hold.precision > 0
    residual = pair[0] * pair[1][seen] - hold.stress_Pa[seen]
    return float(np.sqrt(np.mean(residual**2) / np.mean(hold.stress_Pa[seen] ** 2)))


def _sentences(holds: Sequence[_Hold], law: Hyperfoam | None, prony: Prony, covariance: Array,
               most: float) -> tuple[str, ...]:
    ramp = ", ".join(f"{h.time_s[np.argmax(h.precision > 0)]:.3g} s" for h in holds)
    shape = ("the fitted hyperfoam curve" if law is not None else
             "a stress proportional to strain (no stress-strain curve was given, so the true ramp of the stress is "
             "unknown and the fast terms are uncertain)")
    out = [f"Prony series of {prony.g.size} terms on the hold, with the recorded ramp ({ramp}) convolved through "
           f"{shape}."]
    sd = np.sqrt(np.diag(covariance))[prony.g.size:]
    if np.any(loose := sd > 0.5 * prony.tau_s):
        out.append("Weakly determined times: " + ", ".join(f"{t:.3g} ± {s:.2g} s" for t, s in
                                                           zip(prony.tau_s[loose], sd[loose], strict=True)) + ".")
    if prony.tau_s[-1] > 0.98 * most:
        out.append(f"The longest time stands at its bound of {most:.3g} s, twice the hold: the foam still relaxes when "
                   "the record ends, and the long-term moduli are an extrapolation.")
    return tuple(out)
