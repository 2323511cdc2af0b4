"""Indices for people and programs: a JSON document, a CSV of every reading, a table and what it means in words."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from eitsim.sweeps.sobol.sobol_indices import VECTORS, Blocks, Indices

# Columns of the terminal that the table takes, so that a number and its interval stay on one line.
_WIDTH = 150
_UNITS = {"mm2": "mm2", "mm": "mm", "kPa": "kPa"}
_FEW_CARDS = 20  # Cards below which 95 % intervals were seen to cover 81 % of the time only.


def document(found: Indices, blocks: Blocks) -> dict[str, Any]:
    """Plain JSON values of the outputs and of the readings together; null where an output does not vary."""
    whole = _table(found).set_index("output")
    return {"blocks": len(blocks.values), "cards": len(np.unique(blocks.cards)), "blocks_failed": blocks.failed,
            "blocks_unfinished": blocks.unfinished, "factors": list(found.factors), "interval": 0.95,
            "touches_within": found.touches,
            "outputs": {name: {key: None if isinstance(value, float) and math.isnan(value) else value
                               for key, value in whole.loc[name].to_dict().items()}
                        for name in found.names if name in VECTORS or name.split("_")[0] not in VECTORS}}


def write_csv(found: Indices, path: Path) -> None:
    """One row an output, all readings too; empty where an output does not vary."""
    _table(found).to_csv(path, index=False)


def show(whole: dict[str, Any]) -> None:
    """Print what a document holds, and what knowing the card would buy."""
    alone = "material_spread_within" if "material_spread_within" in whole["outputs"]["dv"] else "material_spread"
    table = Table(title="shares of the variance, %, with 95 % intervals", box=SIMPLE, title_justify="left")
    for name in ("output", "deviation", *whole["factors"], "material in all", "at one touch"):
        table.add_column(name, no_wrap=True)
    for name, row in whole["outputs"].items():
        table.add_row(name, _with_unit(row["deviation"], row["unit"]),
                      *(_share(row, f"{factor}_first") for factor in whole["factors"]), _share(row, "material_total"),
                      _with_unit(row[alone], row["unit"]))
    Console(width=_WIDTH).print(table)
    print(f"{whole['blocks']} blocks of two touches with two cards; {whole['blocks_failed']} dropped for a row that "
          f"failed, {whole['blocks_unfinished']} not swept yet. dv and v: rms over their readings. At one touch: "
          f"standard deviation by the card, over {whole['touches_within']} touches.")
    print(_about_cards(whole["cards"], whole["blocks"]))
    for name, what in (("v", "the readings"), ("dv", "their change by the touch"), ("delta_max_mm", "depths")):
        if (share := whole["outputs"][name]["material_first"]) is not None:
            row = whole["outputs"][name]
            size = f", {100 * row[alone] / abs(row['mean']):.2g} % of the {'rms' if name in VECTORS else 'mean'}"
            print(f"Knowing the card would take {100 * max(share, 0.0):.2g} % off the variance of {what}; at one touch "
                  f"it spreads them by {_with_unit(row[alone], row['unit'])}{size}.")


def _about_cards(cards: int, blocks: int) -> str:
    """How many cards the intervals rest on, and what would make them narrower."""
    text = f"Intervals are for touches and cards drawn again, from {cards} cards."
    if cards < _FEW_CARDS:
        text += f" So few tell them roughly: fewer than {_FEW_CARDS} may cover 81 % of the time in place of 95 %."
    if blocks > cards:
        text += f" Each serves about {2 * blocks / cards:.0f} blocks: more draws in [material] narrow them, not scenes."
    return text


def _table(found: Indices) -> pd.DataFrame:
    shares, units = found.shares, [_UNITS.get(name.rsplit("_", 1)[-1], "V") for name in found.names]
    columns: dict[str, Any] = {"output": found.names, "unit": units, "mean": found.mean,
                               "deviation": shares.deviation}
    for i, factor in enumerate(found.factors):
        for kind, value, ends in (("first", shares.first, shares.first_ends), ("total", shares.total,
                                                                               shares.total_ends)):
            columns |= {f"{factor}_{kind}": value[i], f"{factor}_{kind}_lo": ends[0, i],
                        f"{factor}_{kind}_hi": ends[1, i]}
        columns[f"{factor}_spread"] = shares.spread[i]
    if found.within is not None:
        columns["material_spread_within"] = found.within
    return pd.DataFrame(columns)


def _with_unit(value: float, unit: str) -> str:
    scale, shown = (1e3, "mV") if unit == "V" else (1.0, unit)
    return f"{scale * value:.3g} {shown}"


def _share(row: dict[str, Any], key: str) -> str:
    """A share in per cent over its interval; a negative one is an estimate's scatter about none."""
    if row[key] is None:
        return "-"
    value, low, high = (100 * max(row[name], 0.0) for name in (key, f"{key}_lo", f"{key}_hi"))
    return f"{value:.2f} ({low:.2f} to {high:.2f})"
