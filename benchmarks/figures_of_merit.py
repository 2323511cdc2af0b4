"""Figures of merit of an image of one target, as GREIT defines them.

Source: Adler et al. 2009, DOI 10.1088/0967-3334/30/6/S03. A module of `reconstruction.py`; no table of results.
"""

from dataclasses import dataclass

import numpy as np

from eitsim.electrics.imaging.greit_figures import blob
from touchcal.arrays import Array


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


def figures_of_merit(points_m: Array, area_m2: Array, image: Array, target_m: Array, strength_m2: float
                     ) -> FiguresOfMerit:
    """Figures of an image (n,) on the pixels of a disc about the origin, at points (n, 2) of areas (n,).

    target_m: the target's centre (2,); strength_m2: the integral of the true relative change, contrast times area.
    ValueError where no pixel has the sign of the strength.
    """
    sign = np.sign(strength_m2)
    seen = np.where(sign * image > 0, image, 0.0)
    if not seen.any():
        raise ValueError("the image has no pixel of the target's sign; its sign or its noise hides the target.")
    found = blob(points_m, area_m2, seen)
    centre = np.array([found.x_m, found.y_m])
    circle = np.hypot(*(points_m - centre).T) <= np.sqrt(found.area_m2 / np.pi)
    signed = sign * image * area_m2
    return FiguresOfMerit(
        amplitude_response=float(np.sum(image * area_m2) / strength_m2),
        position_error_m=float(np.hypot(*target_m) - np.hypot(*centre)),
        displacement_m=float(np.hypot(*(centre - target_m))),
        resolution=float(np.sqrt(found.area_m2 / area_m2.sum())),
        shape_deformation=float(area_m2[(np.abs(seen) >= abs(found.peak) / 4) & ~circle].sum() / found.area_m2),
        ringing=float(-signed[~circle & (signed < 0)].sum() / signed[circle].sum()))
