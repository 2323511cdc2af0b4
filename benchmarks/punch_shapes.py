"""Punches whose shape is a file of triangles, next to the profile that the triangles are of.

A ball and a flat punch of 14 mm, cut into few and into many triangles, press the paper's foam with 0.5 N, 20 mm off the
middle; the flat one leans by 5 degrees too, in its file and in the scene. Columns: how far depth and signal (2-norm of
all readings) are off, and what is stated. Run by `make bench`; writes results/punch_shapes.csv.
"""

import tempfile
from pathlib import Path

import meshio
import numpy as np
from conditions import quick, shown, written
from materials import SKIN_LAW, TABLE_1

import eitsim
from matcal.card import MaterialCard

CARD = MaterialCard("Table 1", TABLE_1, conductivity=SKIN_LAW)
EDGE_MM = 0.7
CUTS = quick((24, 96), (24,))  # sides of a turn; half as many along the outline
TILT = np.deg2rad(5)


def outline(kind: str, cuts: int) -> list[tuple[float, float]]:
    """(r, z), mm, from the axis to the axis."""
    if kind == "ball":
        return [(7 * np.sin(a), 7 - 7 * np.cos(a)) for a in np.linspace(0, np.pi, cuts // 2 + 1)]
    edge = np.linspace(0, np.pi / 2, max(cuts // 6, 4))
    return [(0, 0), *((7 - EDGE_MM * (1 - np.sin(a)), EDGE_MM * (1 - np.cos(a))) for a in edge), (7, 15), (0, 15)]


def revolved(path: Path, kind: str, cuts: int, tilt: float) -> int:
    """Write the triangles of a solid of revolution that leans; how many."""
    angle, line = 2 * np.pi * np.arange(cuts) / cuts, np.array(outline(kind, cuts))
    nodes = np.stack([line[:, :1] * np.cos(angle), line[:, :1] * np.sin(angle),
                      np.broadcast_to(line[:, 1:], (len(line), cuts))], axis=-1)
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    k, j = np.indices((len(line) - 1, cuts))
    a, b, c, d = k * cuts + j, k * cuts + (j + 1) % cuts, (k + 1) * cuts + (j + 1) % cuts, (k + 1) * cuts + j
    cells = np.concatenate([np.stack([a, b, c], -1)[1:].reshape(-1, 3), np.stack([a, c, d], -1)[:-1].reshape(-1, 3)])
    meshio.write(path, meshio.Mesh(nodes.reshape(-1, 3) @ turn.T, [("triangle", cells)]))
    return len(cells)


def row(kind: str, cuts: int, leans: bool) -> dict[str, object]:
    profile = {"profile": "sphere", "fillet_m": 5e-4} if kind == "ball" else {"fillet_m": 1e-3 * EDGE_MM}
    punch = eitsim.Punch(0.02, force_N=0.5, tilt_rad=TILT * leans, **profile)
    same = eitsim.simulate(eitsim.Scene(punches=(punch,)), CARD)
    with tempfile.TemporaryDirectory() as folder:
        count = revolved(Path(folder) / "punch.stl", kind, cuts, TILT * leans)
        (Path(folder) / "scene.toml").write_text('[punch]\nshape = "punch.stl"\nx_mm = 20\nforce_N = 0.5\n')
        found = eitsim.simulate(eitsim.read_scene(Path(folder) / "scene.toml"), CARD)
    assert found.readings is not None
    assert same.readings is not None
    off = np.linalg.norm(found.readings.signal_V - same.readings.signal_V) / np.linalg.norm(same.readings.signal_V)
    return {"kind": kind, "leans": int(leans), "triangles": count,
            "depth_off": found.touches[0].depth_m / same.touches[0].depth_m - 1,
            "depth_stated": found.error_estimate["depth"], "signal_off": off,
            "signal_stated": found.error_estimate["signal"], "profile_stated": same.error_estimate["signal"],
            "cpu_s": found.cost["cpu_s"]}


def main() -> None:
    cases = [(kind, cuts, False) for kind in ("ball", "flat") for cuts in CUTS] + [("flat", CUTS[-1], True)]
    shown(written([row(*case) for case in cases], "punch_shapes"))


if __name__ == "__main__":
    main()
