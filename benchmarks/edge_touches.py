"""Touches near the straight edge of a rectangle against an independent solution in three dimensions.

A flat punch of 14 mm with 1 N on a foam of 10 mm, 2, 5 and 10 mm from the edge of a rectangle of 240 x 200 mm.
`peers/foam_at_edge.py` solves half of the foam about the plane of symmetry by hexahedra with 27 nodes, on several
meshes; it shares no code with eitsim. Columns are relative to the peer's finest mesh:

depth_difference, and the 2-norm of differences of the surface's strains, within 30 mm of the punch's edge ("strain");
"edge": that of what the edge changes of the strains, near it less far from all edges, each program by itself, where
most of what a mesh misses under the punch cancels; both over the 2-norm of the whole strain. "peer": the two finest
meshes of the peer to each other, its own error and more. "near the edge" is on the mesh of tables and of touches near
several edges, "finer near the edge" on that of the latter with --exact. "one edge" and "one edge, exact" are
`solve_near_rim`. "as if no edge" leaves the edge out of eitsim's touch, which shows what it changes.

The peer solves its equations on a GPU where PyTorch finds one. MESHES take a processor minutes and know strains in
plane to 5 to 15 %. The stored table has FINE, 90 GiB of a GPU: EDGE_PEER names a folder that keeps what the peer found
with FINE in gap_2, gap_5, gap_10 and gap_36; a found.npz that `python peers/foam_at_edge.py FOLDER` wrote on another
machine is taken from there. Run by `make bench`, which pins threads; writes results/edge_touches.csv next to this file.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from conditions import quick, shown, written
from materials import TABLE_1
from rim import strains, two_norm

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.rim.correction import no_correction
from eitsim.mechanics.rim.solve_near_rim import FINE as SEVERAL
from eitsim.mechanics.rim.solve_near_rim import FULL_DISC, on_two_meshes
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import STRAINS, Body, Punch
from eitsim.simulation.near_edges import solve_near_rim, with_signal_errors

BODY = Body(Outline("rectangle", width_m=0.24, height_m=0.2))
PUNCH = Punch(diameter_m=0.014, force_N=1.0)
GAPS_M = quick((0.002, 0.005, 0.01), (0.005,))
# Elements of the peer's meshes at the punch's edge, mm, and how many it has on half a circle.
MESHES = quick(((0.24, 8), (0.16, 10)), ((0.6, 6), (0.4, 6)))
FINE = ((0.24, 8), (0.12, 12), (0.06, 18), (0.04, 24))  # The same of the stored table.
FAR_GAP_M = 0.036  # Gap of the peer's touch that stands for one far from all edges.
FAR_M = 0.05  # Radius about the punch at which the peer's foam is held.
ANGLES = 40  # Points of a half circle.


def places() -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2), m, of half of the surface about a punch, and their areas (n,), m^2; dense about its edge."""
    edges = 1e-3 * np.unique(np.concatenate([np.linspace(0, 6, 13), np.linspace(6, 9, 61), np.linspace(9, 37, 57)]))
    radius, angle = np.meshgrid((edges[1:] + edges[:-1]) / 2, (np.arange(ANGLES) + 0.5) / ANGLES * np.pi, indexing="ij")
    area = radius * np.diff(edges)[:, None] * np.pi / ANGLES
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2), area.ravel()


def by_peer(gap_m: float, points_m: np.ndarray) -> list[dict[str, np.ndarray]]:
    """Depth, mm, deformation gradients (n, 3, 3) at points of the surface and cost, of each mesh."""
    kept = os.environ.get("EDGE_PEER")
    with tempfile.TemporaryDirectory() as given:
        folder = Path(kept or given) / f"gap_{gap_m * 1e3:g}"
        folder.mkdir(parents=True, exist_ok=True)
        meshes = FINE if kept else MESHES
        if not (folder / "found.npz").exists():
            np.savez(folder / "problem.npz", radius=PUNCH.diameter_m * 500, fillet=PUNCH.fillet_m * 1e3,
                     gap=gap_m * 1e3, thickness=BODY.thickness_m * 1e3, far=FAR_M * 1e3, mu=TABLE_1.mu_Pa / 1e3,
                     alpha=TABLE_1.alpha, force=1e3 * (PUNCH.force_N or 0.0), elements=[m[0] for m in meshes],
                     sectors=[m[1] for m in meshes], points=points_m * 1e3)
            subprocess.run([sys.executable, str(Path(__file__).parent / "peers" / "foam_at_edge.py"), str(folder)],
                           check=True)
        with np.load(folder / "found.npz") as found:
            return [{name.rpartition("_")[0]: found[name] for name in found.files if name.endswith(f"_{number}")}
                    for number in range(len(meshes))]


def driving(gradient: np.ndarray) -> np.ndarray:
    """Strains (3, n) by STRAINS of deformation gradients (n, 3, 3) at the surface."""
    right = np.swapaxes(gradient, 1, 2) @ gradient
    plane = np.sqrt(np.linalg.eigvalsh(right[:, :2, :2]))
    areal = plane.prod(axis=1)
    known = {"normal": np.linalg.det(gradient) / areal, "principal": plane[:, 1], "areal": areal}
    return np.stack([known[name] - 1 for name in STRAINS])


def differences(one: np.ndarray, other: np.ndarray, whole: np.ndarray, area: np.ndarray, name: str) -> dict[str, float]:
    """2-norms of differences of strains (3, n) by STRAINS, over those of the whole."""
    return {f"{name}_{strain}": two_norm(a - b, area) / two_norm(c, area)
            for strain, a, b, c in zip(STRAINS, one, other, whole, strict=True)}


def rows() -> Iterator[dict[str, object]]:
    whole, areas = places()
    far = [driving(mesh["gradient"]) for mesh in by_peer(FAR_GAP_M, whole)[-2:]]
    alone = solve_touch(TABLE_1, BODY, PUNCH)
    fine_alone = solve_touch(TABLE_1, BODY, PUNCH, element_m=default_element_m(BODY, PUNCH) / 2)
    for gap in GAPS_M:
        inside = whole[:, 0] < PUNCH.diameter_m / 2 + gap - 1e-6
        points, area = whole[inside], areas[inside]
        peer = by_peer(gap, points)
        rough, fine = (driving(mesh["gradient"]) for mesh in peer[-2:])
        rough_change, change = rough - far[0][:, inside], fine - far[1][:, inside]
        depth_m, rough_m = (1e-3 * float(mesh["depth"]) for mesh in peer[:-3:-1])
        punch = replace(PUNCH, x_m=(BODY.outline.width_m or 0) / 2 - gap - PUNCH.diameter_m / 2)
        near = with_signal_errors(on_two_meshes(alone, TABLE_1, BODY, punch))
        finer = with_signal_errors(on_two_meshes(fine_alone, TABLE_1, BODY, punch, coarse=SEVERAL,
                          fine=replace(FULL_DISC, out_to=SEVERAL.out_to)))
        one, exact = (solve_near_rim(TABLE_1, BODY, punch, whole=whole) for whole in (False, True))
        assert near.rim is not None
        without = replace(alone, rim=no_correction(near.rim))
        before = strains(without, no_correction(near.rim), points)
        for what, touch in (("near the edge", near), ("finer near the edge", finer), ("one edge", one),
                            ("one edge, exact", exact), ("as if no edge", without)):
            assert touch.rim is not None
            found = strains(touch, touch.rim, points)
            yield {"what": what, "gap_mm": gap * 1e3, "depth_mm": touch.depth_m * 1e3, "peer_depth_mm": depth_m * 1e3,
                   "depth_difference": touch.depth_m / depth_m - 1, "depth_estimate": touch.depth_error,
                   "peer_depth": rough_m / depth_m - 1, **differences(found, fine, fine, area, "strain"),
                   **differences(rough, fine, fine, area, "peer_strain"),
                   **differences(found - before, change, fine, area, "edge"),
                   **differences(rough_change, change, fine, area, "peer_edge"), "cpu_s": touch.cpu_s,
                   "peer_cpu_s": float(sum(mesh["cpu_s"] for mesh in peer)), "peer_unknowns": int(peer[-1]["unknowns"]),
                   "peer_element_mm": float(peer[-1]["element"]), "peer_machine": str(peer[-1]["machine"])}


def main() -> None:
    solve_near_rim(TABLE_1, BODY, replace(PUNCH, x_m=0.1))  # compiles
    found: list[dict[str, object]] = []
    for one in rows():
        found.append(one)
        table = written(found, "edge_touches")
    shown(table)


if __name__ == "__main__":
    main()
