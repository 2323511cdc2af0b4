"""How large the map's error near straight edges of an outline must be taken for places to lie as near as is said.

Few directions of an error move a place, and these need not be as its whole size says. So the size is that by which 90 %
of the places lie within 1.645 of their standard deviations, by bins of the gap; never less than it was.
"""

from dataclasses import replace

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap, gap, linearise, place, reaches, signal_size
from surrogate.forward_map.inversion.reading_covariance import at, no_drift, whitened
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.statistics.conformal import COVERAGE, normal
from touchcal.arrays import Array

BATCH = 64  # touches whose places are worked out together, to bound the memory


def with_places_held(forward: ForwardMap, touch: Array, signal_V: Array, material: Array) -> ForwardMap:
    """The map with the error that signals (n, readings), V, of touches (n, 4) by materials of states (n, k) ask for; a
    disc's as it is."""
    unknown = to_unknown(touch, forward.p0)
    near = np.flatnonzero(reaches(forward, place(forward.ring, unknown)))
    if forward.near_edges is None or not len(near):
        return forward
    ratio = np.concatenate([_off(forward, unknown[rows], signal_V[rows], material[rows])
                            for rows in np.array_split(near, len(near) // BATCH + 1)])
    error, gaps = forward.beside.error, gap(forward.ring, unknown[near])
    nearest = np.abs(gaps[:, None] - error.gap).argmin(axis=1)
    larger = [max(float(np.quantile(ratio[nearest == k], COVERAGE)) / normal(COVERAGE), 1.0) if np.any(nearest == k)
              else 1.0 for k in range(len(error.gap))]
    held = replace(error, error=error.error * np.array(larger)[:, None])
    return replace(forward, beside=replace(forward.beside, error=held))


def _off(forward: ForwardMap, unknown: Array, signal_V: Array, material: Array) -> Array:
    """(n, 2) by how many standard deviations x and y of touches (n, 4) are off, load free, if the map is linear."""
    here = linearise(forward, unknown)
    error_V = signal_V - here.signal_V - (here.discrepancy[..., forward.own:] @ material[..., None])[..., 0]
    sd = at(forward, unknown, signal_size(forward, unknown), 0.0, no_drift(signal_V.shape[1]))
    both = whitened(sd, np.concatenate([error_V[..., None], here.jacobian[..., [0, 1, 3]]], axis=2))
    left, slope = both[..., :1], both[..., 1:]
    covariance = np.linalg.inv(slope.transpose(0, 2, 1) @ slope)
    step = (covariance @ slope.transpose(0, 2, 1) @ left)[..., 0]
    return np.abs(step[:, :2]) / np.sqrt(np.einsum("npp->np", covariance)[:, :2])
