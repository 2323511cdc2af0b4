"""The protocol of a learner: what every method of surrogates is fitted by, and what it returns for signals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol, Self

import numpy as np
from scipy.special import ndtr

from surrogate.data.samples import Samples
from surrogate.data.sensor_ring import Ring
from surrogate.statistics.mixture import interval
from touchcal.arrays import Array, Index, Mask

Progress = Callable[[Iterable[int]], Iterable[int]]
MOST_FACTOR, HALVINGS = 1024.0, 32  # of standard deviations that hold a truth, and of the range that it is sought in


@dataclass(frozen=True)
class Estimate:
    """Most probable outputs of some signals."""

    value: Array  # (n, outputs) values in the outputs' units
    sd: Array  # (n, outputs) standard deviations, model and noise together, before calibration
    # (n,) squared residual of the signal over what was expected; 1 for learners that do not model the signal
    misfit: Array
    # (n,) whether the touch lies among the trained ones; True for learners that only map signals to outputs
    inside: Mask
    # (n, outputs) one-sided standard deviations: distances of the value to the ends of the 90 % interval, in
    # those of the normal variable
    below: Array
    above: Array
    # (n,) whether the touch lies near one edge of an outline, where another part of the map, with errors of another
    # kind, reads it: these have interval factors of their own
    near_edge: Mask
    # (n,) part of the expected misfit that the model's own error makes; 1 for learners that do not model the signal
    map_part: Array
    left: Array  # (n, readings) whitened residual of the signal; no columns for learners that do not model it
    # (n, outputs) as below and above, as far as punches outside the training range that the signal allows; 0 for
    # learners that know of none
    past_below: Array
    past_above: Array
    other: Mask  # (n,) whether the signal asks for such a punch, none of the trained ones being likely
    # (n, outputs, profiles) by what punches of each profile multiply the value, and the relative standard deviations of
    # that; 1 and 0 for the trained profile, the first, and for learners that know of no other
    ratio: Array
    ratio_sd: Array
    parts: Parts | None = None  # what makes up sd, for learners that can tell

    def some(self, rows: Index) -> Estimate:
        """Those of some signals."""
        return _each(lambda found: found[0][rows], [self])

    def of_profile(self, factor: Array, of_normal: Array | float) -> tuple[Array, Array]:
        """Distances (n, outputs) of values to the ends of intervals of so many (n, outputs) standard deviations; of as
        many as a normal variable has, for punches outside the training range. Of punches of the trained profile."""
        return (np.maximum(self.below * factor, self.past_below * of_normal),
                np.maximum(self.above * factor, self.past_above * of_normal))

    def ends(self, factor: Array, of_normal: Array | float) -> tuple[Array, Array]:
        """As `of_profile`, where each of the profiles is as likely as any other; what the signal allows of punches
        outside the training range stays in the interval, whatever the others."""
        below, above = self.of_profile(factor, of_normal)
        open_ = np.any(self.ratio != 1, axis=(0, 2))
        if not open_.any():
            return below, above
        mode, own = (self.value[..., None] * self.ratio)[:, open_], (self.value[..., None] * self.ratio_sd)[:, open_]
        own = own * np.asarray(of_normal)[..., None]
        short, far = (np.hypot(side[..., open_, None] * self.ratio[:, open_], own) for side in (below, above))
        low, high = interval(mode, short, far, ndtr(-np.asarray(of_normal)))
        below[..., open_], above[..., open_] = self.value[:, open_] - low, high - self.value[:, open_]
        return np.maximum(below, self.past_below * of_normal), np.maximum(above, self.past_above * of_normal)

    def least_factor(self, truth: Array, of_normal: float) -> Array:
        """(n, outputs) the least factor whose interval, as `ends` gives it, holds the truth (n, outputs); at most
        MOST_FACTOR."""
        off = truth - self.value

        def held(factor: Array) -> Mask:
            below, above = self.ends(factor, of_normal)
            return np.where(off < 0, -off <= below, off <= above)

        low, high = np.zeros_like(off), np.full_like(off, MOST_FACTOR)
        high[held(low)] = 0.0
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            within = held(middle)
            low, high = np.where(within, low, middle), np.where(within, middle, high)
        return high


@dataclass(frozen=True)
class Parts:
    """Parts of standard deviations (n, outputs); their squares and that of the model's part add up to the whole."""

    noise: Array  # by noise alone, were map and material exact
    material: Array  # what not knowing the material adds

    def model(self, sd: Array) -> Array:
        """(n, outputs) the rest of sd: the map's own error, and what of the signal it does not explain."""
        return np.sqrt(np.maximum(sd**2 - self.noise**2 - self.material**2, 0.0))


def joined(found: Sequence[Estimate]) -> Estimate:
    """The estimates of one learner for some signals, then for more of them."""
    return _each(np.concatenate, found)


def _each(made: Callable[[list[Array]], Array], found: Sequence[Estimate]) -> Estimate:
    """What is made of each array of some estimates."""
    def of(several: Sequence[Any], kind: type[Any]) -> Any:
        return kind(**{one.name: made([getattr(part, one.name) for part in several])
                       for one in fields(kind) if one.name != "parts"})

    parts = [one.parts for one in found if one.parts is not None]
    return replace(of(found, Estimate), parts=of(parts, Parts) if parts else None)


def regression(value: Array, variance: Array) -> Estimate:
    """The estimate of a learner that only maps signals to outputs: values and variances (n, outputs)."""
    sd = np.sqrt(variance)
    none = np.zeros(len(value), bool)
    return Estimate(value, sd, np.ones(len(value)), ~none, sd, sd, none, np.ones(len(value)),
                    np.zeros((len(value), 0)), 0 * sd, 0 * sd, none, np.ones((*sd.shape, 1)), np.zeros((*sd.shape, 1)))


@dataclass(frozen=True)
class Training:
    """What a fit is asked for."""

    names: tuple[str, ...]  # names of the outputs, in the order of outputs.NAMES
    seed: int
    epochs: int  # steps of an iterated method; 0 for the others
    workers: int = 1  # processes that may share the outputs
    known_punches: bool = False  # whether touches are by the diameters that training rows share and no others
    each: Progress = iter  # may show progress over the outputs


class Learner(Protocol):
    """A fitted method: a frozen dataclass of arrays, numbers, dataclasses and tuples of these, which a model's file
    holds by the names of its fields. A method that subclasses it and stands in `surrogate.learners.registry` trains,
    stores, predicts and is scored as all others are.

    Examples
    --------
    A learner that returns the mean of its training rows:

    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> from surrogate.learners.base import Learner, regression
    >>> @dataclass(frozen=True)
    ... class Mean(Learner):
    ...     value: np.ndarray
    ...     variance: np.ndarray
    ...     @classmethod
    ...     def fit(cls, rows, training):
    ...         target = rows.targets(training.names)
    ...         return cls(target.mean(axis=0), target.var(axis=0))
    ...     def estimate(self, signal_V, noise_V):
    ...         return regression(np.tile(self.value, (len(signal_V), 1)), np.tile(self.variance, (len(signal_V), 1)))
    >>> Mean(np.array([1.0]), np.array([4.0])).estimate(np.zeros((2, 208)), 0.0).sd.ravel()
    array([2., 2.])
    """

    @classmethod
    def fit(cls, rows: Samples, training: Training) -> Self:
        """Fit the training rows; ValueError for data that the method cannot learn."""
        ...

    def estimate(self, signal_V: Array, noise_V: float) -> Estimate:
        """Outputs of signals (n, readings), V, under white noise of standard deviation noise_V."""
        ...

    def record(self, training: Training) -> dict[str, Any]:
        """How the training went, as JSON."""
        return {}

    def amplitude(self) -> dict[str, Any] | None:
        """The signal over force for each diameter, as `surrogate.forward_map.amplitude` gives it; None for methods
        without a map from touch to signal."""
        return None

    def branched(self, names: tuple[str, ...]) -> Mask:
        """(outputs,) whether an output takes one of a few values, or one signal may have several answers for it."""
        return np.zeros(len(names), bool)

    def reads(self, touch: Array) -> Mask:
        """(n,) whether touches (n, 4) at x, y, of d, mm, under F, N, are among those that the method can read."""
        return np.ones(len(touch), bool)

    def without(self, whole: Ring, ring: Ring, kept: Mask) -> Self | None:
        """The learner on the readings of a ring that are kept, a mask (readings,) of the whole one's; None of methods
        that need all, for which those that frames lack are filled in."""
        return None

    def drifting(self, root: Array) -> Learner:
        """The learner on frames between which the instrument drifted with the covariance root root' of the readings, of
        a root (readings, k), V; for methods that model the signal."""
        raise ValueError(f"{type(self).__name__} does not know drift of the instrument between the untouched and the "
                         "touched frame; `method` forward does.")
