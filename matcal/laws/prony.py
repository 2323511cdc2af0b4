"""Prony series of the relaxing stress: G(t)/G_0 = 1 - sum_i g_i (1 - exp(-t/tau_i))."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from touchcal.arrays import Array


@dataclass(frozen=True)
class Prony:
    """Relaxing fractions and their times; with nu = 0 the whole stress relaxes (paper, equation 5)."""

    g: Array  # (M,) fractions, each >= 0, sum < 1
    tau_s: Array  # (M,) times, s, positive, increasing

    def __post_init__(self) -> None:
        for name in ("g", "tau_s"):
            value = np.array(getattr(self, name), dtype=float, ndmin=1)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        if self.g.shape != self.tau_s.shape or self.g.ndim != 1:
            raise ValueError(f"prony: g and tau_s must have one length, got {self.g.size} and {self.tau_s.size}.")
        if not (np.all(self.g >= 0) and self.g.sum() < 1):
            raise ValueError(f"prony: every g must be >= 0 and their sum below 1, got {self.g.tolist()}.")
        if not (np.all(np.isfinite(self.tau_s)) and np.all(self.tau_s > 0) and np.all(np.diff(self.tau_s) > 0)):
            raise ValueError(f"prony: tau_s must be positive and increasing, got {self.tau_s.tolist()}.")

    @property
    def g_infinity(self) -> float:
        """Long-term over instantaneous modulus, 1 - sum g_i."""
        return float(1 - self.g.sum())


def relaxation(law: Prony, time_s: ArrayLike) -> Array:
    """G(t)/G_0 at times t >= 0 (any shape), s, after an ideal step."""
    t = np.asarray(time_s, dtype=float)
    if np.any(t < 0):
        raise ValueError("relaxation: times must be >= 0 s.")
    return 1 + np.sum(law.g * np.expm1(-t[..., None] / law.tau_s), axis=-1)


def dynamic(law: Prony, omega_rad_per_s: ArrayLike) -> Array:
    """Complex modulus over G_0, g_inf + sum g_i i w tau_i/(1 + i w tau_i), at angular frequencies w (any shape)."""
    turn = 1j * np.asarray(omega_rad_per_s, dtype=float)[..., None] * law.tau_s
    return np.asarray(law.g_infinity + np.sum(law.g * turn / (1 + turn), axis=-1))


def convolve(law: Prony, time_s: ArrayLike, instantaneous: ArrayLike) -> Array:
    """Hereditary stress S(t) = int G(t-s)/G_0 dS_0(s) of an instantaneous history S_0 (n, ...) at times (n,), s.

    S_0 is taken as linear between samples, for which the recursion is exact at any step; it starts from rest, so
    a first value other than zero is a step at the first time. Applied to second Piola-Kirchhoff components it is
    objective (Fung 1993, Biomechanics, 7.13; Simo 1987, DOI 10.1016/0045-7825(87)90107-1).
    """
    t = np.asarray(time_s, dtype=float)
    s0 = np.asarray(instantaneous, dtype=float)
    if t.ndim != 1 or s0.shape[:1] != t.shape:
        raise ValueError(f"convolve: {t.shape} times do not match a history of shape {s0.shape}.")
    step = np.diff(t)
    if np.any(step < 0):
        raise ValueError("convolve: times must not decrease.")
    return law.g_infinity * s0 + np.tensordot(law.g, _recursion(law.tau_s, step, s0), axes=1)


def decaying(law: Prony, time_s: ArrayLike, instantaneous: ArrayLike) -> Array:
    """int exp(-(t-s)/tau_i) dS_0(s) of each term, (M, n, ...), as in `convolve`; the fractions do not matter."""
    return _recursion(law.tau_s, np.diff(np.asarray(time_s, dtype=float)), np.asarray(instantaneous, dtype=float))


def _recursion(tau_s: Array, step: Array, s0: Array) -> Array:
    z = step[:, None] / tau_s
    decay = np.exp(-z)
    weight = np.where(z > 0, -np.expm1(-z) / np.where(z > 0, z, 1.0), 1.0)
    rise = np.diff(s0, axis=0)
    shape = (-1,) + (1,) * (s0.ndim - 1)
    h = np.empty((tau_s.size, *s0.shape))
    h[:, 0] = s0[0]
    for n in range(step.size):
        h[:, n + 1] = decay[n].reshape(shape) * h[:, n] + weight[n].reshape(shape) * rise[n]
    return h
