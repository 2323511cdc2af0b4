"""Sweeps of a rectangle of 120 x 80 mm with 32 electrodes and 928 readings: CPU seconds by stage, with tables.

"far": 4,000 touches that keep from all edges what the plan asks for. "near": touches that keep 1 mm, most of them near
one straight edge, where a table serves what it changes; those in corners are solved one by one. Rows "against" give
how far some of the rows near an edge are off the same touches solved anew. A punch of 10 mm on 5 mm of table 1's foam,
0.02 to 0.5 N, signal = 0.02; one process. Writes results/outline_sweep.csv; arguments name the cases to run, others
stay as they are.
"""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written

import eitsim
from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.design.design import Design, design_from, scene_at
from eitsim.sweeps.run.account import account_of
from matcal.card import MaterialCard
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "longterm")  # paper, table 1
CARD = MaterialCard("table 1", FOAM, None, Conductivity(30.0, [-2, 2, -1], (-0.5, 0.4)))
PUNCH = {"diameter_mm": 10, "force_N": [0.02, 0.5]}
CASES = {"far": (PUNCH, quick(4000, 20)), "near": (PUNCH | {"place": {"gap_mm": 1}}, quick(400, 20))}
COMPARED = quick(8, 1)  # Rows from the table near an edge that are solved anew.


def design_of(punch: dict[str, Any], scenes: int) -> Design:
    return design_from({
        "seed": 5, "body": {"outline": "rectangle", "width_mm": 120, "height_mm": 80, "thickness_mm": 5},
        "electrodes": {"count": 32, "width_mm": 6}, "punch": punch, "accuracy": {"signal": 0.02}}, scenes)


def rows_of(case: str) -> Iterator[dict[str, Any]]:
    design = design_of(*CASES[case])
    with tempfile.TemporaryDirectory() as folder:
        data = eitsim.sweep(design, CARD, folder, reuse=True)
        account = account_of(Path(folder))
        print(case, data.account, flush=True)
        for stage in account.stages:
            yield {"case": case, "what": stage.name, "count": stage.count, "cpu_s": stage.cpu_s}
        yield {"case": case, "what": "whole", "count": account.rows, "cpu_s": account.cpu_s,
               "error": account.errors and account.errors.median, "largest": account.errors and account.errors.largest}
        for outcome, count in account.outcomes.items():
            yield {"case": case, "what": f"rows that are {outcome}", "count": count}
        table = data.ok
        for row in table.loc[table["mechanics_method"] == "table near the rim"].head(COMPARED).to_dict("records"):
            yield against_fresh(case, row, design)


def against_fresh(case: str, row: dict[str, Any], design: Design) -> dict[str, Any]:
    """How far a row's dV, 2-norm, is off the scene solved without tables, and what the row states."""
    fresh = eitsim.simulate(scene_at(design, int(row["scene"])), CARD)
    assert fresh.readings is not None
    signal = fresh.readings.signal_V.ravel()
    stored = np.array([row[name] for name in voltage_columns(signal.size, "dv")])
    return {"case": case, "what": "against a touch solved anew", "count": 1, "cpu_s": fresh.cost["cpu_s"],
            "error": row["signal_error"], "off": float(np.linalg.norm(stored - signal) / np.linalg.norm(signal))}


def main() -> None:
    cases = sys.argv[1:] or list(CASES)
    kept = earlier("outline_sweep")
    kept = kept[~kept["case"].isin(cases)] if len(kept) else kept
    found = pd.DataFrame([row for case in cases for row in rows_of(case)])
    shown(written(pd.concat([kept, found], ignore_index=True), "outline_sweep", 3))


if __name__ == "__main__":
    main()
