"""First-order signal of a small change of conductance in a uniform insulated disc with an even ring of electrodes: the
product of the driving and of the reading field (Geselowitz 1971)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from eitsim.scene.drive import Protocol
from eitsim.sensors.disc_field import pair_fields
from surrogate.recordings.patterns import direction
from touchcal.arrays import Array, Complex


@dataclass(frozen=True, eq=False)
class DiscSensitivity:
    """Patterns of a protocol."""

    protocol: Protocol

    def __call__(self, place: Complex) -> Array:
        """(n, m) directions of the signals of small presses at places (n,) of the disc of radius 1, electrode 0 at 1
        and the others counter-clockwise."""
        count = self.protocol.currents_A.shape[1]
        points: Any = place  # complex numbers
        single = pair_fields(np.stack([np.arange(count), np.full(count, -1)], axis=1), count, points)
        driving, reading = self.protocol.currents_A @ single, self.protocol.weights @ single
        return direction((driving.conj()[:, None] * reading).real.reshape(-1, len(place)).T)
