"""Places over a disc."""

import numpy as np

from touchcal.arrays import Array

CLOSE = 1e-9  # of the radius: places on the edge belong to the disc, whatever rounding


def disc_grid(middle: Array, radius: float, across: int) -> Array:
    """(g, 2) square grid, so many places across, of the disc of a radius about a middle (2,), in their unit."""
    axis = np.linspace(-radius, radius, across)
    grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    return middle + grid[np.linalg.norm(grid, axis=1) <= radius * (1 + CLOSE)]
