"""Fields of electrodes on the rim of a homogeneous disc of radius 1, closed forms.

A current into a point of the rim makes the potential -ln|x - p| / pi up to what cancels in pairs; electrodes of a width
average it over their own.
"""

import numpy as np

from touchcal.arrays import Array, Index

_MODES = 400


def ring_kernel(count: int, width: float, contact: float = 0.0) -> Array:
    """(count,) transfer impedance between electrodes of an even ring by the turns between them, on a sheet of 1 S.

    width: of an electrode over their spacing; contact: contact impedance of one, in the same unit.
    """
    mode = np.arange(1, _MODES + 1)
    weight = np.sinc(mode * width / count) ** 2 / (np.pi * mode)
    kernel = np.cos(2 * np.pi * np.outer(np.arange(count), mode) / count) @ weight
    kernel[0] += contact
    return kernel


def turned(count: int, width: float) -> Array:
    """(count,) derivative of `ring_kernel` by the angle between the electrodes, rad."""
    mode = np.arange(1, _MODES + 1)
    weight = np.sinc(mode * width / count) ** 2 / np.pi
    return -np.sin(2 * np.pi * np.outer(np.arange(count), mode) / count) @ weight


def disc_points(rings: int = 10, around: int = 48) -> tuple[Array, Array]:
    """Points (n,) as complex numbers inside 0.95 of the disc, and the area (n,) of each."""
    edges = 0.95 * np.sqrt(np.linspace(0, 1, rings + 1))
    radius = np.sqrt((edges[1:] ** 2 + edges[:-1] ** 2) / 2)
    angle = 2 * np.pi * (np.arange(around) + 0.5) / around
    points = (radius[:, None] * np.exp(1j * angle)).ravel()
    return points, np.full(points.size, 0.95**2 * np.pi / points.size)


def pair_fields(ends: Index, count: int, points: Array) -> Array:
    """(pairs, n) fields, as complex numbers, of 1 A from ends[:, 0] to ends[:, 1]; -1 is the mean of all electrodes,
    which has none."""
    place = np.exp(2j * np.pi * np.arange(count) / count)
    single = np.vstack([1 / np.conj(points[None, :] - place[:, None]), np.zeros(points.size)]) / np.pi
    return single[ends[:, 0]] - single[ends[:, 1]]
