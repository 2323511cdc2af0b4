"""What a row of a data set tells of its scene: the names of its columns and their values."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from eitsim.scene.curved.curved_scene import is_curved
from eitsim.scene.scene import Punch
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.design.design import Design, most_touches, varied_keys

OWN = {"x_mm": "x_mm", "y_mm": "y_mm", "diameter_mm": "d_mm", "force_N": "F_N"}  # key of [punch] -> its column
EACH_TOUCH = (*parquet.TOUCH, *parquet.OUTPUTS, "wall_contact_mm2")  # columns that every touch of a row has


SPACE = ("x_mm", "y_mm", "z_mm")  # columns of a place on a curved skin


def numbered(column: str, touch: int) -> str:
    """The column of a touch, counted from 0: x_mm of the first one, x_2_mm of the next."""
    name, unit = column.rsplit("_", 1)
    return column if touch == 0 else f"{name}_{touch + 1}_{unit}"


def key_column(table: str, key: str, touch: int = 0) -> str:
    """The column of a key that has none of its own: skin_thickness_um, punch_profile, of the next touch
    punch_2_profile."""
    return f"{table}_{key}" if touch == 0 else f"{table}_{touch + 1}_{key}"


def blank_keys(design: Design) -> dict[str, Any]:
    """Every column that tells of a scene or its touches, empty: NaN of numbers, "" of words, no touches."""
    each = (*EACH_TOUCH, SPACE[2]) if is_curved(design.tables) else EACH_TOUCH
    columns = {numbered(name, k): math.nan for k in range(most_touches(design)) for name in each}
    drawn = {name: "" if isinstance(cell, str) else math.nan for (table, k, key), values in _drawn(design).items()
             for value in values for name, cell in _cells(key_column(table, key, k), value)}
    return {"touches": 0, **columns, **drawn}


def keys_of(design: Design, tables: Mapping[str, Any]) -> dict[str, Any]:
    """What stands in these columns for the scene of these tables (design.tables_at), as drawn."""
    punches = tables["punch"]
    row: dict[str, Any] = {"touches": len(punches)}
    for k, punch in enumerate(punches):
        force = math.nan if "depth_mm" in punch else Punch().force_N
        defaults = {"x_mm": 0.0, "y_mm": 0.0, "diameter_mm": Punch().diameter_m * 1e3, "force_N": force}
        row |= {numbered(column, k): float(punch.get(key, defaults[key])) for key, column in OWN.items()}
        row |= {numbered(column, k): part for column, part in zip(SPACE, punch.get("at_mm", ()), strict=False)}
    for table, k, key in _drawn(design):
        if table != "punch" or k < len(punches):
            held = punches[k] if table == "punch" else tables[table]
            if key in held:
                row |= _cells(key_column(table, key, k), held[key])
    return row


def _drawn(design: Design) -> dict[tuple[str, int, str], tuple[Any, ...]]:
    """(table, touch, key) of every key that is drawn and has no column of its own, and values that have its columns.

    The time of a hold has a column though it be fixed, and so has a force that is drawn: F_N is then that at this time.
    """
    drawn = {(v.table, v.touch, v.key): tuple(value for value in v.distribution.values if value is not None)
             or (math.nan,) for v in varied_keys(design)}
    held = "time_s" in design.tables.get("hold", {})
    if held:
        drawn["hold", 0, "time_s"] = (math.nan,)
    own = {"touches", "place", "u", "v", "at_mm", *OWN} - ({"force_N"} if held else set())
    return {where: values for where, values in drawn.items() if where[0] not in ("", "punch") or where[2] not in own}


def _cells(column: str, value: Any) -> Iterator[tuple[str, Any]]:
    """The column of a number or a word, and of a list one for every number, which ends in its index."""
    if isinstance(value, list | tuple):
        for index, part in enumerate(value):
            yield from _cells(f"{column}_{index}", part)
    else:
        yield column, value if isinstance(value, str) else float(value)
