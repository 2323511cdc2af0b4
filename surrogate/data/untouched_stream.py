"""The untouched frame of a stream, its noise and its drift, learnt from frames while nothing touches.

Each reading is a random walk read with noise: y_k = b_k + n_k, b_k+1 = b_k + w_k. One variance of noise, r^2, serves
all readings. The walk goes along the directions in which means of blocks of frames were seen to move, with touches
between them or not, less what noise alone moves them by.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from touchcal.arrays import Array

# Least frames and seconds of a block, movements that tell the drift, and frames that calibration takes where the noise
# is not stated.
BLOCK, BLOCK_S, MOVEMENTS, CALIBRATION = 20, 0.4, 8, 20
MEMORY = 1000.0  # frames that the noise is averaged over, at most
LEAST_GAIN = 1 / 500  # of the frame in the untouched one: a drift that begins late is followed all the same


@dataclass(frozen=True, eq=False)
class Background:
    """What is known of the untouched sensor after some frames."""

    volts: Array  # (readings,) the untouched frame
    variance: float  # of its error, a reading
    noise: float  # variance r^2 of one reading; NaN before two frames
    frames: float  # that the noise was averaged over
    time_s: float  # of the latest untouched frame
    last: Array | None  # (readings,) that frame, where no touch came after it
    # (k, readings) movements of the untouched frame in a second, so that its variance grows by root' root in one
    root: Array
    moved: tuple[Array, ...] = ()  # latest movements of the means of blocks, over the root of their time
    block: tuple[Array, ...] = field(default=(), repr=False)  # frames of the block that is being filled
    begun_s: float = 0.0  # time of its first frame
    before: Array | None = None  # mean of the block before
    ended_s: float = 0.0  # time of the last frame of that

    @property
    def noise_V(self) -> float:
        """Standard deviation of one reading."""
        return float(np.sqrt(self.noise))


def known(volts: Array, noise_V: float, frames: float, time_s: float) -> Background:
    """From an untouched frame (readings,) that is the mean of `frames`, infinite for one without error, and a stated
    noise of one reading."""
    return Background(volts, noise_V**2 / frames, noise_V**2, float(np.clip(frames, CALIBRATION, MEMORY)), time_s, None,
                      np.zeros((0, len(volts))))


def begun(volts: Array, time_s: float) -> Background:
    """From a first untouched frame (readings,) of unknown noise."""
    return Background(volts, 0.0, np.nan, 0.0, time_s, volts, np.zeros((0, len(volts))))


def followed(of: Background, volts: Array, time_s: float) -> Background:
    """With one more untouched frame (readings,); NaN is a dead channel, which tells nothing."""
    there = np.isfinite(volts) & np.isfinite(of.volts)
    volts = np.where(there, volts, of.volts)
    step_s = max(time_s - of.time_s, 0.0)
    walked = float(np.sum(of.root**2)) / len(volts) * step_s
    noise, frames = of.noise, of.frames
    if of.last is not None:
        scatter = max(float(np.mean((volts - of.last)[there] ** 2)) - walked, 0.0) / 2
        frames = min(frames + 1, MEMORY)
        noise = scatter if np.isnan(noise) else noise + (scatter - noise) / frames
    # a first frame that is alone is as uncertain as one reading
    variance = (noise if of.frames == 0 else of.variance) + walked
    gain = max(variance / max(variance + noise, np.finfo(float).tiny), LEAST_GAIN)
    better = replace(of, volts=of.volts + gain * (volts - of.volts), noise=noise, frames=frames, time_s=time_s,
                     last=volts, variance=(1 - gain) ** 2 * variance + gain**2 * noise)
    return _with_block(better, volts)


def scaled(of: Background, gain: Array) -> Background:
    """With all readings multiplied by factors (readings,), what movements of it were seen forgotten."""
    square = float(np.mean(gain**2))
    return replace(interrupted(of), before=None, volts=of.volts * gain, variance=of.variance * square,
                   noise=of.noise * square)


def interrupted(of: Background) -> Background:
    """With a touch after the latest untouched frame."""
    return replace(of, last=None, block=())


def _with_block(of: Background, volts: Array) -> Background:
    block, begun_s = (*of.block, volts), of.begun_s if of.block else of.time_s
    length_s = of.time_s - begun_s
    if len(block) < BLOCK or length_s < BLOCK_S:
        return replace(of, block=block, begun_s=begun_s)
    mean, ended = np.nan_to_num(np.mean(block, axis=0)), replace(of, block=(), ended_s=of.time_s)
    if of.before is None:
        return replace(ended, before=mean)
    # variance that a random walk gains from the mean of one block to that of another, over that of a second
    walked_s = begun_s - of.ended_s + 2 / 3 * length_s
    moved = (*of.moved, (mean - of.before) / np.sqrt(walked_s))[-MOVEMENTS:]
    return replace(ended, before=mean, moved=moved,
                   root=_without_noise(np.array(moved), 2 * of.noise / len(block) / walked_s))


def _without_noise(moved: Array, noise: float) -> Array:
    """Root (k, readings) of the covariance of movements (k, readings), those along which noise of this variance a
    reading may have moved alone left out."""
    _, size, axes = np.linalg.svd(moved, full_matrices=False)
    # largest singular value of k rows of noise; neighbouring ones share a mean, so that some sum has twice the variance
    edge = np.sqrt(2 * noise) * (np.sqrt(moved.shape[1]) + np.sqrt(len(moved)))
    kept = size > 1.1 * edge
    return np.sqrt(np.maximum(size[kept] ** 2 - edge**2, 0.0) / len(moved))[:, None] * axes[kept]
