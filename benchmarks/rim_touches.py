"""How far touches near the rim are off finer solutions on the whole disc, and the errors they state.

Random places up to 25 mm from the rim, all bearings, 10 to 18 mm, 0.1 to 2 N, Table 1; "deep" touches, 10 and 12 mm
at 1.4 to 2 N and 1 to 8 mm, are where the rim changes most. Run by `make bench`, which pins threads; writes
results/rim_touches.csv.
"""

import time

import numpy as np
from conditions import quick, shown, written
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.solve_forward import solve
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.simulation.near_edges import solve_near_rim
from touchcal.errors import NotConverged

# kind of touch: diameters mm, forces N and gaps mm, from and to; touches, and those of a quick run
KINDS = {"any": ((10, 18), (0.1, 2.0), (0.5, 25.0), 20, 2), "deep": ((10, 12), (1.4, 2.0), (1.0, 8.0), 8, 1)}


def drawn(kind: str, rng: np.random.Generator) -> Punch:
    """A punch at a random place near the rim."""
    diameters, forces, gaps = KINDS[kind][:3]
    diameter, force, gap = (float(rng.uniform(*ends)) for ends in (diameters, forces, gaps))
    away, bearing = Body().radius_m - (diameter / 2 + gap) / 1e3, float(rng.uniform(0, 2 * np.pi))
    return Punch(x_m=away * np.cos(bearing), y_m=away * np.sin(bearing), diameter_m=diameter / 1e3, force_N=force)


def signal(punch: Punch, touch: Touch) -> np.ndarray:
    return solve(Body(), Skin(), Electrodes(), Drive(), ((punch, touch),), SKIN_LAW, method="mesh").signal_V


def compared(kind: str, punch: Punch) -> dict[str, object]:
    """A touch's deviation from the finer solution, and what it tells."""
    row: dict[str, object] = {"kind": kind, "d_mm": punch.diameter_m * 1e3, "F_N": punch.force_N,
                              "gap_mm": (Body().radius_m - np.hypot(punch.x_m, punch.y_m) - punch.diameter_m / 2) * 1e3}
    begun = time.process_time()
    try:
        touch = solve_near_rim(TABLE_1, Body(), punch)
        row["cpu_s"] = time.process_time() - begun
        finer = solve_near_rim(TABLE_1, Body(), punch, whole=True)
    except NotConverged:
        return row | {"outcome": "not_converged"}
    one, other = signal(punch, touch), signal(punch, finer)
    off, error_estimate = float(np.linalg.norm(one - other) / np.linalg.norm(other)), touch.signal_errors[0]
    return row | {"outcome": "ok", "depth_mm": touch.depth_m * 1e3, "signal_off": off, "signal_told": error_estimate,
                  "told_over_off": error_estimate / off, "depth_off": abs(touch.depth_m / finer.depth_m - 1),
                  "depth_told": touch.depth_error, "finer_cpu_s": time.process_time() - begun - row["cpu_s"]}


def main() -> None:
    rows = []
    for kind, (*_, count, few) in KINDS.items():
        rng = np.random.default_rng(1)
        rows += [compared(kind, drawn(kind, rng)) for _ in range(quick(count, few))]
    shown(written(rows, "rim_touches"))


if __name__ == "__main__":
    main()
