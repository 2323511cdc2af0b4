"""Error and cost of the derivatives of readings, by how often the mesh is halved.

"error": relative difference (2-norm over the readings touched, "error_of_signal" over their change by the touch) to
those on a mesh halved once more than the finest listed; set-up, mechanics and all parameters are in the CPU time of
each row's solution. "error_without_mesh", of contact impedances: that of the untouched readings, to differences of the
impedance matrix that an integral equation on the rim gives. "scale": relative residual of sum mu_i dV/dmu_i =
-F dV/dF, which holds exactly. Run by `make bench`, which pins threads; writes results/sensitivity.csv next to
this file.
"""

import time
from dataclasses import replace

import numpy as np
import pandas as pd
from conditions import quick, written
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.scene.drive import read_out
from eitsim.scene.scene import Drive, Punch, Scene
from eitsim.sheet.sheet_conductance import untouched_conductance
from eitsim.simulation.derivatives.readings import Sensitivity, scene_sensitivity
from matcal.card import MaterialCard

CARD = MaterialCard("Table 1", TABLE_1, None, SKIN_LAW)
# The last one is near the rim.
TOUCHES = (Punch(0.03, 0.02, 0.014, 1.0), Punch(-0.02, 0.03, 0.010, 2.0), Punch(0.0, -0.035, 0.018, 0.5),
           Punch(0.0584, 0.0438, 0.014, 1.0))
HALVINGS, FINEST = (1, 2), 3
# Step of the contact impedances, Ohm m.
STEP = 0.01


def solved(punch: Punch, halvings: int) -> tuple[Sensitivity, float]:
    started = time.process_time()
    found = scene_sensitivity(Scene(punches=(punch,)), CARD, halvings=halvings)
    return found, time.process_time() - started


def untouched_by_contact(k: int) -> np.ndarray:
    """Derivative (readings,) of the untouched readings by electrode k's contact impedance, differences of fourth order.
    """
    scene = Scene()

    def at(by_Ohm_m: float) -> np.ndarray:
        z = np.full(scene.electrodes.count, scene.electrodes.contact_impedance_Ohm_m)
        z[k] += by_Ohm_m
        changed = replace(scene.electrodes, contact_impedance_Ohm_m=tuple(z.tolist()))
        sheet = untouched_conductance(SKIN_LAW, scene.skin)
        return read_out(Drive(), untouched_impedance(scene.body, changed, sheet)).ravel()

    return (8 * (at(STEP) - at(-STEP)) - (at(2 * STEP) - at(-2 * STEP))) / (12 * STEP)


def apart(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def rows_of(punch: Punch, by_contact: dict[str, np.ndarray]) -> list[dict[str, object]]:
    finest, _ = solved(punch, FINEST)
    rows: list[dict[str, object]] = []
    for halvings in HALVINGS:
        found, cpu_s = solved(punch, halvings)
        case = {"d_mm": punch.diameter_m * 1e3, "force_N": punch.force_N,
                "off_centre_mm": 1e3 * np.hypot(punch.x_m, punch.y_m), "halvings": halvings, "cpu_s": cpu_s}
        column = dict(zip(found.parameters, found.touched_by.T, strict=True))
        by_scale = sum(mu * column[f"mu_{i + 1}_Pa"] for i, mu in enumerate(TABLE_1.mu_Pa))
        rows.append(case | {"what": "scale", "error": apart(by_scale, -punch.force_N * column["F_N"])})
        for j, name in enumerate(found.parameters):
            one = {"what": name, "error": apart(found.touched_by[:, j], finest.touched_by[:, j]),
                   "error_of_signal": apart(found.signal_by[:, j], finest.signal_by[:, j])}
            if name in by_contact:
                one["error_without_mesh"] = apart(found.touched_by[:, j] - found.signal_by[:, j], by_contact[name])
            rows.append(case | one)
    return rows


def main() -> None:
    solved(TOUCHES[0], 1)
    by_contact = {f"z_{k}_Ohm_m": untouched_by_contact(k) for k in range(Scene().electrodes.count)}
    table = pd.DataFrame([row for punch in TOUCHES[:quick(None, 1)] for row in rows_of(punch, by_contact)])
    written(table, "sensitivity", 3)
    errors = ["error", "error_of_signal", "error_without_mesh"]
    print(pd.DataFrame(table.groupby(["halvings", "what"], sort=False)[errors].max()).to_string(float_format="%.2g"))
    print(table.groupby(["halvings", "off_centre_mm"])["cpu_s"].mean())


if __name__ == "__main__":
    main()
