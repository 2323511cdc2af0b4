"""What labelled presses change of a layer that conducts in its volume, which no material card holds.

The thickness is times exp(t). Both coefficients of a piezoresistive layer are times exp(s), and the one across the
current is then larger by b hypot(along, across) exp(s).
"""

import math
from collections.abc import Mapping
from typing import Any

THICKNESS, PIEZO, ACROSS = "ln_thickness_factor", "ln_piezo_factor", "piezo_across"


def fitted_layer(thickness: float, along: float, across: float,
                 values: Mapping[str, float]) -> tuple[float, float, float]:
    """A layer's thickness and coefficients along and across the current as fitted; values that are not there are 0."""
    larger = math.exp(values.get(PIEZO, 0.0))
    across += values.get(ACROSS, 0.0) * math.hypot(along, across)
    return thickness * math.exp(values.get(THICKNESS, 0.0)), larger * along, larger * across


def fitted_table(table: Mapping[str, Any], values: Mapping[str, float]) -> dict[str, Any]:
    """The same of [skin] as a sensor's file has it; other skins as they are."""
    if table.get("kind") != "layer":
        return {**table}
    found = fitted_layer(table["thickness_mm"], table.get("along", 0.0), table.get("across", 0.0), values)
    known = dict(zip(("thickness_mm", "along", "across"), found, strict=True))
    return {**table, **{key: value for key, value in known.items() if key in table}}
