"""The signal's amplitude over force for each diameter: where it is largest, and which forces it cannot tell apart."""

from typing import Any

import numpy as np

from surrogate.data.sensor_ring import outwards
from surrogate.forward_map.forward_map import ForwardMap, linearise
from surrogate.forward_map.load_coordinates import to_unknown
from touchcal.arrays import Array, Mask

FORCES, DIAMETERS = 120, 5  # forces of each diameter, and diameters where no punches are known


def amplitude(forward: ForwardMap) -> dict[str, Any]:
    """RMS of the signal over the trained forces, of known punches or of diameters in equal steps, at the trained
    radius nearest to the centre, or to the place farthest from all edges, as JSON: radius_mm, `centre`, which of both,
    force_N, and for each of `diameters` d_mm and rms_V, with peak_N, the first top that the amplitude falls from, and
    two_answers_N (lowest and highest force whose amplitude another force has too), null where it only grows.

    A fall within the map's own error is none.
    """
    (radius, d_lo, f_lo), (_, d_hi, f_hi) = forward.bounds
    place_mm = outwards(forward.ring, forward.bounds[:1, 0] / forward.ring.radius_mm)[0]
    force, found = np.linspace(f_lo, f_hi, FORCES), []
    for d in forward.known_mm if len(forward.known_mm) else np.unique(np.linspace(d_lo, d_hi, DIAMETERS)):
        touch = np.column_stack(np.broadcast_arrays(*place_mm, d, force))
        here = linearise(forward, to_unknown(touch, forward.p0))
        norm = np.linalg.norm(here.signal_V, axis=1)
        along = np.linalg.norm((here.signal_V[:, None] @ here.discrepancy[..., :forward.own])[:, 0], axis=1) / norm
        peak, rms = _top(norm, along), norm / np.sqrt(here.signal_V.shape[1])
        shared = force[_taken_twice(rms)]
        found.append({"d_mm": float(d), "rms_V": rms.tolist(), "peak_N": None if peak is None else float(force[peak]),
                      "two_answers_N": None if peak is None else [float(shared.min()), float(shared.max())]})
    centre = "the centre" if forward.ring.sheet is None else "the place farthest from the edges"
    return {"radius_mm": float(radius), "centre": centre, "force_N": force.tolist(), "diameters": found}


def _top(norm: Array, error: Array) -> int | None:
    """Where norms (n,) of these errors are largest before they first fall by more than the error; None where they never
    do."""
    falls = np.flatnonzero(norm < np.maximum.accumulate(norm - error))
    return int(np.argmax(norm[:falls[0]])) if len(falls) else None


def _taken_twice(rms: Array) -> Mask:
    """(n,) which of the values of a curve it takes between two other neighbours, too."""
    place, step = np.arange(len(rms))[:, None], np.arange(len(rms) - 1)
    lower, upper = np.minimum(rms[:-1], rms[1:]), np.maximum(rms[:-1], rms[1:])
    crossed = (lower <= rms[:, None]) & (rms[:, None] <= upper)
    return np.any(crossed & (step != place) & (step != place - 1), axis=1)
