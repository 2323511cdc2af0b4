"""How difference images show touches: GREIT's figures of merit, by prior, noise and place, with the CPU time.

Frames are simulated touches of Table 1 (axisymmetric mechanics, rings that scatter), images those of
`eitsim reconstruct` at its default noise figure. Noise is white, in dB below the RMS of the untouched readings; its
rows are medians over DRAWS frames. Run by `make bench`, which pins threads; writes results/reconstruction.csv next to
this file.
"""

import time
from dataclasses import asdict

import numpy as np
import pandas as pd
from conditions import quick, written
from figures_of_merit import figures_of_merit
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.imaging.gauss_newton import PRIORS, fitted, imager, on_grid
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import principal_conductances, stretches, untouched_conductance

TOUCHES = quick(((0.010, 0.3), (0.014, 1.0), (0.018, 3.0)), ((0.014, 1.0),))
PLACES_M = quick((0.0, 0.02, 0.04, 0.055, 0.07), (0.0, 0.055))
NOISES_DB = (None, 80, 60)
DRAWS = quick(50, 10)
BEARING = np.array([0.8, 0.6])


def strength_m2(touch: Touch) -> float:
    """Integral of the relative change of the mean of both sheet conductances, m^2."""
    edges = np.linspace(0, touch.radius_m[-1], 20001)
    radius = (edges[1:] + edges[:-1]) / 2
    sheets = principal_conductances(SKIN_LAW, Skin(), *stretches(touch, radius))
    change = (sheets[0] + sheets[1]) / 2 / untouched_conductance(SKIN_LAW, Skin()) - 1
    return float(np.sum(change * 2 * np.pi * radius * np.diff(edges)))


def main() -> None:
    rng, rows = np.random.default_rng(1), []
    touches = {case: solve_touch(TABLE_1, Body(), Punch(diameter_m=case[0], force_N=case[1])) for case in TOUCHES}
    untouched, imagers = None, {}
    for (diameter_m, force_N), touch in touches.items():
        for distance_m in PLACES_M:
            place = distance_m * BEARING
            punch = Punch(place[0], place[1], diameter_m, force_N)
            readings = solve(Body(), Skin(), Electrodes(), Drive(), ((punch, touch),), SKIN_LAW, method="multipole")
            if untouched is None:
                started = time.process_time()
                untouched = fitted(Body(), Electrodes(), Drive(), readings.baseline_V.ravel())
                fit_s = time.process_time() - started
                for prior in PRIORS:
                    started = time.process_time()
                    imagers[prior] = imager(untouched, prior=prior), fit_s + time.process_time() - started
            rms_V = float(np.sqrt(np.mean(readings.baseline_V**2)))
            signal_V = readings.signal_V.ravel()
            below = -20 * np.log10(np.sqrt(np.mean(signal_V**2)) / rms_V)
            for prior, (made, made_s) in imagers.items():
                for noise in NOISES_DB:
                    sd_V = 0.0 if noise is None else rms_V * 10 ** (-noise / 20)
                    frames = signal_V + sd_V * rng.standard_normal((1 if noise is None else DRAWS, signal_V.size))
                    started = time.process_time()
                    points, area, images = on_grid(untouched.pixels, made(frames))
                    frame_s = (time.process_time() - started) / len(frames)
                    figures = pd.DataFrame([asdict(figures_of_merit(points, area, image, place, strength_m2(touch)))
                                            for image in images])
                    rows.append({"prior": prior, "noise_dB": noise, "d_mm": diameter_m * 1e3, "force_N": force_N,
                                 "r_mm": distance_m * 1e3, "signal_dB_below": below, **figures.median().to_dict(),
                                 "displacement_90_m": figures["displacement_m"].quantile(0.9), "set_up_cpu_s": made_s,
                                 "frame_cpu_s": frame_s})
    table = written(rows, "reconstruction")
    print(table.groupby(["prior", "noise_dB"], dropna=False)[
        ["amplitude_response", "position_error_m", "displacement_m", "displacement_90_m", "resolution",
         "shape_deformation", "ringing"]].median().to_string(float_format="%.4g"))


if __name__ == "__main__":
    main()
