"""EIDORS's own solution of thick discs next to ours, on the same linear tetrahedra.

EIDORS runs under Octave (`electric_peers.eidors`): `python benchmarks/eidors_volume.py EIDORS`, where EIDORS is the
folder with eidors_startup.m, or EIDORS_PATH names it. Disc k is drawn from (SEED, k): 8 or 16 electrodes on the whole
rim, on its upper half or as patches on top, each of its own contact impedance, a conductivity drawn in every
tetrahedron and one that is even. "off" is the relative difference of all readings (2-norm), "most_off" the largest over
the largest reading. Writes results/eidors_volume.csv; without EIDORS it writes nothing.
"""

import os
import sys
import time

import numpy as np
from conditions import conditions, quick, shown, written
from electric_peers import eidors, on_circle
from scipy.spatial import Delaunay

from eitsim.electrics.volume.volume_cem import VolumeMesh, volume_impedance

DISCS, SEED = quick(9, 1), 50
PLACES = ("rim", "upper rim", "top")
RADIUS_M, THICKNESS_M = 0.05, 0.02


def thick_disc(rng: np.random.Generator, place: str, count: int, layers: int = 6, circles: int = 12) -> VolumeMesh:
    """Tetrahedra, three a prism, between circles of points that are turned at random; half the rim is under
    electrodes."""
    rim = 6 * count
    flat = RADIUS_M * np.vstack([np.zeros((1, 2)), *(k / circles * on_circle(max(6, round(rim * k / circles)),
                                                     0.0 if k == circles else rng.random())
                                                     for k in range(1, circles + 1))])
    a, b, c = np.sort(Delaunay(flat).simplices, axis=1).T
    heights, n = THICKNESS_M * np.sort(np.append(rng.uniform(-0.95, -0.05, layers - 2), [-1.0, -0.5, 0.0])), len(flat)
    nodes = np.vstack([np.column_stack([flat, np.full(n, z)]) for z in heights])
    cells, faces = [], []
    edge = len(flat) - rim + np.arange(rim)
    low, high = np.sort(np.stack([edge, np.roll(edge, -1)]), axis=0)
    held = np.arange(rim) % 6 < 3
    for k, bottom in enumerate(heights[:-1]):
        i, j = k * n, (k + 1) * n
        cells += [np.stack(one, axis=1) for one in ((a + i, b + i, c + i, c + j), (a + i, b + i, b + j, c + j),
                                                    (a + i, a + j, b + j, c + j))]
        if place == "rim" or (place == "upper rim" and bottom >= -0.5 * THICKNESS_M):
            faces += [np.stack(one, axis=1)[held] for one in ((low + i, high + i, high + j),
                                                              (low + i, low + j, high + j))]
    electrode = np.tile(np.arange(rim)[held] // 6, len(faces))
    if place == "top":  # EIDORS counts the triangles whose corners are all of an electrode
        turn = np.arctan2(flat[:, 1], flat[:, 0]) % (2 * np.pi) / (2 * np.pi) * count
        away = np.hypot(*flat.T) / RADIUS_M
        owner = np.where((away > 0.55) & (away < 0.95) & (turn % 1 < 0.6), turn.astype(int), -1)
        top = np.stack([a, b, c], axis=1)
        ring = (owner[top] == owner[top[:, :1]]).all(axis=1) & (owner[a] >= 0)
        faces, electrode = [top[ring] + (len(heights) - 1) * n], owner[a[ring]]
    return VolumeMesh(nodes, _positive(nodes, np.concatenate(cells)), np.concatenate(faces), electrode, count)


def _positive(nodes: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Tetrahedra of positive volume."""
    volume = np.linalg.det(nodes[cells[:, 1:]] - nodes[cells[:, :1]])
    return np.where((volume > 0)[:, None], cells, cells[:, [0, 2, 1, 3]])


def rows(k: int) -> list[dict[str, object]]:
    """Those of a disc; none without EIDORS."""
    rng, place = np.random.default_rng((SEED, k)), PLACES[k % len(PLACES)]
    count = int(rng.choice([8, 16]))
    mesh = thick_disc(rng, place, count)
    contact = rng.uniform(1e-4, 1e-2, count)
    cases = np.column_stack([np.ones(len(mesh.cells)), rng.uniform(0.5, 5, len(mesh.cells))])
    found, out = eidors(mesh, cases, contact), []
    if found is None:
        return out
    for name, sigma, theirs in zip(("even", "drawn"), cases.T, found.readings.T, strict=True):
        begun = time.process_time()
        ours = found.of(volume_impedance(mesh, sigma, contact))
        out.append({"disc": k, "electrodes": count, "place": place, "tetrahedra": len(mesh.cells), "conductivity": name,
                    "off": np.linalg.norm(ours - theirs) / np.linalg.norm(theirs),
                    "most_off": np.abs(ours - theirs).max() / np.abs(theirs).max(), "readings": len(theirs),
                    "cpu_s": time.process_time() - begun, "peer": found.version, **conditions()})
    return out


def main() -> None:
    os.environ["EIDORS_PATH"] = next(iter(sys.argv[1:]), os.environ.get("EIDORS_PATH", ""))
    found = [row for k in range(DISCS) for row in rows(k)]
    if not found:
        return
    table = written(found, "eidors_volume")
    shown(table.groupby(["place", "conductivity"]).agg(discs=("off", "size"), off=("off", "max"),
                                                       most_off=("most_off", "max")).reset_index())


if __name__ == "__main__":
    main()
