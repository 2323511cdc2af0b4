"""Relaxation tests as a fit of a series sees them: the hold through the law's own curve, tabulated in the time.

With the instantaneous second Piola-Kirchhoff history S_0 of a law the nominal stress of a series is
A w (g_inf S_0 + sum g_i D(tau_i)), D(tau) = int exp(-(t - s)/tau) dS_0. D is smooth in ln tau: a spline of it on the
few directions that all D span costs microseconds a point, whatever the number of measurements and of decades.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from matcal.experiment import Experiment
from matcal.hyperfoam import Hyperfoam
from matcal.modes import push_forward, second_piola
from matcal.prony import Prony, decaying

Array = NDArray[np.float64]

# the hold begins where the strain first reaches this share of its largest value, unless the experiment marks it
_HELD = 0.999
# tabulated times in each decade; directions smaller than this share of the largest are left out
_PER_DECADE, _KEPT = 40, 1e-12


@dataclass(frozen=True)
class Hold:
    """One test, ready to be compared."""

    # (n,) times, s, from rest
    time_s: Array
    # (n,) instantaneous second Piola-Kirchhoff stress of the law (or nominal strain), at the recorded strain
    instantaneous: Array
    # (n,) push-forward to nominal stress
    push: Array
    # (n,) measured nominal stress, Pa
    stress_Pa: Array
    # (n,) one over the standard deviation of the noise, 0 before the hold and on ramps between holds
    precision: Array

    @property
    def ramp_s(self) -> float:
        """Time at which the (first) hold begins."""
        return float(self.time_s[np.argmax(self.precision > 0)])

    @property
    def hold_s(self) -> float:
        """Length of the record from there on, s."""
        return float(self.time_s[-1]) - self.ramp_s


@dataclass(frozen=True)
class HoldTable:
    """One test on a short basis; inner products are those of the full weighted hold."""

    # (n_held, r) orthonormal directions
    basis: Array
    # (r,) weighted law without relaxation
    rest: Array
    # ln tau -> (r,) weighted D(tau)
    slow: CubicSpline
    # (r,) weighted measured stress
    target: Array
    # (r, J) further weighted vectors that were given
    more: Array

    def unit(self, ln_tau: Array, share: Array) -> Array:
        """(W, r) weighted law for (W, M) ln tau and g/g_inf, over its own long-term scale."""
        return self.rest + np.einsum("wm,wmr->wr", share, self.slow(ln_tau))


def hold_of(experiment: Experiment, law: Hyperfoam | None, terms: int,
            held: NDArray[np.bool_] | None = None) -> Hold:
    """The test through the law's curve; `held` (n,) marks the hold where it is known already.

    Raises ValueError for a test without clock or ramp, and for fewer points in the hold than `terms` need.
    """
    where = f"relaxation ({', '.join(experiment.source) or 'no file'})"
    e, t = experiment.strain, experiment.time_s
    if t is None:
        raise ValueError(f"{where}: a relaxation test needs a time column.")
    if held is None:
        held = (experiment.held > 0 if experiment.held is not None else
                np.asarray(np.maximum.accumulate(np.abs(e)) >= _HELD * np.abs(e).max()))
    if np.count_nonzero(held) < 2 * terms + 3 or not np.any(e):
        raise ValueError(f"{where}: {np.count_nonzero(held)} points lie in the hold; {terms} terms need "
                         f"{2 * terms + 3}.")
    count = np.ones(t.size) if experiment.samples is None else experiment.samples
    noise = experiment.noise or 1e-3 * float(np.abs(experiment.value).max()) or 1.0
    precision = np.where(held, np.sqrt(count) / noise, 0.0)
    curve = e.copy() if law is None else second_piola(law, "uniaxial", e)[:, 0]
    push = np.ones(t.size) if law is None else push_forward("uniaxial", e)[:, 0]
    return Hold(t, curve, push, experiment.value, precision)


def tabulate_hold(hold: Hold, bounds_s: tuple[float, float], more: Array | None = None) -> HoldTable:
    """Table for times within `bounds_s`; `more` (n_held, J) are further vectors that the basis must hold."""
    seen = hold.precision > 0
    more = np.zeros((np.count_nonzero(seen), 0)) if more is None else more
    low, high = np.log(bounds_s)
    times = np.linspace(low, high, int(np.ceil((high - low) / np.log(10) * _PER_DECADE)) + 4)
    slow = decaying(Prony(np.zeros(times.size), np.exp(times)), hold.time_s, hold.instantaneous)
    weight = (hold.precision * hold.push)[seen]
    rest, columns = weight * hold.instantaneous[seen], weight[:, None] * slow[:, seen].T
    target = (hold.precision * hold.stress_Pa)[seen]
    q, r = np.linalg.qr(_unit(np.column_stack([columns, rest, target, more])))
    left, size, _ = np.linalg.svd(r, full_matrices=False)
    basis = q @ left[:, size > _KEPT * size[0]]
    return HoldTable(basis, basis.T @ rest, CubicSpline(times, (basis.T @ columns).T), basis.T @ target,
                     basis.T @ more)


def doubted(experiment: Experiment) -> list[Experiment]:
    """The experiment with its contact point, and with its load drift, one standard deviation elsewhere."""
    facts, out = experiment.facts, []
    if shift := facts.get("strain_zero_sd", 0.0):
        out.append(replace(experiment, strain=np.where(experiment.strain == 0, 0.0, experiment.strain + shift)))
    if (drift := facts.get("drift_sd_N_per_s", 0.0)) and experiment.time_s is not None:
        out.append(replace(experiment, value=experiment.value + drift / (facts["area_mm2"] * 1e-6) * experiment.time_s))
    return out


def _unit(columns: Array) -> Array:
    """Columns of unit length, those of nothing left as they are."""
    size = np.linalg.norm(columns, axis=0)
    return columns / np.where(size > 0, size, 1.0)
