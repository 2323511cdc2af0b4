"""Rows of a data set: the scenes of a design solved, one row each, whatever their outcome."""

import math
from contextlib import suppress
from typing import Any

import numpy as np

from eitsim.electrics.forward.gridded_fields import values
from eitsim.mechanics.curved.moved_touches import MovedTable
from eitsim.mechanics.load_paths.types import Table
from eitsim.scene.curved.curved_scene import AnyScene, CurvedScene, any_scene, electrode_count
from eitsim.scene.drive import protocol, voltage_columns
from eitsim.scene.results import Result, Touch
from eitsim.scene.scene import Scene
from eitsim.simulation.curved.solve_curved_scene import solve_curved_scene
from eitsim.simulation.layers.layer_readings import share_extrapolated
from eitsim.simulation.material import Material, material_of
from eitsim.simulation.result_json import mechanical
from eitsim.simulation.routes.known_routes import ROUTES
from eitsim.simulation.simulate import solve_scene
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.dataset.touch_kinds import KIND
from eitsim.sweeps.design.card_draws import Cards, card_at, columns, recorded
from eitsim.sweeps.design.design import Design, card_number, representative_scene, tables_at
from eitsim.sweeps.run.load_path_choice import AnyTable
from eitsim.sweeps.run.row_columns import blank_keys, keys_of, numbered
from touchcal.jit import cpu_s

_KINDS = {route.kind for route in ROUTES}

def solve_rows(design: Design, cards: Cards, indices: list[int], *, exact: bool = False,
               table: AnyTable | None = None) -> list[dict[str, Any]]:
    """Rows of these scenes, solved as by `solve_scene`; one that cannot be made is "refused", what it raises is
    raised. Where the design asks for fields, those of a solved scene are its row's "fields"."""
    blank = blank_row(design, cards)
    return [blank | {"scene": index} | _row(design, cards, index, exact, table) for index in indices]


def crashed_row(design: Design, cards: Cards, index: int, reason: str) -> dict[str, Any]:
    """The row of a scene whose solution raised what it should not, or took its process with it."""
    keys = recorded(cards, card_number(design, index))
    with suppress(ValueError):  # a scene that cannot be made has no places to tell
        keys |= keys_of(design, tables_at(design, index))
    return blank_row(design, cards) | {"scene": index} | keys | {"outcome": "crashed", "message": reason}


def _row(design: Design, cards: Cards, index: int, exact: bool, table: AnyTable | None) -> dict[str, Any]:
    number = card_number(design, index)
    keys: dict[str, Any] = recorded(cards, number)
    try:
        tables = tables_at(design, index)
        keys |= keys_of(design, tables)
        scene = any_scene(tables)
        material = material_of(scene.flat if isinstance(scene, CurvedScene) else scene, card_at(cards, number))
    except np.linalg.LinAlgError:  # a ValueError, and no refusal
        raise
    except ValueError as error:
        return keys | {"outcome": "refused", "message": str(error)}
    result = _solved(scene, material, exact, table)
    row: dict[str, Any] = keys | {"outcome": result.outcome, "message": result.message} | _values(result)
    if result.readings is not None:
        row[parquet.EXTRAPOLATED] = share_extrapolated(scene, result.touches, material.skin)
    if design.fields is not None and result.readings is not None and isinstance(scene, Scene):
        begun = cpu_s()
        row["fields"] = values(design.fields, scene, result.touches, material.skin)
        row["fields_cpu_s"] = cpu_s() - begun
        row["cpu_s"] += row["fields_cpu_s"]
    return row


def _solved(scene: AnyScene, material: Material, exact: bool, table: AnyTable | None) -> Result:
    if isinstance(scene, CurvedScene):
        return solve_curved_scene(scene, material, exact=exact, table=table if isinstance(table, MovedTable) else None,
                                  compared=False)
    return solve_scene(scene, material, exact=exact, bodies=exact, table=table if isinstance(table, Table) else None)


def blank_row(design: Design, cards: Cards) -> dict[str, Any]:
    """A row without numbers, so that every part has the same columns and types."""
    first = representative_scene(design)
    readings = math.prod(protocol(first.drive, electrode_count(first)).shape)
    names = ("signal_error", "depth_error", *parquet.COST, "skin_fraction_extrapolated", parquet.EXTRAPOLATED,
             "fraction_non_elliptic", *columns(cards), *voltage_columns(readings), *voltage_columns(readings, "dv"))
    words = dict.fromkeys(("outcome", "message", KIND, *parquet.METHODS), "")
    return {"scene": -1, **words, "card_sample": -1} | blank_keys(design) | dict.fromkeys(names, np.nan)


def _values(result: Result) -> dict[str, Any]:
    if result.readings is None:
        return {"cpu_s": result.cost["cpu_s"]}
    row = {KIND: ", ".join(dict.fromkeys(one.kind for one in result.plan.decisions if one.kind in _KINDS)),
           "mechanics_method": ", ".join(dict.fromkeys(_method(touch) for touch in result.touches)),
           "electrics_method": result.readings.method, "signal_error": result.error_estimate["signal"],
           "depth_error": result.error_estimate["depth"], "cpu_s": result.cost["cpu_s"],
           "mechanics_cpu_s": sum(touch.cpu_s for touch in result.touches), "electrics_cpu_s": sum(
               {id(r): r.cpu_s for r in (result.readings, *(m.readings for m in result.moments))}.values()),
           "skin_fraction_extrapolated": result.readings.skin_fraction_extrapolated,
           "fraction_non_elliptic": max(touch.fraction_non_elliptic for touch in result.touches)}
    for k, touch in enumerate(result.touches):
        block = mechanical(touch)
        row |= {numbered(name, k): value for name, value in {"F_N": block.pop("force_N"), **block}.items()}
    touched, signal = result.readings.touched_V.ravel(), result.readings.signal_V.ravel()
    row |= dict(zip(voltage_columns(touched.size), touched.tolist(), strict=True))
    return row | dict(zip(voltage_columns(signal.size, "dv"), signal.tolist(), strict=True))


def _method(touch: Touch) -> str:
    """How a touch was solved: a stored one took no iterations."""
    how = "table" if touch.iterations == 0 else "solved"
    if touch.rim is None:
        return how
    return f"{how} with a neighbour" if touch.rim.neighbour else f"{how} near the rim"
