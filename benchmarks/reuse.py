"""Stored load paths against touches solved afresh: what a table costs, how fast and how far off a touch from it is.

One table of flat punches of 8 to 20 mm in the paper's foam, then random diameters and forces (uniform in diameter,
log-uniform in force from 1e-3 N to 1.3 mu_0 pi d^2) far from the rim; one of 14 mm with what the rim changes, then
random gaps to the rim and forces. Errors are relative to the touch solved afresh on the same mesh: depth, stretches of
the surface (L2, far from the rim only its own), largest pressure, contact area, and the 208 signals dV (2-norm). Run by
`make bench`, which pins threads; writes results/reuse.csv beside this file; a table's own row holds its cost and its
stated errors (with the rim, those of what the rim adds).
"""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from eitsim import cache
from eitsim.axisymmetric import solve_touch
from eitsim.electrics import solve
from eitsim.near_rim import solve_near_rim
from eitsim.results import Touch
from eitsim.reuse import table_for
from eitsim.rim_table import near_rim_from
from eitsim.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.table import Table, shape_of, touch_from
from matcal.conductivity import Conductivity
from matcal.hyperfoam import Hyperfoam

RESULTS = Path(__file__).parent / "results"
TABLE_1 = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
SKIN_LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
SMALLEST_M, LARGEST_M, TOUCHES, SEED = 0.008, 0.020, 40, 5
MIDDLE_M, NEAR_TOUCHES = 0.014, 12


def made(smallest_m: float, largest_m: float, rim: bool) -> tuple[Table, dict[str, object]]:
    """The table, solved into an empty cache and read from it again, and what it took."""
    spans = largest_m > smallest_m
    diameters_m = [smallest_m, largest_m] if spans else [smallest_m]
    shape = shape_of(TABLE_1, Body(), Punch(), "normal", diameters_m, spans=spans)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["TOUCHCAL_CACHE"] = folder
        table, _ = table_for(shape, rim=rim)
        begun = time.process_time()
        table_for(shape, rim=rim)
        read = time.process_time() - begun
        size = sum(entry.size_bytes for entry in cache.entries())
    what = f"table of {len(shape.solved)} diameters x {len(table.depths)} depths"
    error, spent = table.error, table.cpu_s
    if table.rim is not None:
        what += f", rim {len(table.rim.diameters)} x {len(table.rim.gaps)} gaps x {len(table.rim.depths)} depths"
        error, spent = table.rim.error, spent + table.rim.cpu_s
    return table, {"what": what, "table_MB": size / 1e6, "cpu_s": spent, "stored_ms": read * 1e3,
                   "depth_error": error.depth, "signal_error": error.signal, "strain_error_L2": error.strain}


def strain_error(touch: Touch, fresh: Touch) -> float:
    """Relative error of the three stretches of the surface in L2 over its area."""
    r = fresh.radius_m
    pairs = [(np.interp(r, touch.radius_m, getattr(touch, name)), getattr(fresh, name))
             for name in ("stretch_meridian", "stretch_hoop", "stretch_normal")]
    missed, strain = (sum(np.trapezoid(part**2 * r, r) for part in parts)
                      for parts in ([a - b for a, b in pairs], [b - 1 for _, b in pairs]))
    return float(np.sqrt(missed / strain))


def row(table: Table, punch: Punch) -> dict[str, object]:
    """One touch from the table and afresh."""
    gap = Body().radius_m - float(np.hypot(punch.x_m, punch.y_m)) - punch.diameter_m / 2
    near = table.rim is not None
    begun = time.process_time()
    stored = touch_from(table, TABLE_1, Body(), punch, "normal")
    if near and stored is not None:
        stored = near_rim_from(table, stored, Body(), punch)
    spent = time.process_time() - begun
    fresh = (solve_near_rim if near else solve_touch)(TABLE_1, Body(), punch)
    out: dict[str, object] = {"what": "touch near the rim" if near else "touch", "gap_mm": gap * 1e3,
                              "d_mm": punch.diameter_m * 1e3, "F_N": punch.force_N,
                              "depth_mm": fresh.depth_m * 1e3, "cpu_s": fresh.cpu_s, "stored_ms": spent * 1e3}
    if stored is None:
        return out | {"what": f"{out['what']}, beyond the table"}
    signals = [solve(Body(), Skin(), Electrodes(), Drive(), ((punch, touch),), SKIN_LAW, signal=1e-3).signal_V
               for touch in (stored, fresh)]
    return out | {"depth_error": abs(stored.depth_m / fresh.depth_m - 1),
                  "signal_error": float(np.linalg.norm(signals[0] - signals[1]) / np.linalg.norm(signals[1])),
                  "strain_error_L2": strain_error(stored, fresh),
                  "sigma_max_error": abs(stored.sigma_max_Pa / fresh.sigma_max_Pa - 1),
                  "area_error": abs(stored.contact_area_m2 / fresh.contact_area_m2 - 1)}


def far() -> list[dict[str, object]]:
    table, first = made(SMALLEST_M, LARGEST_M, False)
    rng, rows = np.random.default_rng(SEED), [first]
    for _ in range(TOUCHES):
        diameter = rng.uniform(SMALLEST_M, LARGEST_M)
        force = np.exp(rng.uniform(np.log(1e-3), np.log(1.3 * TABLE_1.mu_0_Pa * np.pi * diameter**2)))
        rows.append(row(table, Punch(x_m=0.02, y_m=-0.01, diameter_m=float(diameter), force_N=float(force))))
    return rows


def near() -> list[dict[str, object]]:
    table, first = made(MIDDLE_M, MIDDLE_M, True)
    rng, rows = np.random.default_rng(SEED), [first]
    for _ in range(NEAR_TOUCHES):
        gap, force = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in ((1e-3, 25e-3), (0.05, 3.0)))
        rows.append(row(table, Punch(x_m=Body().radius_m - MIDDLE_M / 2 - gap, diameter_m=MIDDLE_M, force_N=force)))
    return rows


def main() -> None:
    RESULTS.mkdir(exist_ok=True)
    rows: list[dict[str, object]] = []
    for part in (far, near):
        rows += part()
        found = pd.DataFrame(rows)
        found.to_csv(RESULTS / "reuse.csv", index=False, float_format="%.4g")
    print(found.to_string(index=False))
    for what, touches in found.groupby("what"):
        for name in ("depth_error", "signal_error", "strain_error_L2", "sigma_max_error", "area_error"):
            print(what, name, *np.quantile(touches[name], [0.5, 0.95, 1.0]))


if __name__ == "__main__":
    main()
