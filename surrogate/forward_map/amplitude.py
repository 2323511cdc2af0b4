"""The signal's amplitude over force for each diameter: where it is largest, and which forces it cannot tell apart."""

from typing import Any

import numpy as np

from surrogate.forward_map.forward_map import ForwardMap, linearise, strength_discrepancy
from surrogate.forward_map.load_coordinates import to_unknown

FORCES, DIAMETERS = 120, 5  # forces of each diameter, and diameters where no punches are known


def amplitude(forward: ForwardMap) -> dict[str, Any]:
    """RMS of the signal over the trained forces, of known punches or of diameters in equal steps, at the trained
    radius nearest to the centre, as JSON: radius_mm, force_N, and for each of `diameters` d_mm and rms_V, with peak_N
    and two_answers_N (lowest and highest force whose amplitude another force has too), null where it only grows.

    A fall after the peak within the map's own error is none.
    """
    (radius, d_lo, f_lo), (_, d_hi, f_hi) = forward.bounds
    force, found = np.linspace(f_lo, f_hi, FORCES), []
    for d in forward.known_mm if len(forward.known_mm) else np.unique(np.linspace(d_lo, d_hi, DIAMETERS)):
        touch = np.column_stack(np.broadcast_arrays(radius, 0.0, d, force))
        unknown = to_unknown(touch, forward.p0)
        rms = np.sqrt(np.mean(linearise(forward, unknown).signal_V ** 2, axis=1))
        error = strength_discrepancy(forward, unknown)[-1, 0]
        falls = rms[-1] < rms.max() * (1 - error)
        shared = force[rms >= max(rms[0], rms[-1])]
        found.append({"d_mm": float(d), "rms_V": rms.tolist(), "peak_N": float(force[rms.argmax()]) if falls else None,
                      "two_answers_N": [float(shared[0]), float(shared[-1])] if falls else None})
    return {"radius_mm": float(radius), "force_N": force.tolist(), "diameters": found}
