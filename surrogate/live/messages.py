"""What the page is sent: first what skin it is, then each frame with what was read from it, as JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from surrogate.live.controls import Limits
from surrogate.live.moments import Moment
from surrogate.model.trained import TrainedModel
from touchcal.arrays import Array

ELLIPSE = 2.146  # half axes of the ellipse that holds 90 % of a normal place, over its standard deviations


@dataclass(frozen=True)
class Touch:
    """What was read from a frame."""

    value: dict[str, float]  # x_mm, y_mm, d_mm, F_N; empty where nothing touches
    half_width: dict[str, float]  # of the 90 % intervals, likewise
    place_covariance_mm2: Array  # (2, 2)
    flag: str


def hello(model: TrainedModel, limits: Limits | None, source: str) -> dict[str, Any]:
    """The sensor, what may be pressed, and where the readings come from: "simulated", "learned", "recorded" or
    "streamed"."""
    ring = model.ring
    return {"source": source, "radius_mm": ring.radius_mm, "electrodes_rad": np.round(ring.angle_rad, 6).tolist(),
            "readings": len(model.baseline_V), "limits": None if limits is None else asdict(limits)}


def ellipse(covariance_mm2: Array) -> dict[str, float]:
    """Half axes, mm, and the direction of the longer one, rad, of the ellipse that holds 90 %."""
    values, axes = np.linalg.eigh(covariance_mm2)
    half = ELLIPSE * np.sqrt(np.maximum(values, 0.0))
    return {"long_mm": round(float(half[1]), 3), "short_mm": round(float(half[0]), 3),
            "angle_rad": round(math.atan2(axes[1, 1], axes[0, 1]), 4)}


def frame(number: int, moment: Moment, touch: Touch, baseline_V: Array, spent_ms: float) -> str:
    """One frame: its number, time, differences to the untouched frame in mV, the press that made it, what was read,
    what the server spent on reading it."""
    difference = np.round((moment.volts - baseline_V) * 1e3, 4)
    true = moment.true
    return json.dumps({
        "number": number, "time_s": round(moment.time_s, 4),
        "difference_mV": [value if math.isfinite(value) else None for value in difference.tolist()],
        "true": None if true is None or true.force_N == 0 else {
            "x_mm": true.x_mm, "y_mm": true.y_mm, "d_mm": true.diameter_mm, "F_N": true.force_N},
        "read": {name: round(value, 5) for name, value in touch.value.items()} or None,
        "half_width": {name: round(value, 5) for name, value in touch.half_width.items()},
        "ellipse": ellipse(touch.place_covariance_mm2) if touch.value else None,
        "flag": touch.flag, "note": moment.note, "pictures": moment.pictures, "answers_ms": moment.answers_ms,
        "spent_ms": round(spent_ms, 2)}, allow_nan=False)
