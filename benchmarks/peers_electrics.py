"""CPU time of one set of readings for a new conductance: ours, EIDORS and pyEIT on the same mesh, 16 adjacent patterns.

The mesh is an unstructured one of linear triangles; each case is another random conductance. Ours keeps the order of
elimination, EIDORS what it caches for a model, pyEIT its element matrices; the first case, which makes these, counts
apart. EIDORS, under Octave, solves the same complete electrode model and is compared reading by reading; pyEIT has
point electrodes, and nothing to compare. EIDORS_PATH names the folder with eidors_startup.m, PYEIT_PYTHON an
interpreter that has pyEIT; a peer that is absent is left out with a note. Run by `make bench`, which pins threads;
writes results/peers_electrics.csv beside this file.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import quick, shown, written
from scipy.io import loadmat, savemat
from scipy.spatial import Delaunay

from eitsim.cem import SkinMesh, dissection, impedance, potentials
from eitsim.drive import read_out
from eitsim.scene import Drive

RADIUS_M, ELECTRODES, CONTACT_OHM_M = 0.1, 16, 1.0
# Circles of the mesh's points: about 19,000 and 75,000 triangles.
CIRCLES = (55, 109)[:quick(2, 1)]
# Conductances of each mesh, the first of which counts apart.
CASES = 4
PEERS = Path(__file__).parent / "peers"


def mesh_of(circles: int) -> SkinMesh:
    """Triangles between points on circles, turned at random; a quarter of the rim is under electrodes."""
    turns, points = np.random.default_rng(0).random(circles), [np.zeros((1, 2))]
    for k in range(1, circles):
        points.append(k / circles * on_circle(int(2 * np.pi * k), turns[k]))
    rim = 16 * ELECTRODES * max(1, round(2 * np.pi * circles / (16 * ELECTRODES)))
    nodes = RADIUS_M * np.vstack([*points, on_circle(rim, 0.0)])
    cells = Delaunay(nodes).simplices
    (x1, y1), (x2, y2) = ((nodes[cells[:, i]] - nodes[cells[:, 0]]).T for i in (1, 2))
    twice = x1 * y2 - x2 * y1
    cells = np.where((twice > 0)[:, None], cells, cells[:, [0, 2, 1]])[np.abs(twice) > 1e-12]
    first, step = len(nodes) - rim, rim // ELECTRODES
    under = step * np.arange(ELECTRODES)[:, None] + np.arange(-step // 8, step // 8)
    edges = first + np.stack([under, under + 1], axis=-1).reshape(-1, 2) % rim
    return SkinMesh(nodes, cells, edges, np.repeat(np.arange(ELECTRODES), step // 4), ELECTRODES)


def on_circle(count: int, turn: float) -> np.ndarray:
    angle = 2 * np.pi * (np.arange(count) + turn) / count
    return np.column_stack([np.cos(angle), np.sin(angle)])


def conductances(mesh: SkinMesh) -> np.ndarray:
    """(cells, CASES), S: log-normal."""
    return 1e-3 * np.exp(0.3 * np.random.default_rng(1).normal(size=(len(mesh.cells), CASES)))


def row(mesh: SkinMesh, method: str, seconds: list[float] | np.ndarray, difference: float,
        version: str = "") -> dict[str, object]:
    return {"triangles": len(mesh.cells), "unknowns": len(mesh.nodes_m) + mesh.count, "method": method,
            "first_cpu_s": float(seconds[0]), "cpu_s": float(np.median(seconds[1:])),
            "readings_difference": difference, "peer": version}


def timed(solve: Callable[[np.ndarray], np.ndarray], cases: np.ndarray) -> tuple[list[np.ndarray], list[float]]:
    found, seconds = [], []
    for case in cases.T:
        begun = time.process_time()
        found.append(solve(case))
        seconds.append(time.process_time() - begun)
    return found, seconds


def ours(mesh: SkinMesh, cases: np.ndarray) -> Iterator[dict[str, object]]:
    begun = time.process_time()
    order = dissection(mesh)
    once = time.process_time() - begun
    found, seconds = timed(lambda case: read_out(Drive(), impedance(mesh, case, CONTACT_OHM_M, order=order)), cases)
    seconds[0] += once
    refined = [read_out(Drive(), impedance(mesh, case, CONTACT_OHM_M, order=order, refinements=1)) for case in cases.T]
    yield row(mesh, "eitsim", seconds, distance(found, refined))
    _, seconds = timed(lambda case: potentials(mesh, case, CONTACT_OHM_M, order=order), cases)
    yield row(mesh, "eitsim, all potentials", seconds, np.nan)


def distance(found: list[np.ndarray], other: list[np.ndarray]) -> float:
    """Largest relative difference of a reading."""
    return max(float(np.abs(a / b - 1).max()) for a, b in zip(found, other, strict=True))


def eidors(mesh: SkinMesh, cases: np.ndarray) -> Iterator[dict[str, object]]:
    """On the same mesh, from 1; compared through EIDORS's own currents and measurements."""
    home, octave = os.environ.get("EIDORS_PATH", ""), shutil.which("octave-cli")
    if not octave or not (Path(home) / "eidors_startup.m").exists():
        print("EIDORS: not found (EIDORS_PATH names the folder with eidors_startup.m; Octave must be installed)")
        return
    with tempfile.TemporaryDirectory() as folder:
        electrode = np.empty(mesh.count, dtype=object)
        for k in range(mesh.count):
            electrode[k] = np.unique(mesh.under[mesh.electrode == k]) + 1.0
        savemat(Path(folder) / "problem.mat", {"nodes": mesh.nodes_m, "elems": mesh.cells + 1.0, "electrode": electrode,
                                               "z": CONTACT_OHM_M, "conductivity": cases})
        subprocess.run([octave, str(PEERS / "eidors_readings.m"), home, folder], check=True, capture_output=True)
        found = loadmat(Path(folder) / "found.mat", squeeze_me=True)
    differences = []
    for case, readings in zip(cases.T, found["readings"].T, strict=True):
        voltages = impedance(mesh, case, CONTACT_OHM_M) @ found["currents"]
        expected = np.concatenate([m @ v for m, v in zip(found["measured"], voltages.T, strict=True)])
        differences.append(float(np.abs(readings / expected - 1).max()))
    yield row(mesh, "EIDORS", found["seconds"], max(differences), str(found["version"]))


def pyeit(mesh: SkinMesh, cases: np.ndarray) -> Iterator[dict[str, object]]:
    python = os.environ.get("PYEIT_PYTHON", sys.executable)
    if subprocess.run([python, "-c", "import pyeit"], check=False, capture_output=True).returncode:
        print("pyEIT: not installed (PYEIT_PYTHON may name an interpreter that has it)")
        return
    with tempfile.TemporaryDirectory() as folder:
        middle = [mesh.under[mesh.electrode == k][(mesh.electrode == k).sum() // 2, 0] for k in range(mesh.count)]
        np.savez(Path(folder) / "problem.npz", nodes=mesh.nodes_m, elements=mesh.cells, electrode=middle,
                 conductivity=cases)
        subprocess.run([python, str(PEERS / "pyeit_readings.py"), folder], check=True, capture_output=True)
        found = np.load(Path(folder) / "found.npz")
        yield row(mesh, "pyEIT, point electrodes", found["seconds"], np.nan, str(found["version"]))


def main() -> None:
    small = mesh_of(8)
    potentials(small, conductances(small)[:, 0], CONTACT_OHM_M)  # compiles the kernels
    rows = []
    for circles in CIRCLES:
        mesh = mesh_of(circles)
        for method in (ours, eidors, pyeit):
            for found in method(mesh, conductances(mesh)):
                rows.append(found)
                print(f"{found['triangles']} triangles, {found['method']}: {found['cpu_s']:.3f} CPU s", flush=True)
    table = pd.DataFrame(rows)
    own = table[table["method"] == "eitsim"].set_index("triangles")["cpu_s"]
    table.insert(5, "times_ours", table["cpu_s"] / table["triangles"].map(own))
    shown(written(table, "peers_electrics"))


if __name__ == "__main__":
    main()
