"""Sheets in space: readings of cylinders against their unrolled rectangle, and a prescribed touch against a flat mesh.

A closed cylinder of 50 mm radius and 80 mm height has 16 electrodes, rectangles of 10 mm height. Currents that are even
about two opposite lines see half of it: the flat rectangle with 8 electrodes, which `eitsim.electrics.outline` solves
on triangles of its own. "curved cylinder": quadratic triangles. "faceted cylinder": linear ones as an STL file has
them, whose chords are shorter than the arcs. "signal of a patch": a rectangle of 120 x 80 mm turned in space, 8 round
electrodes and a round patch of 0.3 times the conductance, against triangles of another mesher. Differences are those of
readings between neighbours, 2-norm. Run by `make bench`; writes results/curved_skins.csv next to this file.
"""

import time
from collections.abc import Callable, Iterator

import numpy as np
from conditions import quick, shown, written
from numpy.typing import NDArray

from eitsim.electrics.cem.assembly import impedance
from eitsim.electrics.curved.solve_curved import solve_curved_skin
from eitsim.electrics.outline.adapted_mesh import readings_difference, solve_untouched
from eitsim.electrics.outline.triangles import refined, skin_mesh, triangulated
from eitsim.scene.curved_skin import ConductancePatch, CurvedSkin
from eitsim.scene.edges.outline import Outline
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.polygons import circle
from eitsim.scene.triangles.triangle_files import TriangleMesh
from touchcal.arrays import Array

S = 6e-4  # Sheet conductance, S.
RADIUS_M, HEIGHT_M, COUNT, ELECTRODE_M = 0.05, 0.08, 16, 0.01
PLACES = np.column_stack([np.tile(0.03 * np.arange(4) - 0.045, 2), np.repeat([-0.02, 0.02], 4)])
PATCH_M, PATCH_WIDTH_M, FACTOR = np.array([0.012, -0.006]), 0.016, 0.3


def sheet(columns: Array, rows: Array, place: Callable[[Array, Array], Array], closed: bool = False,
          quadratic: bool = False) -> tuple[Array, NDArray[np.int64], Array]:
    """Nodes (n, 3), triangles (t, 3 or 6) and their quadrilaterals' middles (t, 2) of a grid, each cut in two."""
    a, b = (np.insert(lines[1:], np.arange(len(lines) - 1), (lines[1:] + lines[:-1]) / 2) for lines in (columns, rows))
    s, z = np.meshgrid(np.append(columns[0], a), np.append(rows[0], b), indexing="ij")
    number = np.arange(s.size).reshape(s.shape)
    nodes = place(s.ravel(), z.ravel())
    if closed:
        number[-1] = number[0]
    i, j = (g.ravel() for g in np.meshgrid(np.arange(0, s.shape[0] - 1, 2), np.arange(0, s.shape[1] - 1, 2),
                                           indexing="ij"))
    at = [[number[i + p, j + q] for q in range(3)] for p in range(3)]
    lower = [at[0][0], at[2][0], at[2][2], at[1][0], at[2][1], at[1][1]]
    upper = [at[0][0], at[2][2], at[0][2], at[1][1], at[1][2], at[0][1]]
    cells = np.vstack([np.stack(corners, axis=-1) for corners in (lower, upper)])[:, :6 if quadratic else 3]
    middle = np.tile(np.column_stack([s[i + 1, j + 1], z[i + 1, j + 1]]), (2, 1))
    used, cells = np.unique(cells, return_inverse=True)
    return nodes[used], cells.reshape(len(middle), -1), middle


def cylinder(count: int, a_sector: int, quadratic: bool = True) -> CurvedSkin:
    """A closed cylinder with `count` electrodes, half of each sector wide; a_sector: columns of each, in fours."""
    sector = 2 * np.pi / count
    half = np.linspace(ELECTRODE_M / 2, HEIGHT_M / 2, 2 * a_sector)
    rows = np.concatenate([-half[::-1], ELECTRODE_M * np.linspace(-0.5, 0.5, a_sector // 2 + 1)[1:-1], half])
    nodes, cells, middle = sheet(
        np.linspace(0, 2 * np.pi, count * a_sector + 1), rows,
        lambda s, z: np.column_stack([RADIUS_M * np.cos(s), RADIUS_M * np.sin(s), z]), True, quadratic)
    under = (np.abs(middle[:, 0] / sector % 1 - 0.5) < 0.25) & (np.abs(middle[:, 1]) < ELECTRODE_M / 2)
    groups: dict[str | int, NDArray[np.int64]] = {
        k: np.flatnonzero(under & (middle[:, 0] // sector == k)) for k in range(count)}
    return CurvedSkin(TriangleMesh("cylinder", nodes, cells, groups), S, groups=tuple(range(count)))


def unrolled(count: int) -> Array:
    """Impedance matrix (count / 2, count / 2), Ohm, of the flat rectangle that is half of that cylinder."""
    sector, half = 2 * np.pi / count * RADIUS_M, count // 2
    x = sector * (np.arange(half) - (half - 1) / 2)
    electrodes = Electrodes(kind="surface", count=half, shape="rectangle", width_m=sector / 2, length_m=ELECTRODE_M,
                            x_m=tuple(x.tolist()), y_m=(0.0,) * half)
    outline = Outline("rectangle", width_m=np.pi * RADIUS_M, height_m=HEIGHT_M)
    return solve_untouched(outline, electrodes, S, 1e-6).impedance_Ohm


def even_part(impedance_Ohm: Array) -> Array:
    """What currents see that are even about the line between the first and the last electrode."""
    half = len(impedance_Ohm) // 2
    even = impedance_Ohm[:half, :half] + impedance_Ohm[:half, :half - 1:-1]
    return even - even.mean(axis=0)


def turned(points: Array) -> Array:
    """Points (n, 2) of a plane turned in space, (n, 3)."""
    return points @ np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0][:, :2].T


def touched_sheet() -> CurvedSkin:
    """The turned rectangle with round electrodes and its patch."""
    nodes, cells, _ = sheet(np.linspace(-0.06, 0.06, 13), np.linspace(-0.04, 0.04, 9),
                            lambda s, z: turned(np.column_stack([s, z])))
    patch = ConductancePatch(tuple(turned(PATCH_M[None])[0].tolist()), PATCH_WIDTH_M, FACTOR)
    return CurvedSkin(TriangleMesh("rectangle", nodes, cells, {}), S, places_m=tuple(map(tuple, turned(PLACES))),
                      widths_m=0.01, patches=(patch,))


def flat_change(area_m2: float) -> Array:
    """What the patch changes of the impedance matrix, Ohm, on triangles of an area at most by the flat mesher."""
    electrodes = Electrodes(kind="surface", count=8, width_m=0.01, x_m=tuple(PLACES[:, 0].tolist()),
                            y_m=tuple(PLACES[:, 1].tolist()))
    triangles = refined(
        triangulated(Outline("rectangle", width_m=0.12, height_m=0.08), electrodes,
                     [circle(PATCH_M, PATCH_WIDTH_M / 2, 96)]), lambda places_m: np.full(len(places_m), area_m2))
    mesh = skin_mesh(triangles, electrodes)
    inside = np.linalg.norm(triangles.centres_m - PATCH_M, axis=1) < PATCH_WIDTH_M / 2
    touched, rest = (impedance(mesh, np.where(inside, factor * S, S), 1e-2) for factor in (FACTOR, 1.0))
    return touched - rest


def rows() -> Iterator[dict[str, object]]:
    known = unrolled(COUNT)
    for what, a_sector, quadratic, asked in quick(
            (("curved cylinder", 8, True, 1e-6), ("faceted cylinder", 4, False, 1e-4),
             ("faceted cylinder", 8, False, 1e-4)),
            (("faceted cylinder", 4, False, 1e-4),)):
        begun = time.process_time()
        found = solve_curved_skin(cylinder(COUNT, a_sector, quadratic), readings=asked)
        yield {"case": what, "around": COUNT * a_sector, "asked": asked,
               "difference": readings_difference(even_part(found.impedance_Ohm), known),
               "estimate": found.readings_error, "nodes": found.nodes, "cpu_s": time.process_time() - begun}
    begun = time.process_time()
    found = solve_curved_skin(touched_sheet())
    spent = time.process_time() - begun
    yield {"case": "signal of a patch", "asked": 1e-3, "estimate": found.signal_error, "nodes": found.nodes,
           "difference": readings_difference(found.touched_Ohm - found.impedance_Ohm, flat_change(quick(1e-6, 4e-6))),
           "cpu_s": spent}


def main() -> None:
    shown(written(list(rows()), "curved_skins"))


if __name__ == "__main__":
    main()
