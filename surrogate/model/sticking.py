"""Channels that stick: they read one value from some frame on, while most others change.

Where a channel kept its value in e of n steps from frame to frame before, at which most others changed, it does so in
the next r steps with probability ((e + 1) / (n + 2))^r, by Laplace's rule. It sticks where that is below BY_CHANCE.
"""

from dataclasses import dataclass, replace

import numpy as np

from touchcal.arrays import Array, Mask

BY_CHANCE = 1e-9
FEWEST = 5  # steps that must be known of a channel
CHANGING = 0.5  # part of the channels that change in a step that counts: else the whole frame may be repeated
MOST = 0.1  # part of the channels that may stick: of more, touches change few


@dataclass(frozen=True, eq=False)
class Runs:
    """How long each channel has kept its value, and how often it did before."""

    last: Array  # (m,) the latest frame; NaN before one
    kept: Array  # (m,) steps before the present run in which the channel kept its value
    steps: Array  # (m,) of how many
    run: Array  # (m,) steps since the value changed

    def sticking(self, most: float = MOST) -> Mask:
        """(m,) which channels stick; none where these are more than this part of all."""
        chance = self.run * np.log((self.kept + 1) / (self.steps + 2))
        found = (self.steps >= FEWEST) & (chance < np.log(BY_CHANCE))
        return found & (np.mean(found) <= most)


def begun(channels: int) -> Runs:
    """Nothing is known of so many channels."""
    return Runs(np.full(channels, np.nan), *np.zeros((3, channels)))


def followed(runs: Runs, frame: Array) -> Runs:
    """With one more frame (m,); NaN is a dead channel, of which nothing is learnt."""
    same = frame == runs.last
    changed = np.isfinite(frame) & np.isfinite(runs.last) & ~same
    if np.mean(changed) < CHANGING:
        same = np.zeros_like(same)
    ended = np.where(changed, runs.run, 0.0)
    return Runs(frame, runs.kept + ended, runs.steps + ended + changed,
                np.where(changed, 0.0, runs.run + same))


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
