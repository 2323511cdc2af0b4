"""Relaxation tests as a fit of a series sees them: the hold through the law's own curve, tabulated in the time.

With instantaneous second Piola-Kirchhoff histories S_0k (`matcal.fitting.relaxation.instantaneous_curve`) the nominal
stress of a series is sum_k A_k w (g_inf S_0k + sum g_i D_k(tau_i)), D_k(tau) = int exp(-(t - s)/tau) dS_0k. D is smooth
in ln tau: a spline of it on the few directions that all D span costs microseconds a point, whatever the number of
measurements and decades.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from matcal.fitting.relaxation.instantaneous_curve import of_law, of_ramp
from matcal.laws.deformation_modes import push_forward
from matcal.laws.law import Law
from matcal.laws.prony import Prony, decaying
from matcal.reduction.experiment import Experiment
from matcal.reduction.hold_segments import band_of, loading_start
from touchcal.arrays import Array

_HELD = 0.999  # a hold begins where the strain first reaches this share of its largest, unless the experiment marks it
_FAR = 0.02  # longest step of the strain over its largest
# tabulated times in each decade, of which every second spans the basis (the others lie in it to 1e-8); directions
# smaller than this share of the largest are left out
_PER_DECADE, _SPANNING, _KEPT = 40, 2, 1e-11


@dataclass(frozen=True)
class Hold:
    """One test, ready to be compared."""

    time_s: Array  # (n,) times, s, from the start of loading
    fine_s: Array  # (m,) times, s, with some between samples where the strain moves far
    at: NDArray[np.intp]  # (n,) where the samples are among them
    instantaneous: Array  # (m, K) columns of instantaneous second Piola-Kirchhoff stress there, strain piecewise linear
    push: Array  # (n,) push-forward to nominal stress
    stress_Pa: Array  # (n,) measured nominal stress, Pa
    precision: Array  # (n,) one over the standard deviation of the noise, 0 where nothing is compared
    held: NDArray[np.bool_]  # (n,) whether the strain is held
    shape: str  # where the columns come from: "law", "ramp" or "straight"; "step" where no ramp was recorded
    step: bool = False  # whether the strain is held from the first sample on
    last_ramp_s: float = 0.0  # duration of the motion that ends in the first hold, s

    @property
    def ramp_s(self) -> float:
        """Time from the start of loading to the first held sample, s."""
        return float(self.time_s[np.argmax(self.held)])

    @property
    def hold_s(self) -> float:
        """Length of the record from there on, s."""
        return float(self.time_s[-1]) - self.ramp_s


@dataclass(frozen=True)
class HoldTable:
    """One test on a short basis; inner products are those of the full weighted hold."""

    basis: Array  # (n_seen, r) orthonormal directions
    rest: Array  # (r, K) weighted columns without relaxation
    slow: CubicSpline  # ln tau -> (r, K) weighted D(tau)
    target: Array  # (r,) weighted measured stress
    more: Array  # (r, J) further weighted vectors that were given

    def unit(self, ln_tau: Array, share: Array) -> Array:
        """(W, r, K) weighted columns for (W, M) ln tau and g/g_inf, over their own long-term scale."""
        return self.rest + np.einsum("wm,wmrk->wrk", share, self.slow(ln_tau))


def hold_of(experiment: Experiment, law: Law | None, terms: int, held: NDArray[np.bool_] | None = None) -> Hold:
    """The test through the law's curve, or through that of its own ramp, which is then compared too; `held` (n,) marks
    the hold where it is known already. Raises ValueError for a test without clock or ramp, and for fewer points in the
    hold than `terms` need."""
    where = f"relaxation ({', '.join(experiment.source) or 'no file'})"
    e, t = experiment.strain, experiment.time_s
    if t is None:
        raise ValueError(f"{where}: a relaxation test needs a time column.")
    if held is None:
        held = (experiment.held > 0 if experiment.held is not None else
                np.asarray(np.maximum.accumulate(np.abs(e)) >= _HELD * np.abs(e).max()))
    modulus = any(name.startswith("table_") for name in experiment.facts)  # a table of moduli has no strain
    if np.count_nonzero(held) < 2 * terms + 3 or not (np.any(e) or modulus):
        raise ValueError(f"{where}: {np.count_nonzero(held)} points lie in the hold; {terms} terms need "
                         f"{2 * terms + 3}.")
    count = np.ones(t.size) if experiment.samples is None else experiment.samples
    noise = experiment.noise or 1e-3 * float(np.abs(experiment.value).max()) or 1.0
    step = bool(held[0])
    t = t - (min(t[0], 0.0) if step else t[loading_start(e)])
    fine_s, at = _refined(t, e) if np.any(e) else (t, np.arange(t.size))
    if step and t[0] > 0:
        fine_s, at = np.r_[0.0, fine_s], at + 1
    fine = np.interp(fine_s, t, e)
    still = np.zeros(fine_s.size, dtype=bool)
    still[at] = held
    still[0] |= step
    if modulus:
        columns, shape = np.ones((fine_s.size, 1)), "step"
    elif law is not None:
        columns, shape = of_law(law, fine, still), "law"
    elif held.all():
        columns, shape = fine[:, None], "step"
    else:
        columns, shaped = of_ramp(fine, still, at)
        shape = "ramp" if shaped else "straight"
    precision = np.where(held | ((shape == "ramp") & (e != 0)), np.sqrt(count) / noise, 0.0)
    return Hold(t, fine_s, at, columns, push_forward("uniaxial", e)[:, 0], experiment.value, precision, held, shape,
                step, _last_ramp_s(t, e, int(np.argmax(held))))


def _last_ramp_s(time_s: Array, strain: Array, end: int) -> float:
    """Duration of the motion that ends at a sample, back to where the strain rested or turned."""
    far, band = np.abs(strain[end] - strain[end::-1]), band_of(strain)
    most = np.maximum.accumulate(far)
    back = far < most - band
    most = most[:int(np.argmax(back)) if back.any() else most.size]
    return float(time_s[end] - time_s[end - int(np.argmax(most >= most[-1] - band))])


def _refined(time_s: Array, strain: Array) -> tuple[Array, NDArray[np.intp]]:
    """(m,) times with some between samples where the strain moves far, and (n,) where the samples are among them."""
    step = np.abs(np.diff(strain)) / (_FAR * np.abs(strain).max())
    more = np.where(np.diff(time_s) > 0, np.clip(np.ceil(step), 1, None), 1).astype(int)
    parts = [a + (b - a) * np.arange(k) / k for a, b, k in zip(time_s[:-1], time_s[1:], more, strict=True)]
    return np.concatenate([*parts, time_s[-1:]]), np.r_[0, np.cumsum(more)]


def tabulate_hold(hold: Hold, bounds_s: tuple[float, float], more: Array | None = None) -> HoldTable:
    """Table for times within `bounds_s`; `more` (n_seen, J) are further vectors that the basis must hold."""
    seen = hold.precision > 0
    weight = (hold.precision * hold.push)[seen]

    def slow(times_s: Array) -> Array:
        relaxing = decaying(Prony(np.zeros(times_s.size), times_s), hold.fine_s, hold.instantaneous)
        return weight[:, None] * relaxing[:, hold.at[seen]]

    return tabulated(weight[:, None] * hold.instantaneous[hold.at[seen]], slow,
                     (hold.precision * hold.stress_Pa)[seen], bounds_s, more)


def tabulated(rest: Array, slow: Callable[[Array], Array], target: Array, bounds_s: tuple[float, float],
              more: Array | None) -> HoldTable:
    """Table of weighted columns without relaxation (n, K), of those at (t,) times, s, (t, n, K), and of what was
    measured (n,), for times within `bounds_s`; `more` (n, J) are further vectors that the basis must hold."""
    more = np.zeros((target.size, 0)) if more is None else more
    low, high = np.log(bounds_s)
    times = np.linspace(low, high, int(np.ceil((high - low) / np.log(10) * _PER_DECADE)) + 4)
    columns = slow(np.exp(times))
    flat = columns[::_SPANNING].transpose(1, 0, 2).reshape(target.size, -1)
    basis = _spanning(np.column_stack([flat, rest, target, more]))
    return HoldTable(basis, basis.T @ rest, CubicSpline(times, np.einsum("nr,tnk->trk", basis, columns)),
                     basis.T @ target, basis.T @ more)


def doubted(experiment: Experiment) -> list[Experiment]:
    """The experiment with its contact point, and with its load drift, one standard deviation elsewhere."""
    facts, out = experiment.facts, []
    if shift := facts.get("strain_zero_sd", 0.0):
        out.append(replace(experiment, strain=np.where(experiment.strain == 0, 0.0, experiment.strain + shift)))
    if (drift := facts.get("drift_sd_N_per_s", 0.0)) and experiment.time_s is not None:
        out.append(replace(experiment, value=experiment.value + drift / (facts["area_mm2"] * 1e-6) * experiment.time_s))
    return out


def _spanning(columns: Array) -> Array:
    """(n, r) orthonormal directions that columns (n, m) span, each column taken at unit length."""
    size = np.linalg.norm(columns, axis=0)
    q, r = np.linalg.qr(columns / np.where(size > 0, size, 1.0))
    left, size, _ = np.linalg.svd(r, full_matrices=False)
    return np.asarray(q @ left[:, size > _KEPT * size[0]])
