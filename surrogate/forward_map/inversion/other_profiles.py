"""What punches of other profiles change of the force, where a signal leaves the profile open.

Nearly each signal of a sphere or a cone is, within the noise, that of some trained punch under another force. The ratio
of the two forces is a smooth function of the punch and the force that are read, learned for each profile from signals
of its own (Gaussian processes in log d and log F). So the force, where each profile is as likely as any other, is a
mixture of that of the trained punches and of the same times each ratio, whose own error counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from surrogate.data.samples import OtherProfile
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.inversion.invert import invert
from surrogate.statistics import gaussian_process
from surrogate.statistics.gaussian_process import GaussianProcess
from touchcal.arrays import Array

FEWEST = 8  # touches of a profile that teach a ratio


@dataclass(frozen=True, eq=False)
class ForceRatio:
    """Force of a punch of another profile, over that of the trained punch of the same signal."""

    profile: str
    log_ratio: GaussianProcess  # over log d and log F of the trained punch, mm and N
    lowest: Array  # (3,) least log d, log F and logarithm of the ratio that taught it
    highest: Array  # (3,) largest


def learned(forward: ForwardMap, others: Sequence[OtherProfile]) -> tuple[ForceRatio, ...]:
    """The ratios of the profiles of which enough touches are read within the training range."""
    found = []
    for other in others:
        read = invert(forward, other.signal_V)
        touch, force_N = read.touch[read.inside], other.touch[read.inside, 3]
        if len(touch) < FEWEST:
            continue
        rows = np.column_stack([np.log(touch[:, 2:]), np.log(force_N / touch[:, 3])])
        found.append(ForceRatio(other.profile, gaussian_process.fit(rows[:, :2], rows[:, 2]), rows.min(axis=0),
                                rows.max(axis=0)))
    return tuple(found)


def at(ratios: Sequence[ForceRatio], touch: Array) -> tuple[Array, Array]:
    """(n, 1 + profiles) ratios at touches (n, 4) that were read, that of the trained profile, 1, first; and their
    standard deviations."""
    each, sd = [np.ones(len(touch))], [np.zeros(len(touch))]
    for ratio in ratios:
        read = np.clip(np.log(touch[:, 2:]), ratio.lowest[:2], ratio.highest[:2])
        log_ratio, _, variance = gaussian_process.predict(ratio.log_ratio, read)
        each.append(np.exp(np.clip(log_ratio, ratio.lowest[2], ratio.highest[2])))
        sd.append(each[-1] * np.sqrt(variance + np.median(ratio.log_ratio.noise)))
    return np.stack(each, axis=1), np.stack(sd, axis=1)
