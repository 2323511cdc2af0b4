"""Current patterns and the order of the readings; both are linear in the impedance matrix of the electrodes."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from eitsim.scene import Drive

Array = NDArray[np.float64]
Indices = NDArray[np.integer]

PATTERNS = ("adjacent", "opposite", "skip-N")


def stride(drive: Drive, count: int) -> int:
    """How many electrodes counter-clockwise from the source the sink lies: 1 adjacent, count/2 opposite, N + 1 skip-N.

    ValueError for an unknown pattern, an odd count with opposite electrodes, or a sink on the source or the reference.
    """
    skip = re.fullmatch(r"skip-(\d+)", drive.pattern)
    if not skip and drive.pattern not in PATTERNS[:2]:
        raise ValueError(f"pattern '{drive.pattern}' is unknown; known: {', '.join(PATTERNS)} (for instance skip-2).")
    if drive.pattern == "opposite" and count % 2:
        raise ValueError(f"pattern 'opposite' needs an even number of electrodes, got {count}.")
    step = int(skip.group(1)) + 1 if skip else {"adjacent": 1, "opposite": count // 2}[drive.pattern]
    if not 1 <= step <= count - 2:
        raise ValueError(f"pattern '{drive.pattern}' with {count} electrodes puts the sink on the source or on the "
                         f"reference; skip at most {count - 3}.")
    return step


def read_electrodes(drive: Drive, count: int) -> Indices:
    """Electrodes (count, count - 3) that each pattern reads, from 0, in the order of the readings.

    Pattern k drives +I into electrode k and -I out of k + stride; electrode k - 1 is 0 V; the others are read
    counter-clockwise from k + 1. Adjacent: k + 2 ... k + 14 of 16 (paper, section 4.4).
    """
    step = stride(drive, count)
    offsets = np.array([o for o in range(1, count - 1) if o != step])
    return (np.arange(count)[:, None] + offsets) % count


def read_out(drive: Drive, impedance_Ohm: Array) -> Array:
    """Readings (count, count - 3), V, of an impedance matrix (count, count), Ohm."""
    count = len(impedance_Ohm)
    pattern = np.arange(count)
    driven = impedance_Ohm[:, pattern] - impedance_Ohm[:, (pattern + stride(drive, count)) % count]
    earthed = drive.current_A * (driven - driven[pattern - 1, pattern])
    return earthed[read_electrodes(drive, count), pattern[:, None]]
