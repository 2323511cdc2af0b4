"""Blocks in time: each is held out once, so that a press is read by what was learnt before and after it."""

import numpy as np

from surrogate.statistics.conformal import FEW
from touchcal.arrays import Index

# Blocks of many rows; of fewer than FEW rows there are more blocks, for each row that is held out is missed.
BLOCKS, BLOCKS_OF_FEW = 8, 20


def press_blocks(press: Index) -> Index:
    """(n,) block of each frame of presses (n,), numbered from 0 in time: that of its press."""
    return time_blocks(int(press.max()) + 1)[press]


def time_blocks(rows: int) -> Index:
    """(rows,) block of each row: runs of rows in time, as long as each other to one row."""
    count = min(BLOCKS if rows >= FEW else BLOCKS_OF_FEW, rows)
    return (np.arange(rows) * count // rows).astype(np.intp)
