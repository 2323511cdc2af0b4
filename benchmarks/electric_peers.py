"""EIDORS and pyEIT on a mesh that is given, of linear triangles, for EIDORS of linear tetrahedra too: readings of the
adjacent patterns and their CPU times.

EIDORS, under Octave, solves the same complete electrode model; EIDORS_PATH names the folder with eidors_startup.m.
pyEIT has point electrodes, another model; PYEIT_PYTHON may name an interpreter that has it. A peer that is absent or
fails is left out with a note.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat, savemat
from scipy.spatial import Delaunay

from eitsim.electrics.cem.assembly import SkinMesh
from eitsim.electrics.volume.volume_cem import VolumeMesh

RADIUS_M, ELECTRODES, CONTACT_OHM_M = 0.1, 16, 1.0
PEERS = Path(__file__).parent / "peers"


@dataclass(frozen=True)
class Answers:
    """What a peer reads of some conductances on one mesh."""

    method: str
    version: str
    # whether it solves the complete electrode model
    complete: bool
    # (readings, cases), V
    readings: np.ndarray
    # (cases,) CPU time of each, s; the first makes what is kept
    seconds: np.ndarray
    # (electrodes, patterns) currents, A, and (patterns, readings of each, electrodes) weights of the voltages
    currents: np.ndarray
    weights: np.ndarray

    def of(self, impedance_Ohm: np.ndarray) -> np.ndarray:
        """(readings,) that these patterns take of an impedance matrix, V."""
        return np.einsum("prl,lp->pr", self.weights, impedance_Ohm @ self.currents).ravel()


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


def peers(mesh: SkinMesh, cases: np.ndarray) -> Iterator[Answers]:
    """What the peers that are here read of conductances (cells, cases), S."""
    for peer in (eidors, pyeit):
        try:
            found = peer(mesh, cases)
        except subprocess.CalledProcessError as failed:
            print(f"{peer.__name__}: failed: {failed.stderr.decode(errors='replace').strip()[-300:]}")
            continue
        if found is not None:
            yield found


def eidors(mesh: SkinMesh | VolumeMesh, cases: np.ndarray, contact: float | np.ndarray = CONTACT_OHM_M
           ) -> Answers | None:
    home, octave = os.environ.get("EIDORS_PATH", ""), shutil.which("octave-cli")
    if not octave or not (Path(home) / "eidors_startup.m").exists():
        print("EIDORS: not found (EIDORS_PATH names the folder with eidors_startup.m; Octave must be installed)")
        return None
    with tempfile.TemporaryDirectory() as folder:
        electrode = np.empty(mesh.count, dtype=object)
        for k in range(mesh.count):
            electrode[k] = np.unique(mesh.under[mesh.electrode == k]) + 1.0
        savemat(Path(folder) / "problem.mat", {"nodes": mesh.nodes_m, "elems": mesh.cells + 1.0, "electrode": electrode,
                                               "z": np.broadcast_to(contact, mesh.count), "conductivity": cases})
        answered([octave, PEERS / "eidors_readings.m", home, folder])
        found = loadmat(Path(folder) / "found.mat", squeeze_me=True)
    return Answers("EIDORS", str(found["version"]), True, found["readings"], found["seconds"], found["currents"],
                   np.stack([*found["measured"]]))


def pyeit(mesh: SkinMesh, cases: np.ndarray) -> Answers | None:
    python = os.environ.get("PYEIT_PYTHON", sys.executable)
    if subprocess.run([python, "-c", "import pyeit"], check=False, capture_output=True).returncode:
        print("pyEIT: not installed (PYEIT_PYTHON may name an interpreter that has it)")
        return None
    with tempfile.TemporaryDirectory() as folder:
        middle = [mesh.under[mesh.electrode == k][(mesh.electrode == k).sum() // 2, 0] for k in range(mesh.count)]
        np.savez(Path(folder) / "problem.npz", nodes=mesh.nodes_m, elements=mesh.cells, electrode=middle,
                 conductivity=cases)
        answered([python, PEERS / "pyeit_readings.py", folder])
        found = np.load(Path(folder) / "found.npz")
        unit = np.eye(mesh.count)
        driven, read = unit[found["driven"]], unit[found["read"]]
        return Answers("pyEIT, point electrodes", str(found["version"]), False, found["readings"], found["seconds"],
                       (driven[:, 0] - driven[:, 1]).T, read[:, :, 0] - read[:, :, 1])


def answered(command: Sequence[str | Path]) -> None:
    """Run a peer; CalledProcessError, which holds what it said, where it fails."""
    subprocess.run(command, check=True, capture_output=True)
