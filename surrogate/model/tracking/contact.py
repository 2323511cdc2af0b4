"""Whether something touches: a test between a touch of a known pattern and a drift of the untouched frame.

A frame is off the untouched one by s. Nothing touches: s is noise and what the untouched frame may have drifted, of
covariance C. Something does: s is a u_k more, u_k one of some patterns, its size a > 0 unknown. Both know C but for
a factor from 1 on, which is each hypothesis' own: a drift that was never seen is large and no touch explains it, a
touch that no pattern quite is still explains most of its frame. With e = s' C^-1 s of n readings, and T the largest
squared part of it along a pattern, the log likelihood ratio is l(e - T) - l(e), l(e) = -e/2 to e = n and
-n/2 (1 + log(e/n)) above. The PARAMETERS of a touch cost half of log n each (Schwarz, Ann. Stat. 6 (1978) 461, DOI
10.1214/aos/1176344136). The state before speaks by the odds that it stayed, so that what is in doubt stays as it is: at
50 frames a second of 208 readings a touch is believed from 5.4 standard deviations along its pattern on in each of two
frames. That is more caution than noise asks: of touches of 0.02 N at 80 dB, 4.6 to 9.1 standard deviations, 26 of 40
were found within two frames, where one known beforehand is found in 99 % with one false touch in 50,000 frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from surrogate.data.reading_noise import ReadingNoise, whitening
from surrogate.data.untouched_stream import Background, error_after, principal, surprising
from surrogate.forward_map.inversion import reading_covariance
from touchcal.arrays import Array, Mask

PARAMETERS = 4  # of a touch: x, y, d, F
CHANGES = 1.0  # presses and lifts a second, as many as are expected before any frame
# Log odds from which a change is believed at once, and frames in a row that must agree on one otherwise.
SURELY, FRAMES = float(np.log(99.0)), 2
MEMORY = 200  # frames that the untouched mean is taken over
LEAST = 5.0  # untouched mean of T, at least: of some independent patterns under white noise


@dataclass(frozen=True, eq=False)
class Contact:
    """Whether something touches, after some frames."""

    patterns: Array  # (k, readings) unit patterns of touches
    least: float  # variance of a signal, at least: as good as noise-free frames are believed
    usual: float = LEAST  # mean of T of untouched frames: noise may have more along patterns than white noise has
    touched: bool = False
    against: int = 0  # latest frames in a row that speak against that
    strange: bool = False  # whether nothing that is known explains the latest frame, no touch either
    # (readings, readings) what makes noise of one frame white, of the same r.m.s.; None where it is taken for white
    whitening: Array | None = None
    mirrored: bool = False  # whether a touch of the other sign does


def with_noise(contact: Contact, noise: ReadingNoise, variance: float) -> Contact:
    """With noise that readings share, where that of one reading has this variance, V^2."""
    return replace(contact, whitening=whitening(noise) * (np.sqrt(variance) / noise.white_V))


def patterns_of(signal: Array) -> Array:
    """(n, readings) unit patterns of signals (n, readings)."""
    return signal / np.linalg.norm(signal, axis=1, keepdims=True)


def met(contact: Contact, signal: Array, there: Mask, background: Background, since_s: float, step_s: float) -> Contact:
    """With one more frame of this signal (readings,), of the channels that are there, so long after the latest
    untouched frame and after the latest one."""
    count = int(there.sum())
    energy, along, mirrored = (LEAST / contact.usual * one for one in
                               _whitened(contact, signal[there], there, background, since_s))
    stays = np.log(1 / min(max(CHANGES * step_s, np.finfo(float).eps), 0.5) - 1)
    odds = _log_ratio(energy, along, count) + (stays if contact.touched else -stays)
    speaks = odds < 0 if contact.touched else odds > 0
    against = contact.against + 1 if speaks else 0
    changed = against >= FRAMES or (speaks and abs(odds) > SURELY)
    touched = contact.touched ^ changed
    untouched = not (touched or (against and not changed))
    strange = untouched and energy > surprising(count)
    usual = contact.usual
    if untouched and not strange:
        usual = max(usual + (along * usual / LEAST - usual) / MEMORY, LEAST)
    return replace(contact, touched=touched, against=0 if changed else against, usual=usual, strange=strange,
                   mirrored=strange and _log_ratio(energy, mirrored, count) > SURELY)


def _whitened(contact: Contact, signal: Array, there: Mask, background: Background, since_s: float
              ) -> tuple[float, float, float]:
    """e, T, and T of touches of the other sign."""
    variance, root = error_after(background, since_s)
    white = np.sqrt(max(background.noise + variance, contact.least))
    turned = np.eye(len(signal)) if contact.whitening is None else contact.whitening[np.ix_(there, there)]
    size, axes = principal(root[:, there] @ turned)
    known = reading_covariance.white(np.array([white]), reading_covariance.Drift(axes.T, size))
    columns = turned @ np.column_stack([signal, contact.patterns[:, there].T])
    both = reading_covariance.whitened(known, columns[None])[0]
    off, patterns = both[:, 0], both[:, 1:]
    along = off @ patterns / np.maximum(np.linalg.norm(patterns, axis=0), np.finfo(float).tiny)
    return float(off @ off), max(float(along.max()), 0.0) ** 2, min(float(along.min()), 0.0) ** 2


def _log_ratio(energy: float, along: float, count: int) -> float:
    def likelihood(left: float) -> float:
        return -left / 2 if left <= count else -count / 2 * (1 + np.log(left / count))

    return likelihood(energy - along) - likelihood(energy) - PARAMETERS / 2 * np.log(count)
