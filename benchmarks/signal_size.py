"""How large the signal of a touch is, for each strain that may drive the skin and for a punch that conducts or not.

Table 1's foam under flat punches at three places and forces, and two near the rim (gaps of 10 and 23 mm), whose
readings take the mesh; the skin's law is the synthetic one of the other
benchmarks. Signal: 2-norm of the 208 dV over that of the untouched voltages in dB, and the largest |dV|; with the
electrics' own estimate of its relative error. Run by `make bench`, which pins threads; writes results/signal_size.csv
next to this file. results/signal_peaks.csv: where the strain through the thickness drives the skin, the force up to
2 N, in steps of 0.05 N, whose signal has the largest amplitude in the middle of the disc, and the least force whose
amplitude is that of 2 N or more.
"""

from dataclasses import replace

import numpy as np
from conditions import quick, shown, written
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_path, solve_touch
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Drive, Electrodes, Punch, Skin
from eitsim.simulation.near_edges import solve_near_rim

PUNCHES = (Punch(), Punch(0.04, 0.02, 0.014, 1.0), Punch(0.04, 0.02, 0.014, 0.1), Punch(0.05, 0.01, 0.010, 2.0),
           Punch(0.04, -0.02, 0.018, 0.5))
NEAR_RIM = (Punch(0.083, 0.0, 0.014, 1.0), Punch(0.0, 0.07, 0.014, 0.1))
WIDTHS_MM, FORCES_N = quick((10.0, 18.0), (18.0,)), np.linspace(0.05, 2.0, quick(40, 4))


def rows(punch: Punch, strain: str) -> list[dict[str, object]]:
    """An insulated and a conducting punch under the same touch."""
    solver = solve_near_rim if punch in NEAR_RIM else solve_touch
    touch = solver(TABLE_1, Body(), punch)
    return [row(replace(punch, conductor=conductor), touch, strain) for conductor in (False, True)]


def row(punch: Punch, touch: Touch, strain: str) -> dict[str, object]:
    readings = solve(Body(), Skin(strain=strain), Electrodes(), Drive(), ((punch, touch),), SKIN_LAW)
    size = np.linalg.norm(readings.signal_V) / np.linalg.norm(readings.baseline_V)
    return {"d_mm": punch.diameter_m * 1e3, "F_N": punch.force_N, "x_mm": punch.x_m * 1e3, "y_mm": punch.y_m * 1e3,
            "strain": strain, "punch": "conducting" if punch.conductor else "insulated",
            "signal_dB": 20 * np.log10(size), "largest_mV": np.abs(readings.signal_V).max() * 1e3,
            "method": readings.method, "signal_error": readings.signal_error, "cpu_s": touch.cpu_s + readings.cpu_s}


def peak(diameter_mm: float) -> dict[str, object]:
    """Where the amplitude of a punch is largest, and from where on another force up to the highest has the same one."""
    punches = [Punch(diameter_m=diameter_mm / 1e3, force_N=float(force)) for force in FORCES_N]
    touches = solve_path(TABLE_1, Body(), punches[-1], FORCES_N.tolist())
    size = np.array([np.linalg.norm(solve(Body(), Skin(strain="normal"), Electrodes(), Drive(), (pressed,), SKIN_LAW)
                                    .signal_V) for pressed in zip(punches, touches, strict=True)])
    return {"d_mm": diameter_mm, "largest_at_N": FORCES_N[np.argmax(size)],
            "same_from_N": FORCES_N[np.argmax(size >= size[-1])], "last_over_largest": size[-1] / size.max()}


def main() -> None:
    for punch in (PUNCHES[0], NEAR_RIM[0]):
        rows(punch, STRAINS[0])  # compiles
    punches = quick(PUNCHES + NEAR_RIM, (PUNCHES[0], NEAR_RIM[0]))
    shown(written([one for punch in punches for strain in STRAINS for one in rows(punch, strain)], "signal_size"))
    shown(written([peak(width) for width in WIDTHS_MM], "signal_peaks"))


if __name__ == "__main__":
    main()
