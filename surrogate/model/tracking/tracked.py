"""What a tracker says of one frame."""

from dataclasses import dataclass

import numpy as np

from surrogate.statistics.conformal import COVERAGE
from touchcal.arrays import Array

# Noise and baseline are learnt, no values yet; nothing touches; a touch; two or more; a line that is no frame.
CALIBRATING, UNTOUCHED, TOUCH, SEVERAL_TOUCHES, UNREADABLE = (
    "calibrating", "untouched", "touch", "more than one touch", "unreadable")


@dataclass(frozen=True, eq=False)
class Tracked:
    """One frame of a stream: whether something touches, where, and how surely."""

    time_s: float  # time of the frame, s
    state: str  # "calibrating", "untouched", "touch", "more than one touch" or "unreadable"
    value: Array  # (4,) x, y, d in m, F in N; NaN where no touch is read, and for what the model does not read
    covariance: Array  # (4, 4) in these units, calibrated: factors of the normal variable make intervals and ellipse
    below: Array  # (4,) distances of the values to the ends of their 90 % intervals
    above: Array
    signal_V: Array  # (readings,) the frame less the tracked baseline, in the unit of the readings
    noise_V: float  # standard deviation of one reading, as known so far; NaN before it is
    left: int  # frames that calibration still takes; 0 when it is over
    flag: str  # what is to be known of the frame; empty where nothing is
    # (columns,) all outputs with their ends, and parts where the model states them, as `Tracker.columns` names
    # them; None where no touch is read
    row: Array | None = None
    kinds: int = 0  # of what is to be known, a sum of `surrogate.data.flags.Flag`

    @property
    def ellipse(self) -> tuple[float, float, float]:
        """Half axes, m, and angle of the longer one from +x, rad, of the ellipse that holds the place at 90 %."""
        size, axes = np.linalg.eigh(self.covariance[:2, :2])
        half = np.sqrt(np.maximum(size, 0.0) * -2 * np.log1p(-COVERAGE))
        return float(half[1]), float(half[0]), float(np.arctan2(axes[1, 1], axes[0, 1]))
