"""How large the map's error near straight edges of an outline must be taken for places to lie as near as is said.

Few directions of an error move a place, and these need not be as its whole size says. So the size is that by which 90 %
of the places lie within 1.645 of their standard deviations, along the edge and across it, by bins of the gap; never
less than it was. The standard deviations of each touch are those that the others teach: few touches of a bin say little
of so many directions, and their own errors would lie along them.
"""

from dataclasses import replace

import numpy as np

from surrogate.data.edge_frame import edge_frame
from surrogate.forward_map import rim_correction
from surrogate.forward_map.forward_map import ForwardMap, gap, linearise, place, reaches, signal_size
from surrogate.forward_map.inversion.reading_covariance import at, no_drift, whitened
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array

BATCH = 64  # touches whose places are worked out together, to bound the memory


def with_places_held(forward: ForwardMap, touch: Array, error_V: Array) -> ForwardMap:
    """The map with the error that touches (n, 4) ask for, by their errors (reached, readings), V, as
    `forward_map.fit_with_errors` gives them; a disc's as it is."""
    unknown = to_unknown(touch, forward.p0)
    near = np.flatnonzero(reaches(forward, place(forward.ring, unknown)))
    if forward.near_edges is None or not len(near):
        return forward
    gaps, ratio = gap(forward.ring, unknown[near]), _foreseen(forward, unknown[near], error_V)
    error = forward.correction.error
    nearest = np.abs(gaps[:, None] - error.gap).argmin(axis=1)
    larger = [max(float(np.quantile(ratio[nearest == k], COVERAGE, axis=0).max()) / normal(COVERAGE), 1.0)
              if np.any(nearest == k) else 1.0 for k in range(len(error.gap))]
    held = replace(error, error=error.error * np.array(larger)[:, None])
    return replace(forward, correction=replace(forward.correction, error=held))


def _foreseen(forward: ForwardMap, unknown: Array, error_V: Array) -> Array:
    """(n, 2) as `_off`, the map's error being that which the others teach."""
    z, punch, gaps = place(forward.ring, unknown), unknown[:, 2:], gap(forward.ring, unknown)
    relative = error_V / signal_size(forward, unknown)[:, None]
    part, out = rim_correction.folds(z, punch), np.empty((len(unknown), 2))
    for k in np.unique(part):
        own, others = np.flatnonzero(part == k), part != k
        error = rim_correction.error_of(forward.ring, forward.field, forward.correction.error.symmetry, z[others],
                                        punch[others], gaps[others], relative[others])
        held_out = replace(forward, correction=replace(forward.correction, error=error))
        for rows in np.array_split(own, len(own) // BATCH + 1):
            out[rows] = _off(held_out, unknown[rows], error_V[rows])
    return out


def _off(forward: ForwardMap, unknown: Array, error_V: Array) -> Array:
    """(n, 2) by how many standard deviations touches (n, 4) are off across the edge and along it, load free, by errors
    (n, readings), V, if the map is linear."""
    sd = at(forward, unknown, signal_size(forward, unknown), 0.0, no_drift(error_V.shape[1]))
    across = edge_frame(forward.ring, place(forward.ring, unknown)).outwards
    axes = np.stack([across.real, -across.imag, across.imag, across.real], axis=1).reshape(-1, 2, 2)
    jacobian = linearise(forward, unknown).jacobian
    both = whitened(sd, np.concatenate([error_V[..., None], jacobian[..., :2] @ axes, jacobian[..., 3:]], axis=2))
    left, slope = both[..., :1], both[..., 1:]
    covariance = np.linalg.inv(slope.transpose(0, 2, 1) @ slope)
    step = (covariance @ slope.transpose(0, 2, 1) @ left)[..., 0]
    return np.abs(step[:, :2]) / np.sqrt(np.einsum("npp->np", covariance)[:, :2])
