"""Surrogates of skins with an outline: seconds of sweep and training, errors on test rows, coverage of 90 % intervals.

A rectangle of 120 x 80 mm with 32 electrodes and 928 readings, 4,000 scenes, and an L of 200 mm with 24 electrodes and
504 readings, 1,000 scenes: a punch of 10 mm on 5 mm of table 1's foam, 0.02 to 0.5 N, signal = 0.02, as far from edges
as the plan asks for. "rectangle to its edges" has 1,200 scenes, evenly spread over what is 1 mm or more from the edges
and near one of them at most; rows score touches near one edge and the others separately. Each method is trained and
scored without noise and at 80 dB below the RMS of the untouched readings. Rows "near an edge" are touches 0.5 to 15 mm
from an edge of the rectangle, solved anew and read by its forward models: how many these flag, and how many of the 90 %
intervals of y hold. "known" is the part of the skin where the forward model reads touches. Writes
results/outline_surrogate.csv.

    python benchmarks/outline_surrogate.py [FOLDER [CASE ...]]

FOLDER keeps the sweeps; one that is there is not swept again, and its own account tells its seconds. CASE names those
to run, others stay as they are.
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written
from outline_sweep import CARD, PUNCH, design_of

import eitsim
import surrogate
from eitsim.scene.drive import voltage_columns
from eitsim.scene.scene import Punch
from eitsim.sweeps.design.design import Design, design_from, flat_scene
from eitsim.sweeps.measurement.instrument import below
from eitsim.sweeps.run.account import account_of
from surrogate.data.samples import PARTS

L_SHAPE = {"seed": 6, "body": {"outline": "polygon", "thickness_mm": 5, "points_mm": [
    [0, 0], [200, 0], [200, 80], [80, 80], [80, 200], [0, 200]]},
    "electrodes": {"count": 24, "width_mm": 8}, "punch": PUNCH, "accuracy": {"signal": 0.02}}
TO_EDGES = "rectangle to its edges"
HALF_MM = np.array([60.0, 40.0])  # half the sides of the rectangle
# Of scenes to its edges: least distance of the axis to the nearest edge, and to the next one, mm.
NEAREST_MM, NEXT_MM = 6.0, 23.9


def places_to_edges(count: int) -> list[list[float]]:
    """So many places (x, y), mm, of the rectangle, evenly spread over what is near one edge at most."""
    rng, found = np.random.default_rng(12), []
    while len(found) < count:
        x, y = rng.uniform(-HALF_MM[0], HALF_MM[0]), rng.uniform(-HALF_MM[1], HALF_MM[1])
        nearest, following = np.sort(HALF_MM - np.abs([x, y]))
        if nearest >= NEAREST_MM and following >= NEXT_MM:
            found.append([round(float(x), 4), round(float(y), 4)])
    return found


_PLACED = quick(1200, 60)
CASES = {"rectangle": (design_of(PUNCH, quick(4000, 60)), ("forward", "ridge")),
         TO_EDGES: (design_of(PUNCH | {"place": {"list": places_to_edges(_PLACED)}}, _PLACED), ("forward",)),
         "L": (design_from(L_SHAPE, quick(1000, 60)), quick(("forward", "ridge", "network", "gp"), ("forward",)))}
NOISE_DB = (np.inf, 80.0)
SHOWN = ("x0", "y0", "F")
# Outputs: the column of a data set, that of a prediction, and the latter's unit over the former's.
TARGETS = {"x0": ("x_mm", "m", 1e3), "y0": ("y_mm", "m", 1e3), "F": ("F_N", "N", 1.0)}
GAPS_MM = quick((0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 9.0, 11.0, 13.0, 15.0), (1.0,))


def rows_of(case: str, folder: Path) -> Iterator[dict[str, Any]]:
    design, methods = CASES[case]
    data = eitsim.sweep(design, CARD, folder, reuse=True)
    account = account_of(folder)
    yield {"case": case, "what": "sweep", "count": account.rows, "cpu_s": account.cpu_s}
    for method in methods:
        model = surrogate.train(folder, method=method, outputs=SHOWN, seed=1)
        yield {"case": case, "what": "training", "method": method, "count": account.rows, "cpu_s": model.fit_s}
        table = data.ok.loc[model.rows.part == PARTS.index("test")]
        table = table.loc[model.learner.reads(table[["x_mm", "y_mm", "d_mm", "F_N"]].to_numpy())]
        for noise_dB in NOISE_DB if len(table) else ():  # of a quick run's few test rows a model may read none
            yield from scored(case, model, table, noise_dB)
        if case in ("rectangle", TO_EDGES) and method == "forward":
            yield from near_an_edge(case, model, design)
            yield {"case": case, "what": "known", "method": method, "share": known_share(model)}


def known_share(model: surrogate.SweepModel) -> float:
    """Part of the rectangle where a model reads touches."""
    x, y = np.meshgrid(*(np.arange(-half + 0.25, half, 0.5) for half in HALF_MM))
    flat = np.full(x.size, PUNCH["diameter_mm"])
    return float(np.mean(model.learner.reads(np.column_stack([x.ravel(), y.ravel(), flat, flat]))))


def scored(case: str, model: surrogate.SweepModel, table: pd.DataFrame, noise_dB: float) -> Iterator[dict[str, Any]]:
    """Errors and coverage of rows of a data set, by noise below the RMS of the untouched readings; of those near an
    edge and the others separately where both are known."""
    count = len(model.baseline_V)
    touched = table[voltage_columns(count)].to_numpy()
    noise_V = below(noise_dB, float(np.sqrt(np.mean(model.baseline_V**2)))) if np.isfinite(noise_dB) else 0.0
    begun = time.process_time()
    found = model.predict(touched + noise_V * np.random.default_rng(1).normal(size=touched.shape), noise_V=noise_V)
    each_ms = 1e3 * (time.process_time() - begun) / len(table)
    near = table["mechanics_method"].str.contains("near the rim").to_numpy()
    parts = {"near one edge": near, "away from edges": ~near} if near.any() else {"": ~near}
    for name, (column, unit, scale) in TARGETS.items():
        target = table[column].to_numpy()
        value, low, high = (scale * found[f"{name}{end}_{unit}"].to_numpy() for end in ("", "_lo90", "_hi90"))
        error, held = np.abs(value - target), (low <= target) & (target <= high)
        for where, kept in parts.items():
            yield {"case": case, "what": name, "where": where, "method": model.method, "noise_dB": noise_dB,
                   "count": int(kept.sum()), "median": float(np.median(error[kept])),
                   "q90": float(np.quantile(error[kept], 0.9)), "held": float(np.mean(held[kept])),
                   "each_ms": each_ms, "flagged": int((found["flag"] != "")[kept].sum())}


def near_an_edge(case: str, model: surrogate.SweepModel, design: Design) -> Iterator[dict[str, Any]]:
    """How many of some touches near an edge, solved anew, are flagged, the median error of y and how many of its
    intervals hold, of all and of those that are not flagged."""
    scene, rng = flat_scene(design), np.random.default_rng(3)
    assert scene.body.outline.height_m is not None
    touches, frames = [], []
    for gap in GAPS_MM:
        y_mm = 1e3 * scene.body.outline.height_m / 2 - gap - PUNCH["diameter_mm"] / 2
        punch = Punch(float(rng.uniform(-0.03, 0.03)), 1e-3 * y_mm, 1e-3 * PUNCH["diameter_mm"],
                      force_N=float(rng.uniform(0.05, 0.4)))
        solved = eitsim.simulate(replace(scene, punches=(punch,)), CARD)
        assert solved.readings is not None, solved.message
        touches.append(punch.y_m)
        frames.append(solved.readings.touched_V.ravel())
    found = model.predict(np.array(frames), solved.readings.baseline_V.ravel(), noise_V=0.0)
    held = ((found["y0_lo90_m"] <= touches) & (touches <= found["y0_hi90_m"])).to_numpy()
    off_mm, flagged = 1e3 * np.abs(found["y0_m"].to_numpy() - touches), (found["flag"] != "").to_numpy()
    for what, kept in (("near an edge", held | ~held), ("near an edge, not flagged", ~flagged)):
        if kept.any():
            yield {"case": case, "what": what, "method": model.method, "count": int(kept.sum()),
                   "median": float(np.median(off_mm[kept])), "flagged": int(flagged[kept].sum()),
                   "held": float(held[kept].mean())}


def main() -> None:
    kept, cases = Path(sys.argv[1]) if sys.argv[1:] else None, sys.argv[2:] or list(CASES)
    before = earlier("outline_surrogate")
    before = before[~before["case"].isin(cases)] if len(before) else before
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for case in cases:
            rows += rows_of(case, (kept or Path(folder)) / case)
            shown(written(pd.concat([before, pd.DataFrame(rows)], ignore_index=True), "outline_surrogate", 3))


if __name__ == "__main__":
    main()
