"""Stiff and extreme cases of material and touch: what holds, what is lost, and what it cost.

Run by `make bench`; writes results/stiff.csv next to this file. Electrical cases are in results/electrics_stiff.csv.
depth_mm has eight digits, for laws and forces that are to give the same depth.
"""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from conditions import shown, written
from materials import TABLE_1
from scipy.optimize import brentq

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.scene import Body, Punch
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.stability import stability
from touchcal.errors import NotConverged


def scan() -> Iterator[dict[str, object]]:
    """Stable range of Table 1, its ends against the roots of h(lambda) = sum mu_i lambda^alpha_i."""
    begun = time.process_time()
    found = stability(TABLE_1)
    seconds = time.process_time() - begun
    exact = [float(brentq(lambda x: float(np.sum(TABLE_1.mu_Pa * x**TABLE_1.alpha)), *ends, xtol=1e-14)) - 1
             for ends in ((0.2, 0.55), (0.55, 0.9))]
    ((low, high),) = found["drucker"]["uniaxial"]["unstable_strain"]  # type: ignore[misc]
    yield {"case": "Table 1, Drucker in uniaxial compression", "outcome": f"lost from {low:.4f} to {high:.4f}",
           "error": max(abs(low - exact[0]), abs(high - exact[1])), "cpu_s": seconds}
    for mode in ("uniaxial", "biaxial", "shear"):
        ranges: Any = found["elliptic"][mode]["unstable_strain"]
        yield {"case": f"Table 1, strong ellipticity in {mode}",
               "outcome": f"lost from {' and from '.join(f'{low:.4f} to {high:.4f}' for low, high in ranges)}"
               if ranges else "kept", "error": np.nan, "cpu_s": np.nan}


def touches() -> Iterator[dict[str, object]]:
    softer, stiffer = (Hyperfoam(TABLE_1.mu_Pa * s, TABLE_1.alpha, TABLE_1.nu) for s in (1e-3, 1e3))
    cases = [("d = 10 mm, 2 N", TABLE_1, Punch(diameter_m=0.01, force_N=2.0)),
             ("d = 10 mm, 4 N", TABLE_1, Punch(diameter_m=0.01, force_N=4.0)),
             ("d = 8 mm, 3 N", TABLE_1, Punch(diameter_m=0.008, force_N=3.0)),
             ("d = 14 mm, 0.001 N", TABLE_1, Punch(diameter_m=0.014, force_N=1e-3)),
             ("d = 14 mm, 1 mN, mu x 1e-3", softer, Punch(diameter_m=0.014, force_N=1e-3)),
             ("d = 14 mm, 1 kN, mu x 1e3", stiffer, Punch(diameter_m=0.014, force_N=1e3)),
             ("d = 14 mm, 20 N", TABLE_1, Punch(diameter_m=0.014, force_N=20.0)),
             ("d = 14 mm, 1 N, fillet 0.1 mm", TABLE_1, Punch(diameter_m=0.014, fillet_m=1e-4)),
             ("d = 14 mm, 1 N, nu = 0.3", Hyperfoam(TABLE_1.mu_Pa, TABLE_1.alpha, [0.3, 0.3, 0.3]), Punch())]
    for name, law, punch in cases:
        begun = time.process_time()
        try:
            touch = solve_touch(law, Body(), punch)
            share = f"{100 * touch.fraction_non_elliptic:.2g} %" if touch.fraction_non_elliptic else "none"
            outcome = f"{touch.depth_m * 1e3:.4f} mm deep, {share} of the points not elliptic"
            error, depth_mm = touch.depth_error, f"{touch.depth_m * 1e3:.8g}"
        except NotConverged as lost:
            outcome, error, depth_mm = f"not converged: {lost}", np.nan, ""
        yield {"case": name, "outcome": outcome, "error": error, "cpu_s": time.process_time() - begun,
               "depth_mm": depth_mm}


def main() -> None:
    solve_touch(TABLE_1, Body(), Punch())  # compiles the kernels
    shown(written([*scan(), *touches()], "stiff", 3))


if __name__ == "__main__":
    main()
