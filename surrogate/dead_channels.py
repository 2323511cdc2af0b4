"""Frames with a dead channel, which a model trained on all readings cannot do without."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eitsim.frames import Frames
from matcal.errors import TestFileError

# A reading this far below the RMS of its frame reads nothing.
DEAD = 1e-9


def refuse_dead(path: Path, frames: Frames, baseline_V: NDArray[np.float64]) -> None:
    """TestFileError names the line of a channel that reads nothing in a frame where the baseline (readings,), V, of the
    training does, or reads exactly the same in every frame while nine in ten others change."""
    volts = frames.volts
    size, known = (np.sqrt(np.mean(v**2, axis=-1, keepdims=True)) for v in (volts, baseline_V))
    silent = np.argwhere((np.abs(volts) <= DEAD * size) & (np.abs(baseline_V) > DEAD * known))
    if len(silent):
        frame, column = silent[0]
        raise TestFileError(path, f"column {column + 1} reads {volts[frame, column]:g} V: a dead channel. Mend it; a "
                                  "model trained on all readings cannot do without it.", line=int(frames.line[frame]))
    stuck = np.ptp(volts, axis=0) == 0
    if len(volts) > 2 and 0 < np.mean(stuck) < 0.1:
        column = int(np.argmax(stuck))
        raise TestFileError(path, f"column {column + 1} reads exactly {volts[0, column]:g} V from this line on, in all "
                                  f"{len(volts)} frames: a dead channel.", line=int(frames.line[0]))
