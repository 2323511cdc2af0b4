"""Blocks in time: each is held out once, so that a row is read by what was learnt before and after it."""

import numpy as np

from touchcal.arrays import Index

BLOCKS = 8


def time_blocks(rows: int, count: int = BLOCKS) -> Index:
    """(rows,) block of each row: up to `count` runs of rows in time, as long as each other to one row."""
    return (np.arange(rows) * min(count, rows) // rows).astype(np.intp)
