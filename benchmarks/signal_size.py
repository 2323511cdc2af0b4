"""How large the signal of a touch is, for each strain that may drive the skin and for a punch that conducts or not.

Table 1's foam under flat punches at three places and forces; the skin's law is the synthetic one of the other
benchmarks. Signal: 2-norm of the 208 dV over that of the untouched voltages in dB, and the largest |dV|; beside it the
electrics' own estimate of its relative error. Run by `make bench`, which pins threads; writes results/signal_size.csv
beside this file.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from conditions import RESULTS, conditions

from eitsim.axisymmetric import solve_touch
from eitsim.electrics import solve
from eitsim.scene import STRAINS, Body, Drive, Electrodes, Punch, Skin
from matcal.conductivity import Conductivity
from matcal.hyperfoam import Hyperfoam

FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
PUNCHES = (Punch(), Punch(0.04, 0.02, 0.014, 1.0), Punch(0.04, 0.02, 0.014, 0.1), Punch(0.05, 0.01, 0.010, 2.0),
           Punch(0.04, -0.02, 0.018, 0.5))


def row(punch: Punch, strain: str, conductor: bool) -> dict[str, object]:
    punch = replace(punch, conductor=conductor)
    touch = solve_touch(FOAM, Body(), punch, strain=strain)
    readings = solve(Body(), Skin(strain=strain), Electrodes(), Drive(), ((punch, touch),), LAW)
    size = np.linalg.norm(readings.signal_V) / np.linalg.norm(readings.baseline_V)
    return {"d_mm": punch.diameter_m * 1e3, "F_N": punch.force_N, "x_mm": punch.x_m * 1e3, "y_mm": punch.y_m * 1e3,
            "strain": strain, "punch": "conducting" if conductor else "insulated",
            "signal_dB": 20 * np.log10(size), "largest_mV": np.abs(readings.signal_V).max() * 1e3,
            "signal_error": readings.signal_error, "cpu_s": touch.cpu_s + readings.cpu_s}


def main() -> None:
    rows = [row(punch, strain, conductor) | conditions()
            for punch in PUNCHES for strain in STRAINS for conductor in (False, True)]
    RESULTS.mkdir(exist_ok=True)
    table = pd.DataFrame(rows)
    table.to_csv(RESULTS / "signal_size.csv", index=False, float_format="%.4g")
    print(table.drop(columns=list(conditions())).to_string(index=False))


if __name__ == "__main__":
    main()
