"""Error and cost of the derivatives of readings, by the level of the mesh that follows the touch.

"mesh": relative difference (2-norm over the readings touched, and over their change by the touch) to those on level 4;
set-up, mechanics and all parameters are in the CPU time of each row's solution. "scale": relative residual of
sum mu_i dV/dmu_i = -F dV/dF, which holds exactly. Run by `make bench`, which pins threads; writes
results/sensitivity.csv beside this file.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pandas as pd

from eitsim.scene import Punch, Scene
from eitsim.touch_sensitivity import Sensitivity, scene_sensitivity
from matcal.card import MaterialCard
from matcal.conductivity import Conductivity
from matcal.hyperfoam import Hyperfoam

RESULTS = Path(__file__).parent / "results"
TABLE_1 = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
CARD = MaterialCard("Table 1", TABLE_1, None, Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4)))
TOUCHES = (Punch(0.03, 0.02, 0.014, 1.0), Punch(-0.02, 0.03, 0.010, 2.0), Punch(0.0, -0.035, 0.018, 0.5))
LEVELS, FINEST = (1, 2), 4


def solved(punch: Punch, level: int) -> tuple[Sensitivity, float]:
    started = time.process_time()
    found = scene_sensitivity(Scene(punches=(punch,)), CARD, level=level)
    return found, time.process_time() - started


def rows_of(punch: Punch) -> list[dict[str, object]]:
    finest, _ = solved(punch, FINEST)
    rows: list[dict[str, object]] = []
    for level in LEVELS:
        found, cpu_s = solved(punch, level)
        case = {"d_mm": punch.diameter_m * 1e3, "force_N": punch.force_N, "level": level, "cpu_s": cpu_s}
        column = dict(zip(found.parameters, found.touched_by.T, strict=True))
        by_force = punch.force_N * column["F_N"]
        by_scale = sum(mu * column[f"mu_{i + 1}_Pa"] for i, mu in enumerate(TABLE_1.mu_Pa))
        rows.append(case | {"what": "scale", "error": np.linalg.norm(by_scale + by_force) / np.linalg.norm(by_force)})
        for j, name in enumerate(found.parameters):
            errors = {key: float(np.linalg.norm(one[:, j] - fine[:, j]) / np.linalg.norm(fine[:, j]))
                      for key, one, fine in (("error", found.touched_by, finest.touched_by),
                                             ("error_of_signal", found.signal_by, finest.signal_by))}
            rows.append(case | {"what": name} | errors)
    return rows


def main() -> None:
    solved(TOUCHES[0], 1)
    table = pd.DataFrame([row for punch in TOUCHES for row in rows_of(punch)])
    table.to_csv(RESULTS / "sensitivity.csv", index=False, float_format="%.3g")
    print(table.groupby(["level", "what"], sort=False)[["error", "error_of_signal"]].max().to_string(
        float_format="%.2g"))
    print(table.groupby("level")["cpu_s"].mean())


if __name__ == "__main__":
    main()
