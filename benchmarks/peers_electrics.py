"""CPU time of one set of readings for a new conductance: ours, EIDORS and pyEIT on the same mesh, 16 adjacent patterns.

The mesh is an unstructured one of linear triangles; each case is another random conductance. Ours keeps the order of
elimination, EIDORS what it caches for a model, pyEIT its element matrices; the first case, which makes these, counts
apart. EIDORS is compared reading by reading; pyEIT, with its point electrodes, has nothing to compare. Which peers are
run, `electric_peers` says; `peers_signal` sets error against time. Run by `make bench`, which pins threads; writes
results/peers_electrics.csv next to this file.
"""

import time
from collections.abc import Callable, Iterable, Iterator

import numpy as np
import pandas as pd
from conditions import quick, shown, written
from electric_peers import CONTACT_OHM_M, Answers, mesh_of, peers

from eitsim.electrics.cem.assembly import SkinMesh, dissection, impedance, potentials
from eitsim.scene.drive import read_out
from eitsim.scene.scene import Drive

# Circles of the mesh's points: about 19,000 and 75,000 triangles.
CIRCLES = (55, 109)[:quick(2, 1)]
# Conductances of each mesh, the first of which counts apart.
CASES = 4


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


def distance(found: Iterable[np.ndarray], other: Iterable[np.ndarray]) -> float:
    """Largest relative difference of a reading."""
    return max(float(np.abs(a / b - 1).max()) for a, b in zip(found, other, strict=True))


def of_peer(mesh: SkinMesh, cases: np.ndarray, found: Answers) -> dict[str, object]:
    difference = np.nan
    if found.complete:
        expected = [found.of(impedance(mesh, case, CONTACT_OHM_M)) for case in cases.T]
        difference = distance(found.readings.T, expected)
    return row(mesh, found.method, found.seconds, difference, found.version)


def main() -> None:
    small = mesh_of(8)
    potentials(small, conductances(small)[:, 0], CONTACT_OHM_M)  # compiles the kernels
    rows = []
    for circles in CIRCLES:
        mesh = mesh_of(circles)
        cases = conductances(mesh)
        rows += [*ours(mesh, cases), *(of_peer(mesh, cases, found) for found in peers(mesh, cases))]
    table = pd.DataFrame(rows)
    own = table[table["method"] == "eitsim"].set_index("triangles")["cpu_s"]
    table.insert(5, "times_ours", table["cpu_s"] / table["triangles"].map(own))
    shown(written(table, "peers_electrics"))


if __name__ == "__main__":
    main()
