"""Error against run time of one set of 208 readings.

Run by `make bench`, which pins threads; writes results/electrics.csv beside this file.
dV is compared with two solutions on a mesh (level 6) that follows the touch and is finer than any listed; where the
listed method is that mesh itself, the error is one of refinement only. The touches are solved with Table 1's foam.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from eitsim.axisymmetric import solve_touch
from eitsim.cem import SkinMesh, dissection, impedance, quadrature_points
from eitsim.drive import read_out
from eitsim.electrics import solve
from eitsim.results import Touch
from eitsim.rim import solve_rim
from eitsim.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.skin import sheet_conductance, untouched_conductance
from eitsim.template import rim_angles, ring_mesh, template
from matcal.conductivity import Conductivity
from matcal.hyperfoam import Hyperfoam

HERE = Path(__file__).parent
FOAM = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
BODY, SKIN, ELECTRODES, DRIVE = Body(), Skin(), Electrodes(), Drive()
PUNCHES = (Punch(), Punch(0.05, 0.01, 0.010, 2.0), Punch(0.06, -0.02, 0.018, 0.5), Punch(-0.05, 0.065))
REFERENCE_LEVEL = 6
REPEATS = 5


def rings(level: int) -> SkinMesh:
    """Concentric rings that know nothing of the touch."""
    angles, electrode = rim_angles(BODY, ELECTRODES, level)
    radii = np.linspace(0, BODY.radius_m, 5 * level + 1)
    return ring_mesh(radii, np.zeros((len(radii), 2)), angles, electrode, ELECTRODES.count)


def fixed_mesh(level: int) -> SkinMesh:
    """The nodes of `rings` as linear triangles."""
    mesh = rings(level)
    quarters = [(0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)]
    triangles = [mesh.cells[:, [q[i] for i in corner]] for q in quarters for corner in ((0, 1, 2), (0, 2, 3))]
    cells = np.concatenate([t[(t[:, 0] != t[:, 1]) & (t[:, 1] != t[:, 2]) & (t[:, 0] != t[:, 2])] for t in triangles])
    edges = np.concatenate([mesh.under[:, [0, 2]], mesh.under[:, [2, 1]]])
    return replace(mesh, cells=cells, under=edges, electrode=np.tile(mesh.electrode, 2), element="P1")


def signal_on(mesh: SkinMesh, punch: Punch, touch: Touch) -> np.ndarray:
    """dV from two solutions on one mesh."""
    order, z = dissection(mesh), ELECTRODES.contact_impedance_Ohm_m
    touched = sheet_conductance(quadrature_points(mesh), punch, touch, SKIN, LAW)
    untouched = np.full(len(mesh.cells), untouched_conductance(LAW, SKIN))
    first, second = (impedance(mesh, s, z, order=order) for s in (touched, untouched))
    return read_out(DRIVE, first - second)


def row(punch: Punch, method: str, elements: int, unknowns: int, estimate: float, run: Callable[[], np.ndarray],
        exact: np.ndarray, repeats: int = REPEATS) -> dict[str, object]:
    seconds, signal = [], exact
    for _ in range(repeats):
        begun = time.process_time()
        signal = run()
        seconds.append(time.process_time() - begun)
    gap = BODY.radius_m - np.hypot(punch.x_m, punch.y_m) - punch.diameter_m / 2
    return {"touch": f"d = {punch.diameter_m * 1e3:g} mm, {punch.force_N:g} N", "gap_mm": gap * 1e3, "method": method,
            "elements": elements, "unknowns": unknowns,
            "dv_error": np.linalg.norm(signal - exact) / np.linalg.norm(exact), "estimate": estimate,
            "cpu_ms": 1e3 * float(np.median(seconds))}


def rows(punch: Punch) -> list[dict[str, object]]:
    touch = solve_touch(FOAM, BODY, punch)
    exact = signal_on(template(BODY, ELECTRODES, punch, touch, REFERENCE_LEVEL), punch, touch)
    out = []
    for method in ("multipole", "auto"):
        got = solve(BODY, SKIN, ELECTRODES, DRIVE, ((punch, touch),), LAW, method=method)
        if method == "multipole" or got.method != "multipole":
            out.append(row(punch, f"{got.method}, as solved", 0, got.unknowns, got.signal_error, lambda m=method: solve(
                BODY, SKIN, ELECTRODES, DRIVE, ((punch, touch),), LAW, method=m).signal_V, exact))
    for level in (1, 2, 4):
        mesh = template(BODY, ELECTRODES, punch, touch, level)
        out.append(row(punch, f"Q2 that follows, level {level}", len(mesh.cells), len(mesh.nodes_m) + 15, np.nan,
                       lambda n=level: signal_on(template(BODY, ELECTRODES, punch, touch, n), punch, touch), exact, 2))
    for level in (4, 8):
        mesh = fixed_mesh(level)
        out.append(row(punch, f"P1 fixed, level {level}", len(mesh.cells), len(mesh.nodes_m) + 15, np.nan,
                       lambda m=mesh: signal_on(m, punch, touch), exact, 2))
    return out


def sensor() -> dict[str, object]:
    """What a new card costs once: the untouched skin."""
    seconds = []
    for scale in 1 + 0.01 * np.arange(1, 6):
        begun = time.process_time()
        solve_rim(BODY, ELECTRODES, 6e-4 * scale)
        seconds.append(time.process_time() - begun)
    return {"touch": "untouched, once a card", "method": "rim integral equation", "cpu_ms": 1e3 * np.median(seconds)}


def main() -> None:
    (HERE / "results").mkdir(exist_ok=True)
    frame = pd.DataFrame([sensor(), *(r for punch in PUNCHES for r in rows(punch))])
    frame.to_csv(HERE / "results" / "electrics.csv", index=False, float_format="%.4g")
    print(frame.to_string(index=False, float_format=lambda v: f"{v:.3g}"))


if __name__ == "__main__":
    main()
