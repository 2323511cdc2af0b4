"""Error against run time of one touch: element size at the punch's edge against a mesh four times finer than default.

Errors of depth, of the normal strain of the surface (L2), of the largest pressure, and of the 208 touch signals dV that
follow from the touch (2-norm). Each size runs in a process of its own, so that its peak memory is its own. Run by
`make bench`, which pins threads; writes results/mechanics.csv next to this file.
"""

import math
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from conditions import quick, shown, written
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin

CASES = ((0.014, 1.0), (0.010, 2.0), (0.018, 0.5), (0.014, 0.1))[:quick(4, 1)]
# element size over the default one; the last is the reference
SIZES = (4.0, 2.0, 1.0, 0.5, 0.25)
REPEATS = quick(3, 1)


def solved(punch: Punch, size: float, repeats: int) -> tuple[Touch, float, float]:
    """The touch, its median CPU time and the peak memory that it adds, MB; NaN where the system does not tell it."""
    solve_touch(TABLE_1, Body(), Punch(), element_m=8 * default_element_m(Body(), Punch()))  # compiles the kernels
    before, seconds = fresh_peak_MB(), []
    for _ in range(repeats):
        begun = time.process_time()
        touch = solve_touch(TABLE_1, Body(), punch, element_m=size * default_element_m(Body(), punch))
        seconds.append(time.process_time() - begun)
    return touch, float(np.median(seconds)), peak_MB() - before


def fresh_peak_MB() -> float:
    """The memory in use, MB, from which on the peak is told anew: what imports and kernels took before is forgotten."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return math.nan
    return peak_MB()


def peak_MB() -> float:
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else ["VmHWM nan"]
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def in_its_own_process(punch: Punch, size: float, repeats: int) -> tuple[Touch, float, float]:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        return pool.submit(solved, punch, size, repeats).result()


def strain_error(touch: Touch, reference: Touch) -> float:
    """Relative error of the normal strain of the surface in L2 over its area."""
    r, strain = reference.radius_m, reference.stretch_normal - 1
    difference = np.interp(r, touch.radius_m, touch.stretch_normal - 1) - strain
    return float(np.sqrt(np.trapezoid(difference**2 * r, r) / np.trapezoid(strain**2 * r, r)))


def signal(punch: Punch, touch: Touch) -> np.ndarray:
    """The touch signals, V, with an electrical error far below those of the mechanics."""
    return solve(Body(), Skin(), Electrodes(), Drive(), ((punch, touch),), SKIN_LAW, signal=1e-4).signal_V


def rows(diameter_m: float, force_N: float) -> list[dict[str, object]]:
    punch = Punch(x_m=0.02, y_m=-0.01, diameter_m=diameter_m, force_N=force_N)
    reference, _, _ = in_its_own_process(punch, SIZES[-1], 1)
    expected, out = signal(punch, reference), []
    for size in SIZES[:-1]:
        touch, seconds, memory = in_its_own_process(punch, size, REPEATS)
        missed = np.linalg.norm(signal(punch, touch) - expected) / np.linalg.norm(expected)
        out.append({"touch": f"d = {diameter_m * 1e3:g} mm, {force_N:g} N",
                    "element_um": size * default_element_m(Body(), punch) * 1e6,
                    "depth_mm": touch.depth_m * 1e3, "depth_error": abs(touch.depth_m / reference.depth_m - 1),
                    "depth_estimate": touch.depth_error, "strain_error_L2": strain_error(touch, reference),
                    "sigma_max_error": abs(touch.sigma_max_Pa / reference.sigma_max_Pa - 1),
                    "signal_error": float(missed), "signal_estimate": touch.signal_errors[0],
                    "iterations": touch.iterations, "cpu_s": seconds, "peak_MB": memory})
    return out


def main() -> None:
    shown(written([row for case in CASES for row in rows(*case)], "mechanics"))


if __name__ == "__main__":
    main()
