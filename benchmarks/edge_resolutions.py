"""Touches near the straight edge of a rectangle on several meshes against the finest of them, eitsim's own.

Touches and points as in `edge_touches`, whose independent peer needs a large GPU for a mesh that knows strains in
plane to 1 %; this one takes a processor minutes. Columns are relative to FINEST: depth_difference, and the 2-norm of
differences of the surface's strains, within 30 mm of the punch's edge, over that of the strain. "mesh of tables" is
FINE, "near one edge" and "exact near one edge" the meshes of `solve_near_rim` without and with whole=True. All have
the same axisymmetric touch, on half the default elements, whose own error is left out, as is what the meshes share: the
weak tie off the skin (a tenth of it changes the strains in plane by half a percent) and the harmonics that FINEST
lacks. cpu_s is of the change on its mesh alone. Run by `make bench`, which pins threads; writes
results/edge_resolutions.csv next to this file.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from conditions import quick, shown, written
from edge_touches import BODY, PUNCH, differences, places
from materials import TABLE_1
from rim import strains

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.harmonics.arcs import OffsetDisc
from eitsim.mechanics.rim.correction import apply_correction
from eitsim.mechanics.rim.solve_near_rim import (
    COARSE,
    FINE,
    ONE_EDGE,
    ONE_EDGE_FINER,
    Resolution,
    on_a_disc,
    rim_changes,
)
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.nearest_edge import nearest_edge
from eitsim.scene.results import Touch

GAPS_M = quick((0.005, 0.002), (0.005,))
MESHES = {"mesh of tables": FINE, "near one edge": ONE_EDGE, "exact near one edge": ONE_EDGE_FINER}
FINEST = quick(Resolution(2.0, 18, 22, parts=3, inside=0.0, grading=0.25), ONE_EDGE_FINER)


def solved(alone: Touch, gap_m: float, fineness: Resolution) -> tuple[Touch, float]:
    """A touch on one mesh, from the change on the coarse one, and CPU seconds of the change."""
    punch = replace(PUNCH, x_m=(BODY.width_m or 0) / 2 - gap_m - PUNCH.diameter_m / 2)
    edge = nearest_edge(BODY.shape, (punch.x_m, punch.y_m))
    changes = rim_changes(TABLE_1, *on_a_disc(BODY, punch), (COARSE, fineness), OffsetDisc(edge.disc_m, edge.offset_m))
    next(changes)
    begun = time.process_time()
    change = next(changes)
    return apply_correction(alone, replace(change, field=replace(change.field, towards=edge.towards))), (
        time.process_time() - begun)


def rows() -> Iterator[dict[str, object]]:
    points, areas = places()
    alone = solve_touch(TABLE_1, BODY, PUNCH, element_m=default_element_m(BODY, PUNCH) / 2)

    def surface(touch: Touch, inside: np.ndarray) -> np.ndarray:
        assert touch.rim is not None
        return strains(touch, touch.rim, points[inside])

    for gap in GAPS_M:
        inside = points[:, 0] < PUNCH.diameter_m / 2 + gap - 1e-6
        finest, took = solved(alone, gap, FINEST)
        known = surface(finest, inside)
        for what, fineness in MESHES.items():
            touch, cpu_s = solved(alone, gap, fineness)
            yield {"what": what, "gap_mm": gap * 1e3, "depth_mm": touch.depth_m * 1e3,
                   "depth_difference": touch.depth_m / finest.depth_m - 1,
                   **differences(surface(touch, inside), known, known, areas[inside], "strain"), "cpu_s": cpu_s,
                   "finest_cpu_s": took, "harmonics": fineness.harmonics, "finest_harmonics": FINEST.harmonics}


def main() -> None:
    solved(solve_touch(TABLE_1, BODY, PUNCH), 0.01, COARSE)  # compiles
    found: list[dict[str, object]] = []
    for one in rows():
        found.append(one)
        table = written(found, "edge_resolutions")
    shown(table)


if __name__ == "__main__":
    main()
