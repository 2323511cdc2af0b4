"""Figures of merit of an image of one target, as GREIT defines them.

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


@dataclass(frozen=True)
class FiguresOfMerit:
    """How an image shows one target; all but the position error relative."""

    amplitude_response: float  # integral of the image over that of the truth
    # distance of the target from the middle less that of its image's centre, m; positive: drawn towards the middle
    position_error_m: float
    displacement_m: float  # distance between the target and its image's centre, m
    resolution: float  # square root of the image's area, its quarter-amplitude set, over that of the whole disc
    shape_deformation: float  # part of that set outside the circle of its own area about its own centre
    ringing: float  # integral of the opposite sign outside that circle over the integral inside


def blob(points_m: Array, area_m2: Array, image: Array, sign: int = 0) -> Blob:
    """Centre and area of the quarter-amplitude set of an image (n,) on pixels at points (n, 2) of areas (n,).

    sign: 1 or -1, the target's; 0: that of the largest magnitude. ValueError where no pixel has the target's sign.
    """
    return _blob(points_m, area_m2, *_quarter(image, sign))


def regions(points_m: Array, area_m2: Array, image: Array) -> list[Blob]:
    """Connected regions of an image (n,), as `blob` takes it, where it has at least half of its largest magnitude and
    that sign, the largest peak first."""
    sign = int(np.sign(image[np.argmax(np.abs(image))]))
    where = np.flatnonzero(sign * image >= _HALF * np.max(sign * image))
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


def figures_of_merit(points_m: Array, area_m2: Array, image: Array, target_m: Array, strength_m2: float
                     ) -> FiguresOfMerit:
    """Figures of an image (n,) on the pixels of a disc about the origin, at points (n, 2) of areas (n,).

    target_m: the target's centre (2,); strength_m2: the integral of the true relative change, contrast times area.
    ValueError where no pixel has the sign of the strength.
    """
    sign = int(np.sign(strength_m2))
    where, _ = _quarter(image, sign)
    found = blob(points_m, area_m2, image, sign)
    centre = np.array([found.x_m, found.y_m])
    circle = np.hypot(*(points_m - centre).T) <= np.sqrt(found.area_m2 / np.pi)
    signed = sign * image * area_m2
    return FiguresOfMerit(
        amplitude_response=float(np.sum(image * area_m2) / strength_m2),
        position_error_m=float(np.hypot(*target_m) - np.hypot(*centre)),
        displacement_m=float(np.hypot(*(centre - target_m))),
        resolution=float(np.sqrt(found.area_m2 / area_m2.sum())),
        shape_deformation=float(area_m2[where & ~circle].sum() / found.area_m2),
        ringing=float(-signed[~circle & (signed < 0)].sum() / signed[circle].sum()))


def _quarter(image: Array, sign: int) -> tuple[NDArray[np.bool_], float]:
    """The quarter-amplitude set and the largest value of the target's sign."""
    sign = sign or int(np.sign(image[np.argmax(np.abs(image))]))
    largest = float(np.max(sign * image))
    if not largest > 0:
        raise ValueError("the image has no pixel of the target's sign; its sign or its noise hides the target.")
    return sign * image >= _QUARTER * largest, sign * largest
