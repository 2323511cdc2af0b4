"""The learned map of a trained model for many touches at once, and the untouched frame, of moved electrodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.scene import Scene
from surrogate.data.frame_drift import frame_drift
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.forward_map.map_arrays import MapArrays, map_arrays, readings_of, signals
from surrogate.learners.forward import TouchInversion
from surrogate.model.model import load_of_sweep
from surrogate.model.sweep_model import SweepModel
from surrogate.model.trained import TrainedModel
from touchcal.arrays import Array

CHUNK = 128  # touches that are worked out together, to stay in the cache


@dataclass(frozen=True, eq=False)
class TouchMap:
    """The map of a forward model of a disc, for `eitsim.frames`."""

    arrays: MapArrays
    ring: Ring
    baseline_V: Array  # (readings,) of the untouched skin, V
    bounds: Array  # (2, 3) of the training touches in (radius, d, F), mm, mm, N
    known_mm: Array  # diameters of known punches, mm; none where these vary

    @property
    def radius_mm(self) -> float:
        """Radius of the disc, mm."""
        return self.ring.radius_mm

    @property
    def reach_mm(self) -> float:
        """Largest distance of training touches from the centre, mm."""
        return float(self.bounds[1, 0])

    @property
    def electrodes(self) -> int:
        """How many electrodes."""
        return len(self.ring.angle_rad)

    @property
    def materials(self) -> int:
        """States of the material."""
        return self.arrays.materials

    @property
    def usual(self) -> Mapping[str, Any]:
        """Punches and forces of the training."""
        (_, d_lo, f_lo), (_, d_hi, f_hi) = self.bounds.tolist()
        d: Any = {"choice": self.known_mm.tolist()} if len(self.known_mm) else [d_lo, d_hi]
        return {"diameter_mm": d, "force_N": [f_lo, f_hi]}

    def signals(self, touch: Array, turned: Array | None = None, material: Array | None = None) -> Array:
        """(n, readings) change of the readings, V, by touches (n, 4) in mm and N, of electrodes that lie angles (n,
        electrodes), rad, off their places, on materials of standard normal states (n, k)."""
        found = [signals(self.arrays, np, touch[i:i + CHUNK], None if turned is None else turned[i:i + CHUNK],
                         None if material is None else material[i:i + CHUNK]) for i in range(0, len(touch), CHUNK)]
        return np.concatenate(found) if found else np.zeros((0, len(self.baseline_V)))

    def untouched(self, turned: Array) -> Array:
        """(n, readings) of the untouched skin, V, of electrodes that lie angles (n, electrodes), rad, off."""
        if not np.any(turned):
            return np.broadcast_to(self.baseline_V, (len(turned), len(self.baseline_V)))
        one, other = np.triu_indices(self.electrodes, 1)
        angle = self.ring.angle_rad + turned
        logarithm = np.log(np.abs(np.sin((angle[:, one] - angle[:, other]) / 2)))
        table = np.zeros((len(turned), self.electrodes, self.electrodes))
        table[:, one, other] = table[:, other, one] = self._per_logarithm_V * (logarithm - self._logarithm)
        return self.baseline_V + readings_of(table, self.arrays.entries)

    def by_contact(self, sensor: Scene) -> Array:
        """(readings, electrodes) derivatives of untouched readings by the logarithms of the contact impedances, V."""
        return frame_drift(self.ring, self.baseline_V, contact_sd=1 - 1e-12, scene=sensor).contact

    @cached_property
    def _logarithm(self) -> Array:
        """(pairs,) log |sin(angle / 2)| of electrodes in their places."""
        one, other = np.triu_indices(self.electrodes, 1)
        return np.log(np.abs(np.sin((self.ring.angle_rad[one] - self.ring.angle_rad[other]) / 2)))

    @cached_property
    def _per_logarithm_V(self) -> float:
        """The potential of one electrode by another over that logarithm, by the untouched readings, V."""
        table = np.zeros((1, self.electrodes, self.electrodes))
        one, other = np.triu_indices(self.electrodes, 1)
        table[:, one, other] = table[:, other, one] = self._logarithm
        foreseen = readings_of(table, self.arrays.entries)[0]
        return float(foreseen @ self.baseline_V / (foreseen @ foreseen))


def forward_of(model: TrainedModel) -> ForwardMap:
    """The learned map of a forward model; ValueError for another method."""
    if not isinstance(model.learner, TouchInversion):
        raise ValueError(f"the model's method is {model.method}, and only forward has a map from touch to signal. Give "
                         "`simulate` CARD, or train with `method` forward.")
    return model.learner.forward


def touch_map(model: SweepModel | Path | str) -> TouchMap:
    """The learned map dV = f(x, y, d, F) of a forward model, for many touches at once.

    Parameters
    ----------
    model : SweepModel or path
        A model of the method forward of a disc, or its folder.

    Returns
    -------
    TouchMap
        `signals(touch)` gives (n, 208) V of touches (n, 4) in mm and N; `eitsim.frames` draws data from it.

    Raises
    ------
    ValueError
        For another method, or a skin that is no disc.

    Examples
    --------
    >>> skin = surrogate.touch_map("model")
    >>> skin.signals(np.array([[20.0, 0.0, 14.0, 1.0]])).shape
    (1, 208)
    """
    known = load_of_sweep(model) if isinstance(model, Path | str) else model
    forward = forward_of(known)
    return TouchMap(map_arrays(forward), forward.ring, known.baseline_V, forward.bounds, forward.known_mm)
