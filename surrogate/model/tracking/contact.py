"""Whether something touches: the likelihood ratio of a touch of a known pattern against nothing.

A touch adds a u_k, u_k one of some unit patterns and a its unknown size. Twice the log of its likelihood ratio against
an untouched sensor, maximised over a and k, is T = max_k (u_k . s)^2 / v_k, v_k the variance of noise and drift along
u_k. It is compared with its mean over untouched frames, which also holds what noise has that is not white.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.untouched_stream import Background
from touchcal.arrays import Array

# T over its untouched mean from which a frame touches, from which it does so whatever the one before it, and how many
# frames in a row must agree on a change.
TOUCHED, SURELY, FRAMES = 4.0, 8.0, 2
MEMORY = 200  # frames that the untouched mean is taken over
LEAST = 5.0  # untouched mean of T, at least: of some independent patterns under white noise


@dataclass(frozen=True, eq=False)
class Contact:
    """Whether something touches, after some frames."""

    patterns: Array  # (k, readings) unit patterns of touches
    least: float  # variance of a signal, at least: as good as noise-free frames are believed
    usual: float = LEAST  # mean of T of untouched frames
    touched: bool = False
    against: int = 0  # latest frames in a row that speak against that
    ratio: float = 0.0  # T of the latest frame over its untouched mean


def patterns_of(signal: Array) -> Array:
    """(n, readings) unit patterns of signals (n, readings)."""
    return signal / np.linalg.norm(signal, axis=1, keepdims=True)


def met(contact: Contact, signal: Array, background: Background, since_s: float) -> Contact:
    """With one more frame of this signal (readings,), so long after the latest untouched one."""
    drift = np.sum((contact.patterns @ background.root.T) ** 2, axis=1) * since_s
    variance = np.maximum(background.noise + background.variance + drift, contact.least)
    tested = float(np.max((contact.patterns @ signal) ** 2 / variance))
    ratio = tested / contact.usual
    if contact.touched:
        against = contact.against + 1 if ratio < TOUCHED else 0
        return replace(contact, ratio=ratio, touched=against < FRAMES, against=against % FRAMES)
    against = contact.against + 1 if ratio > TOUCHED else 0
    touched = against >= FRAMES or ratio > SURELY
    usual = contact.usual if against else max(contact.usual + (tested - contact.usual) / MEMORY, LEAST)
    return replace(contact, ratio=ratio, touched=touched, against=0 if touched else against, usual=usual)
