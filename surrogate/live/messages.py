"""What the page is sent: first what skin it is, then each frame with what was read from it, as JSON."""

import json
import math
from dataclasses import fields
from typing import Any

import numpy as np

from surrogate.live.controls import Limits
from surrogate.live.moments import Moment
from surrogate.live.pictured import pictured
from surrogate.model.assumed_punch import assumed_punch
from surrogate.model.model import Model
from surrogate.model.sweep_model import SweepModel
from surrogate.model.tracking.tracked import CALIBRATING, TOUCH, UNREADABLE, Tracked

# Names of the touch's values, and their units in SI
VALUES = {"x_mm": 1e3, "y_mm": 1e3, "d_mm": 1e3, "F_N": 1.0}


def hello(model: Model, limits: Limits | None, source: str,
          noise_V: float = 0.0) -> dict[str, Any]:
    """The sensor, what may be pressed, the noise to begin with, the punch that answers assume, and where the readings
    come from: "simulated", "learned", "recorded", "streamed" or "exported"."""
    skin = pictured(model)
    return {"source": source, "skin": skin.document(), "readings": skin.readings,
            "values": list(skin.values), "unit": skin.unit, "limits": None if limits is None else _limits(limits),
            "noise_mV": round(noise_V * 1e3, 6),
            "assumes": assumed_punch(model) if isinstance(model, SweepModel) else ""}


def _limits(limits: Limits) -> dict[str, Any]:
    return {field.name: getattr(limits, field.name) for field in fields(limits) if field.name != "edges"}


def frame(number: int, moment: Moment, found: Tracked, hello: dict[str, Any], caution: str, spent_ms: float) -> str:
    """One frame: its number, time, differences to the untouched frame in the unit that `hello` states, the press that
    made it, what was read, cautions, and what the server spent on it."""
    true, values, half = moment.true, _numbers(found.value), _numbers((found.below + found.above) / 2)
    scale = 1e3 if hello["unit"] == "mV" else 1.0
    for k, name in enumerate(hello["values"]):
        if values and name not in VALUES and found.row is not None:  # further labels of a model of a recording
            values[name], half[name] = (round(float(one), 6) for one in (found.row[3 * k],
                                                                         found.row[3 * k + 2] - found.row[3 * k]))
    long_m, short_m, angle_rad = found.ellipse if values else (0.0, 0.0, 0.0)
    return json.dumps({
        "number": number, "time_s": round(moment.time_s, 4),
        "difference": [round(scale * value, 4) if math.isfinite(value) else None for value in found.signal_V.tolist()],
        "true": None if true is None or true.force_N == 0 else {
            "x_mm": true.x_mm, "y_mm": true.y_mm, "d_mm": true.diameter_mm, "F_N": true.force_N},
        "read": values or None, "half_width": half,
        "ellipse": None if not values else {"long_mm": round(1e3 * long_m, 4), "short_mm": round(1e3 * short_m, 4),
                                            "angle_rad": round(angle_rad, 4)},
        "state": _state(found), "flag": "" if moment.note.startswith(UNREADABLE) else found.flag,
        "caution": caution, "note": moment.note,
        "fields": moment.fields, "answers_ms": moment.answers_ms, "spent_ms": round(spent_ms, 2)},
        allow_nan=False)


def _numbers(values: np.ndarray) -> dict[str, float]:
    return {name: round(float(value) * unit, 6) for (name, unit), value in zip(VALUES.items(), values, strict=True)
            if math.isfinite(value)}


def _state(found: Tracked) -> str:
    if found.state == CALIBRATING:
        return f"calibrating: {found.left} more untouched frame{'s' * (found.left != 1)}"
    return "no value for this touch" if found.state == TOUCH and not np.isfinite(found.value[0]) else found.state
