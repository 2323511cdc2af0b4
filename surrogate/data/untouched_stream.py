"""The untouched frame of a stream, its noise and its drift, learnt from frames while nothing touches.

The frame walks and is read with noise, y_k = b_k + n_k, b_k+1 = b_k + w_k: a Kalman filter whose covariance is
v I + spread' spread. One variance of noise, r^2, serves all readings; the walk is that of `baseline_walk`. An
untouched frame that is off by more than the filter holds possible, by chi^2, is a walk that is not known yet: the
covariance grows to what is seen. One that is off by far more jumps, as of a frame that was cut or another current: it
tells neither noise nor walk.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtri

from surrogate.data.baseline_walk import LEAST_NOISE, Block, Walk, still, walk_of
from touchcal.arrays import Array

# Least frames and seconds of a block, frames of one that a touch ends, blocks that tell the walk, and frames that
# calibration takes where the noise is not stated.
BLOCK, BLOCK_S, LEAST_BLOCK, BLOCKS, CALIBRATION = 10, 0.15, 4, 40, 20
MEMORY = 1000.0  # frames that the noise is averaged over, at most
SCATTERS = 5  # frames whose median scatter tells the noise, so that one that is cut or jumps does not
LEAST_GAIN = 1 / 500  # of the frame in the untouched one: a drift that begins late is followed all the same
CHANCE = 1e-5  # of a chi^2 of a frame that noise and the known walk are not believed to give
JUMP = 5.0  # standard deviations, r.m.s., by which a frame jumps from the one before: these tell no walk
NULL = 1e-9  # part of the largest variance below which one is none
NOTHING = 1e-2  # part of the variance of a reading below which that of a direction is none


@dataclass(frozen=True, eq=False)
class Background:
    """What is known of the untouched sensor after some frames."""

    volts: Array  # (readings,) the untouched frame
    variance: float  # v of its error, a reading
    spread: Array  # (k, readings) root of the rest of the covariance of its error
    noise: float  # variance r^2 of one reading; NaN before two frames
    frames: float  # that the noise was averaged over
    time_s: float  # of the latest untouched frame
    last: Array | None  # (readings,) that frame, where no touch came after it
    walk: Walk
    foreseen: Array  # (k, readings) changes of it by causes that may drift
    blocks: tuple[Block, ...] = field(default=(), repr=False)  # the latest
    block: tuple[Array, ...] = field(default=(), repr=False)  # frames of the one that is being filled
    begun_s: float = 0.0  # time of its first frame
    scatter: tuple[float, ...] = ()  # r^2 by the latest frames, each and the one before

    @property
    def noise_V(self) -> float:
        """Standard deviation of one reading."""
        return float(np.sqrt(self.noise))


def known(volts: Array, noise_V: float, frames: float, time_s: float, foreseen: Array | None = None) -> Background:
    """From an untouched frame (readings,) that is the mean of `frames`, infinite for one without error, and a stated
    noise of one reading; foreseen are changes (k, readings) of it by causes that may drift."""
    none = np.zeros((0, len(volts)))
    return Background(volts, noise_V**2 / frames, none, noise_V**2, float(np.clip(frames, CALIBRATION, MEMORY)),
                      time_s, None, still(len(volts)), none if foreseen is None else foreseen)


def begun(volts: Array, time_s: float, foreseen: Array | None = None) -> Background:
    """From a first untouched frame (readings,) of unknown noise."""
    none = np.zeros((0, len(volts)))
    return Background(volts, 0.0, none, np.nan, 0.0, time_s, volts, still(len(volts)),
                      none if foreseen is None else foreseen, block=(volts,), begun_s=time_s)


def error_after(of: Background, since_s: float) -> tuple[float, Array]:
    """Covariance v I + root' root of the error of the untouched frame so long after it was seen: v, and the root (k,
    readings)."""
    return (of.variance + of.walk.rest * since_s,
            np.concatenate([of.spread, of.walk.root * np.sqrt(since_s)]))


def followed(of: Background, volts: Array, time_s: float) -> Background:
    """With one more untouched frame (readings,); NaN is a dead channel, which tells nothing."""
    there = np.isfinite(volts) & np.isfinite(of.volts)
    volts = np.where(there, volts, of.volts)
    step_s = max(time_s - of.time_s, 0.0)
    noise, frames, scatter = of.noise, of.frames, of.scatter
    if of.last is not None:
        walked = of.walk.trace / len(volts) * step_s
        scatter = (*scatter, max(float(np.mean((volts - of.last)[there] ** 2)) - walked, 0.0) / 2)[-SCATTERS:]
        frames = min(frames + 1, MEMORY)
        usual = float(np.median(scatter))
        noise = usual if np.isnan(noise) else noise + (usual - noise) / frames
        if 2 * scatter[-1] > JUMP**2 * usual:
            of = replace(of, blocks=(), block=())
    variance, root = error_after(of, step_s)
    # a first frame that is alone is as uncertain as one reading
    variance = variance if of.frames else noise
    seen = replace(of, noise=noise, frames=frames, time_s=time_s, last=volts, scatter=scatter)
    return _with_block(_filtered(seen, variance, root, np.where(there, volts - of.volts, 0.0), int(there.sum())),
                       volts)


def principal(root: Array) -> tuple[Array, Array]:
    """Standard deviations (m,) and orthonormal axes (m, readings) of the covariance root' root, of a root (k, readings)
    of few rows."""
    square, ways = np.linalg.eigh(root @ root.T)
    kept = square > NULL * square.max(initial=0.0)
    size = np.sqrt(square[kept])
    return size, ways[:, kept].T @ root / size[:, None]


def surprising(count: int) -> float:
    """The chi^2 of `count` readings from which a frame is off by more than noise and the known walk."""
    return float(chdtri(count, CHANCE))


def _filtered(of: Background, variance: float, root: Array, off: Array, count: int) -> Background:
    """One step of the filter by what `count` readings are off from the frame."""
    tiny = max(LEAST_NOISE**2 * float(np.nanmean(of.volts**2)), float(np.finfo(float).tiny))
    size, axes = principal(root)
    white, along = max(variance + of.noise, tiny), axes @ off
    energy = (float(off @ off) - float(np.sum(along**2 * size**2 / (size**2 + white)))) / white
    if energy > surprising(count):
        variance += (energy / count - 1) * white
    rest = max(variance / max(variance + of.noise, tiny), LEAST_GAIN)
    each = np.maximum((variance + size**2) / np.maximum(variance + size**2 + of.noise, tiny), rest)
    left = (1 - rest) ** 2 * variance + rest**2 * of.noise
    lefts = (1 - each) ** 2 * (variance + size**2) + each**2 * of.noise - left
    kept = lefts > NOTHING * left
    return replace(of, volts=of.volts + rest * off + ((each - rest) * along) @ axes, variance=left,
                   spread=np.sqrt(lefts[kept])[:, None] * axes[kept])


def scaled(of: Background, gain: Array) -> Background:
    """With all readings multiplied by factors (readings,)."""
    square = float(np.mean(gain**2))
    return replace(of, volts=of.volts * gain, variance=of.variance * square, spread=of.spread * gain,
                   noise=of.noise * square, scatter=tuple(one * square for one in of.scatter),
                   last=None if of.last is None else of.last * gain,
                   walk=Walk(of.walk.root * gain, of.walk.rest * square),
                   blocks=tuple(replace(one, mean=one.mean * gain) for one in of.blocks),
                   block=tuple(one * gain for one in of.block))


def interrupted(of: Background) -> Background:
    """With a touch after the latest untouched frame."""
    ended = _ended(of) if len(of.block) >= LEAST_BLOCK else of
    return replace(ended, last=None, block=())


def _with_block(of: Background, volts: Array) -> Background:
    filled = replace(of, block=(*of.block, volts), begun_s=of.begun_s if of.block else of.time_s)
    whole = len(filled.block) >= BLOCK and filled.time_s - filled.begun_s >= BLOCK_S
    return _ended(filled) if whole else filled


def _ended(of: Background) -> Background:
    """With the block that was being filled, and the walk by all."""
    mean = np.nan_to_num(np.mean(of.block, axis=0))
    block = Block(mean, len(of.block), of.begun_s, of.time_s - of.begun_s)
    blocks = (*of.blocks, block)[-BLOCKS:]
    walk = walk_of(blocks, of.noise, of.foreseen) if len(blocks) > 1 else of.walk
    return replace(of, blocks=blocks, block=(), walk=walk)
