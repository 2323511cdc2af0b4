"""Error against run time of the readings of two touches, by the gap between their edges.

Run by `make bench`, which pins threads; writes results/several_touches.csv next to this file. Two 14 mm punches under
1 N (Table 1's foam) are solved alone, their strains added; dV is compared with two solutions on a triangulation (level
4) that is finer than any listed. "sum" adds the signals of single touches and tells what their scattering is worth.
"""

import time
from collections.abc import Callable
from itertools import product

import numpy as np
from conditions import quick, shown, written
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.cem.assembly import dissection, impedance, quadrature_points
from eitsim.electrics.cem.boundary_integral import solve_rim
from eitsim.electrics.forward.solve_forward import solve
from eitsim.electrics.mesh.graded_mesh import triangulation
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.rim.interaction import interaction
from eitsim.scene.drive import read_out
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.sheet.sheet_conductance import touched_conductance, untouched_conductance

BODY, ELECTRODES, DRIVE = Body(), Electrodes(), Drive()
GAPS_MM, STRAINS = quick((5, 10, 20, 30, 45, 60), (5, 30)), ("normal", "principal")[:quick(2, 1)]
REFERENCE_LEVEL = 4
Touches = tuple[tuple[Punch, Touch], ...]


def on_triangles(touches: Touches, skin: Skin, level: int) -> np.ndarray:
    """dV from two solutions on one triangulation."""
    mesh = triangulation(BODY, ELECTRODES, touches, level)
    order, z = dissection(mesh), ELECTRODES.contact_impedance_Ohm_m
    touched = touched_conductance(quadrature_points(mesh), touches, skin, SKIN_LAW)
    untouched = np.full(len(mesh.cells), untouched_conductance(SKIN_LAW, skin))
    first, second = (impedance(mesh, s, z, order=order) for s in (touched, untouched))
    return read_out(DRIVE, first - second)


def rows(touches: Touches, gap_mm: float, strain: str) -> list[dict[str, object]]:
    """All methods on one pair."""
    skin = Skin(strain=strain)
    reference = on_triangles(touches, skin, REFERENCE_LEVEL)

    def readings(*chosen: tuple[Punch, Touch], method: str = "multipole") -> tuple[np.ndarray, float]:
        got = solve(BODY, skin, ELECTRODES, DRIVE, chosen, SKIN_LAW, method=method)
        return got.signal_V, got.signal_error

    methods: dict[str, Callable[[], tuple[np.ndarray, float]]] = {
        "sum": lambda: (np.sum([readings(touch)[0] for touch in touches], axis=0), np.nan),
        "multipole": lambda: readings(*touches), "auto": lambda: readings(*touches, method="auto"),
        "triangulation 1": lambda: (on_triangles(touches, skin, 1), np.nan),
        "triangulation 2": lambda: (on_triangles(touches, skin, 2), np.nan)}
    found = []
    for name, run in methods.items():
        start = time.process_time()
        signal, estimate = run()
        found.append({"gap_mm": gap_mm, "strain": strain, "method": name, "cpu_s": time.process_time() - start,
                      "dv_error": float(np.linalg.norm(signal - reference) / np.linalg.norm(reference)),
                      "estimate": estimate, "mechanical_bound": interaction(touches)["signal"]})
    return found


def main() -> None:
    """Write the table."""
    touch = solve_touch(TABLE_1, BODY, Punch())
    solve_rim(BODY, ELECTRODES, untouched_conductance(SKIN_LAW, Skin()))
    table = []
    for gap_mm, strain in product(GAPS_MM, STRAINS):
        half = (Punch().diameter_m + gap_mm / 1e3) / 2
        table += rows(((Punch(-half, 0.01), touch), (Punch(half, 0.01), touch)), gap_mm, strain)
    shown(written(table, "several_touches"))


if __name__ == "__main__":
    main()
