"""Stored load paths against touches solved afresh: what a table costs, how fast and how far off a touch from it is.

One table of flat punches of 8 to 20 mm in the paper's foam, with what the rim changes: the whole that a sweep over
those diameters anywhere on the disc makes, on two processes, its parts in a row each with their cost and their stated
errors (of the rim's part those of what it adds). Then random diameters and forces far from the rim (log-uniform in
force from 1e-3 N to 1.3 mu_0 pi d^2), and near it (gaps log-uniform from 2 to 40 mm, forces from 0.01 N to 0.5 mu_0 pi
d^2). Errors are relative to the touch solved afresh: depth, stretches of the surface (L2, only the axisymmetric ones),
largest pressure, contact area, and the 208 signals dV (2-norm); stored_ms is the time to serve the mechanics of a
touch, or to read a table from the disk. Run by `make bench`, which pins threads; writes results/reuse.csv beside this
file.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
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
NEAR_TOUCHES, WORKERS = 16, 2


def made() -> tuple[Table, list[dict[str, object]]]:
    """The table, solved into an empty cache, and what its parts took."""
    shape = shape_of(TABLE_1, Body(), Punch(), "normal", [SMALLEST_M, LARGEST_M], spans=True)
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(
            WORKERS, mp_context=multiprocessing.get_context("spawn")) as pool:
        os.environ["TOUCHCAL_CACHE"] = folder
        begun = time.perf_counter()
        table, _ = table_for(shape, pool.map)
        paths, begun, first = time.perf_counter() - begun, time.perf_counter(), held_MB()
        table, _ = table_for(shape, pool.map, rim=True)
        changes, begun = time.perf_counter() - begun, time.process_time()
        table_for(shape, rim=True)
        read, rim = time.process_time() - begun, table.rim
        assert rim is not None
        return table, [
            {"what": f"table of {len(shape.solved)} diameters x {len(table.depths)} depths", "table_MB": first,
             "cpu_s": table.cpu_s, "wall_s": paths, "depth_error": table.error.depth,
             "signal_error": table.error.signal, "strain_error_L2": table.error.strain},
            {"what": f"with the rim, {len(rim.diameters)} x {len(rim.gaps)} gaps x {len(rim.depths)} depths",
             "table_MB": held_MB(), "cpu_s": rim.cpu_s, "wall_s": changes, "stored_ms": read * 1e3,
             "depth_error": rim.error.depth, "signal_error": rim.error.signal}]


def held_MB() -> float:
    return sum(entry.size_bytes for entry in cache.entries()) / 1e6


def strain_error(touch: Touch, fresh: Touch) -> float:
    """Relative error of the three stretches of the surface in L2 over its area."""
    r = fresh.radius_m
    pairs = [(np.interp(r, touch.radius_m, getattr(touch, name)), getattr(fresh, name))
             for name in ("stretch_meridian", "stretch_hoop", "stretch_normal")]
    missed, strain = (sum(np.trapezoid(part**2 * r, r) for part in parts)
                      for parts in ([a - b for a, b in pairs], [b - 1 for _, b in pairs]))
    return float(np.sqrt(missed / strain))


def row(table: Table, punch: Punch, near: bool) -> dict[str, object]:
    """One touch from the table and afresh."""
    gap = Body().radius_m - float(np.hypot(punch.x_m, punch.y_m)) - punch.diameter_m / 2
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


def punches(near: bool) -> Iterator[Punch]:
    """Random punches far from the rim, or near it."""
    rng, (least_N, most) = np.random.default_rng(SEED), (1e-2, 0.5) if near else (1e-3, 1.3)
    for _ in range(NEAR_TOUCHES if near else TOUCHES):
        diameter = float(rng.uniform(SMALLEST_M, LARGEST_M))
        force = float(np.exp(rng.uniform(np.log(least_N), np.log(most * TABLE_1.mu_0_Pa * np.pi * diameter**2))))
        gap = float(np.exp(rng.uniform(np.log(2e-3), np.log(40e-3))))
        at = (Body().radius_m - diameter / 2 - gap, 0.0) if near else (0.02, -0.01)
        yield Punch(*at, diameter_m=diameter, force_N=force)


def main() -> None:
    RESULTS.mkdir(exist_ok=True)
    table, rows = made()
    for near in (False, True):
        rows += [row(table, punch, near) for punch in punches(near)]
        found = pd.DataFrame(rows)
        found.to_csv(RESULTS / "reuse.csv", index=False, float_format="%.4g")
    print(found.to_string(index=False))
    for what, touches in found.groupby("what"):
        for name in ("depth_error", "signal_error", "strain_error_L2", "sigma_max_error", "area_error"):
            print(what, name, *np.quantile(touches[name], [0.5, 0.95, 1.0]))


if __name__ == "__main__":
    main()
