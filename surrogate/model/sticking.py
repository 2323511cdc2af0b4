"""Channels that stick: they read one value from some frame on, or from the first, while most others change.

Where a channel kept its value in e of n steps from frame to frame before, at which most others changed, it does so in
the next r steps with probability ((e + 1) / (n + 2))^r, by Laplace's rule; of a channel that has hardly changed yet,
this probability of a step is that which nine in ten others have at most. It sticks where the product is below
BY_CHANCE. Steps are not independent where values are coarse: a channel may rest until a touch comes near. So the run
must also be LONGER times the longest one before, of this channel and of nine in ten others.
"""

from dataclasses import dataclass, replace

import numpy as np

from touchcal.arrays import Array, Mask

BY_CHANCE = 1e-9
FEWEST = 5  # steps that say how often a channel changes
CHANGING = 0.5  # part of the channels that change in a step that counts: else the whole frame may be repeated
MOST = 0.1  # part of the channels that may stick: of more, touches change few
LONGER = 5  # times the longest run before, in frames


@dataclass(frozen=True, eq=False)
class Runs:
    """How long each channel has kept its value, and how often it did before."""

    last: Array  # (m,) the latest frame; NaN before one
    kept: Array  # (m,) steps before the present run in which the channel kept its value
    steps: Array  # (m,) of how many
    run: Array  # (m,) steps since the value changed
    longest: Array  # (m,) of the runs before

    def sticking(self, most: float = MOST) -> Mask:
        """(m,) which channels stick; none where these are more than this part of all."""
        step, known, long = (self.kept + 1) / (self.steps + 2), self.steps >= FEWEST, self.run >= LONGER
        if not (known.any() and long.any()):
            return np.zeros_like(long)
        step = np.where(known, step, np.quantile(step[known], 1 - MOST))
        longest = np.maximum(self.longest, np.quantile(self.longest, 1 - MOST))
        found = (self.run * np.log(step) < np.log(BY_CHANCE)) & (self.run >= LONGER * (longest + 1))
        return found & (np.mean(found) <= most)


def begun(channels: int) -> Runs:
    """Nothing is known of so many channels."""
    return Runs(np.full(channels, np.nan), *np.zeros((4, channels)))


def followed(runs: Runs, frame: Array) -> Runs:
    """With one more frame (m,); NaN is a dead channel, of which nothing is learnt."""
    same = frame == runs.last
    changed = np.isfinite(frame) & np.isfinite(runs.last) & ~same
    if np.mean(changed) < CHANGING:
        same = np.zeros_like(same)
    ended = np.where(changed, runs.run, 0.0)
    return Runs(frame, runs.kept + ended, runs.steps + ended + changed,
                np.where(changed, 0.0, runs.run + same), np.maximum(runs.longest, ended))


def off(frames: Array, most: float = MOST, before: Runs | None = None) -> Array:
    """Frames (n, m) in time order, NaN where a channel sticks to the end. before: what is known of the channels,
    nothing where left out."""
    runs = begun(frames.shape[1]) if before is None else before
    for frame in frames:
        runs = followed(runs, frame)
    stuck = runs.sticking(most)
    if not stuck.any():
        return frames
    same = np.cumsum((frames != runs.last)[::-1], axis=0)[::-1] == 0
    return np.where(same & stuck, np.nan, frames)


def usual(value: Array) -> Runs:
    """What readings (k, m) at other times say of channels: how often one has its commonest value."""
    common = np.array([np.unique(one, return_counts=True)[1].max() for one in value.T], float)
    return replace(begun(value.shape[1]), kept=common - 1, steps=np.full(value.shape[1], float(len(value))))
