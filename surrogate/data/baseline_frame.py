"""The untouched frame: its noise, whether it is that of the trained sensor, and the factors that make it so.

With V0 the readings of the training's untouched sensor and V those measured, chi^2 = sum ((V - V0)/s)^2 of n readings
says whether they differ by more than noise. Where they do, explanations V = f(V0) of k numbers compete by
chi^2 + k ln n (Schwarz, Ann. Stat. 6 (1978) 461, DOI 10.1214/aos/1176344136).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from surrogate.data.reading_noise import ReadingNoise, noise_of
from surrogate.data.sensor_ring import Ring
from touchcal.arrays import Array, Index, Mask
from touchcal.number_words import significant

# Relative difference of the untouched frame from that of the training, 2-norm, from which it is not of the same sensor.
OTHER_BASELINE = 0.2
SAME = 0.05  # difference, likewise, up to which a scaled or a sorted frame is taken for the training's
SCALINGS = ("auto", "yes", "no")
# Relative error of the simulated readings and its share of their r.m.s. below which none counts as different, and the
# probability of chi^2 from which the frame is that of the training.
_SIMULATED, _LEAST, _CHANCE = 1e-3, 1e-2, 1e-3
_PLAUSIBLE = 2.0  # largest factor of a reading by which frames are scaled unasked


@dataclass(frozen=True)
class Untouched:
    """The frame that signals are differences to."""

    volts: Array  # (readings,) V
    noise: ReadingNoise | None  # of a touched frame minus this one; None where one frame cannot tell

    @property
    def noise_V(self) -> float | None:
        """Its standard deviation of a reading, r.m.s., V."""
        return None if self.noise is None else self.noise.rms_V


@dataclass(frozen=True)
class Comparison:
    """What an untouched frame is next to that of the training."""

    gain: Array  # (readings,) factors by which all readings are to be multiplied: V0 over those measured, or 1
    words: str  # what differs, what fits and what is done about it; empty where the frame is the training's


@dataclass(frozen=True)
class _Explanation:
    words: str
    volts: Array  # (readings,) V, the training's as this explains them
    parameters: int
    scales: bool = False  # whether factors of the readings are what differs


def untouched(volts: Array, ring: Ring | None = None) -> Untouched:
    """The mean of untouched frames (n, readings), V, of a ring where it is known, and the noise by their scatter where
    there are two or more."""
    noise = noise_of(volts, ring)
    return Untouched(volts.mean(axis=0), None if noise is None else noise.times(float(np.sqrt(1 + 1 / len(volts)))))


def compared(trained_V: Array, ring: Ring, given_V: Array, noise_V: float = 0.0, scaling: str = "auto") -> Comparison:
    """An untouched frame (readings,), V, whose readings have this noise, next to the training's of a ring.

    scaling: whether readings are to be multiplied by V0 over those measured: "no", "yes", or "auto", where factors of
    readings are what fits and none exceeds _PLAUSIBLE. ValueError for another word, or a reading of 0 V to be scaled.
    """
    if scaling not in SCALINGS:
        raise ValueError(f"scaling of the untouched frame '{scaling}' is unknown; known: {', '.join(SCALINGS)}.")
    finite = np.isfinite(given_V)
    trained, given, n = trained_V[finite], given_V[finite], int(finite.sum())
    sd = np.hypot(noise_V, _SIMULATED * np.hypot(trained, _LEAST * np.sqrt(np.mean(trained**2))))
    chi2 = float(np.sum(((given - trained) / sd) ** 2))
    differs = bool(chdtrc(n, chi2) < _CHANCE)
    gain = np.ones(len(trained_V))
    if not differs and scaling != "yes":
        return Comparison(gain, "")
    best = _likeliest(trained, _kept(ring, finite), given, sd)
    if scaling == "yes" and not np.all(given):
        raise ValueError("an untouched reading is 0 V, which no factor makes the training's. Fix the channel, or do "
                         "not scale.")
    with np.errstate(divide="ignore"):
        factor = trained / given
    plausible = bool(np.all((factor > 1 / _PLAUSIBLE) & (factor < _PLAUSIBLE)))
    scaled = scaling == "yes" or (scaling == "auto" and best.scales and plausible)
    if scaled:
        gain[finite] = factor
    off = significant(100 * relative_difference(given, trained), 3)
    said = (f"the untouched frame differs by {off} % from that of the training (chi-square "
            f"{significant(chi2 / n, 3)} a reading): {best.words} ") if differs else ""
    if scaled:
        said += (f"All readings are multiplied by the training's over those measured ({factor.min():.4g} to "
                 f"{factor.max():.4g}), which takes out gains and the sheet's conductance.")
    elif best.scales:
        said += "Scaling the readings by the training's over those measured would take it out" + (
            ", but factors above 2 are scaled only when asked for." if scaling == "auto" else ".")
    else:
        said += "Intervals do not count such a difference."
    return Comparison(gain, said)


def _kept(ring: Ring, finite: Mask) -> Ring:
    return replace(ring, **{name: getattr(ring, name)[finite] for name in ("source", "sink", "read", "ground")})


def _likeliest(trained: Array, ring: Ring, given: Array, sd: Array) -> _Explanation:
    """The explanation of least chi^2 + k ln n; where no few numbers explain it, factors of the single readings if they
    are plausible, else another order, else none."""
    n, tried = len(trained), list(_explanations(trained, ring, given, sd))
    best = min(tried, key=lambda one: np.sum(((given - one.volts) / sd) ** 2) + one.parameters * np.log(n))
    if chdtrc(n, float(np.sum(((given - best.volts) / sd) ** 2))) >= _CHANCE:
        return best
    nearest = min(tried, key=lambda one: relative_difference(given, one.volts))
    if relative_difference(given, nearest.volts) < SAME and (
            nearest.scales is False or relative_difference(given, trained) > SAME):
        return nearest
    if relative_difference(given, trained) < OTHER_BASELINE and np.all(given * trained > 0):
        return _Explanation("no one factor, channel or order explains it; gains of single readings, the sheet or the "
                            "electrodes do.", given, n, True)
    if relative_difference(np.sort(given), np.sort(trained)) < SAME:
        return _Explanation("it holds the same voltages in another order. Are electrodes, patterns or columns mixed "
                            "up?", given, n)
    return _Explanation("is it untouched, of this sensor and drive, and in volts?", given, n)


def _explanations(trained: Array, ring: Ring, given: Array, sd: Array) -> Iterator[_Explanation]:
    """What may have become of the training's readings, as far as few numbers say it."""
    def factor(rows: Mask) -> float:
        return float((given[rows] / sd[rows]) @ (trained[rows] / sd[rows]) / np.sum((trained[rows] / sd[rows]) ** 2))

    scale = factor(np.ones(len(trained), bool))
    words = f"all readings are {scale:.4g} times those: a gain, the current, or the sheet's conductance."
    if not 0.5 < scale < 2:
        words = (f"its readings are {significant(scale, 3)} times the training's. Are they in volts, and is the "
                 "current that of the training?")
    if -2 < scale < -0.5:
        words = "it has the other sign. Are the leads of the current or of the voltmeter exchanged?"
    yield _Explanation(words, scale * trained, 1, scale > 0)
    pairs = np.sort(np.column_stack([ring.read, ring.ground]), axis=1)
    names, channel = np.unique(pairs, axis=0, return_inverse=True)
    channel, alone = np.asarray(channel).ravel(), np.arange(len(trained))
    gains = np.array([factor(channel == k) for k in range(len(names))])
    for which, what in ((channel, "between electrodes {} and {} (from 0)"), (alone, "of reading {} alone (from 0)")):
        missed = [np.sum((((given - trained) / sd)[which == k]) ** 2) for k in range(which.max() + 1)]
        worst = int(np.argmax(missed))
        one = np.where(which == worst, factor(which == worst) * trained, trained)
        place = what.format(*names[worst]) if which is channel else what.format(worst)
        yield _Explanation(f"the voltage {place} is {factor(which == worst):.4g} times that, and no other differs. "
                           "Check that channel.", one, 2, bool(factor(which == worst) > 0))
    yield _Explanation(f"the channels have gains of their own, {gains.min():.4g} to {gains.max():.4g} times those of "
                       "the training.", gains[channel] * trained, len(gains), bool(np.all(gains > 0)))
    count = len(ring.angle_rad)
    for way, words in ((1, "electrodes are numbered from another one, {} further on"),
                       (-1, "electrodes are numbered the other way round, from electrode {} on")):
        for turn in range(count):
            moved = _renumbered(trained, ring, (way * np.arange(count) + turn) % count)
            if moved is not None:
                yield _Explanation(f"{words.format(turn)}. Number them as in the training.", moved, 2)


def _renumbered(trained: Array, ring: Ring, to: Index) -> Array | None:
    """The training's readings where electrode i is the one that it calls to[i]; None where one is not among them."""
    place = {(*ends[:2], *ends[2:]): k for k, ends in enumerate(
        np.column_stack([ring.source, ring.sink, ring.read, ring.ground]).tolist())}
    out = np.empty_like(trained)
    for k, (a, b, c, d) in enumerate(to[np.column_stack([ring.source, ring.sink, ring.read, ring.ground])].tolist()):
        for sign, ends in ((1, (a, b, c, d)), (1, (b, a, d, c)), (-1, (b, a, c, d)), (-1, (a, b, d, c))):
            if ends in place:
                out[k] = sign * trained[place[ends]]
                break
        else:
            return None
    return out


def relative_difference(given: Array, trained: Array) -> float:
    """2-norm of the difference of frames (readings,), V, over that of the trained one."""
    return float(np.linalg.norm(given - trained) / np.linalg.norm(trained))
