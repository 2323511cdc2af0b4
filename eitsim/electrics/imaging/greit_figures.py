"""Where an image shows what it shows: its quarter-amplitude set, as GREIT defines it, and its separate regions.

The quarter-amplitude set are the pixels of the target's sign with at least a quarter of the image's largest value.
Source: Adler et al. 2009, DOI 10.1088/0967-3334/30/6/S03.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from touchcal.arrays import Array

_QUARTER = 0.25  # Part of the largest value from which a pixel belongs to the target's image.
# Part from which it belongs to a region of its own, and the distance of neighbours over the root of a pixel's area.
_HALF, _NEIGHBOURS = 0.5, 1.6


@dataclass(frozen=True)
class Blob:
    """The quarter-amplitude set of an image."""

    # centre of its area, m
    x_m: float
    y_m: float
    area_m2: float  # its area, m^2
    peak: float  # largest value of the image, of the target's sign


def blob(points_m: Array, area_m2: Array, image: Array) -> Blob:
    """Centre and area of the quarter-amplitude set of an image (n,) on pixels at points (n, 2) of areas (n,), of the
    sign of its largest magnitude, which is not 0."""
    sign, largest = _largest(image)
    return _blob(points_m, area_m2, sign * image >= _QUARTER * largest, sign * largest)


def regions(points_m: Array, area_m2: Array, image: Array) -> list[Blob]:
    """Connected regions of an image (n,), as `blob` takes it, where it has at least half of its largest magnitude and
    that sign, the largest peak first."""
    sign, largest = _largest(image)
    where = np.flatnonzero(sign * image >= _HALF * largest)
    pairs = KDTree(points_m[where]).query_pairs(_NEIGHBOURS * float(np.sqrt(area_m2.max())), output_type="ndarray")
    joined = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(where),) * 2)
    count, label = connected_components(joined, directed=False)
    parts = [where[label == k] for k in range(count)]
    found = [_blob(points_m, area_m2, part, sign * float(np.max(sign * image[part]))) for part in parts]
    return sorted(found, key=lambda one: -abs(one.peak))


def _blob(points_m: Array, area_m2: Array, part: NDArray[np.bool_] | NDArray[np.int64], peak: float) -> Blob:
    """Some pixels as one blob, about its centroid."""
    area = area_m2[part]
    x, y = (area @ points_m[part] / area.sum()).tolist()
    return Blob(x, y, float(area.sum()), peak)


def _largest(image: Array) -> tuple[int, float]:
    """Sign and size of the largest magnitude."""
    largest = float(image[np.argmax(np.abs(image))])
    return int(np.sign(largest)), abs(largest)
