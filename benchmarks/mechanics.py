"""Error against run time of one touch: element size at the punch's edge against a mesh four times finer than default.

Run by `make bench`, which pins threads; writes results/mechanics.csv beside this file.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pandas as pd

from eitsim.axisymmetric import solve_touch
from eitsim.mesh import default_element_m
from eitsim.results import Touch
from eitsim.scene import Body, Punch
from matcal.hyperfoam import Hyperfoam

RESULTS = Path(__file__).parent / "results"
TABLE_1 = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0])
CASES = ((0.010, 2.0), (0.014, 1.0), (0.018, 0.5))
# element size over the default one; the last is the reference
SIZES = (4.0, 2.0, 1.0, 0.5, 0.25)
REPEATS = 3


def solved(punch: Punch, size: float, repeats: int) -> tuple[Touch, float]:
    """The touch and its median CPU time."""
    seconds = []
    for _ in range(repeats):
        begun = time.process_time()
        touch = solve_touch(TABLE_1, Body(), punch, element_m=size * default_element_m(Body(), punch))
        seconds.append(time.process_time() - begun)
    return touch, float(np.median(seconds))


def field_error(touch: Touch, reference: Touch) -> float:
    """Relative error of the through-thickness strain of the surface in L2 over its area."""
    r, strain = reference.radius_m, reference.stretch_normal - 1
    difference = np.interp(r, touch.radius_m, touch.stretch_normal - 1) - strain
    return float(np.sqrt(np.trapezoid(difference**2 * r, r) / np.trapezoid(strain**2 * r, r)))


def rows(diameter_m: float, force_N: float) -> list[dict[str, object]]:
    punch = Punch(diameter_m=diameter_m, force_N=force_N)
    reference, _ = solved(punch, SIZES[-1], 1)
    out = []
    for size in SIZES[:-1]:
        touch, seconds = solved(punch, size, REPEATS)
        out.append({"touch": f"d = {diameter_m * 1e3:g} mm, {force_N:g} N",
                    "element_um": size * default_element_m(Body(), punch) * 1e6,
                    "depth_mm": touch.depth_m * 1e3, "depth_error": abs(touch.depth_m / reference.depth_m - 1),
                    "depth_estimate": touch.depth_error, "strain_error_L2": field_error(touch, reference),
                    "sigma_max_error": abs(touch.sigma_max_Pa / reference.sigma_max_Pa - 1),
                    "signal_estimate": touch.signal_error, "cpu_s": seconds})
    return out


def main() -> None:
    solve_touch(TABLE_1, Body(), Punch())  # compiles the kernels
    table = pd.DataFrame([row for case in CASES for row in rows(*case)])
    RESULTS.mkdir(exist_ok=True)
    table.to_csv(RESULTS / "mechanics.csv", index=False, float_format="%.4g")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
