"""Touches near several edges of a skin against finer solutions: corners, a strip, a re-entrant corner, holes.

A flat punch of 14 mm (10 mm in the strip between hole and edge) on 10 mm of table 1's foam. Each touch is solved as
scenes do, and on finer meshes with more harmonics (`whole`); columns: depth_difference and what was stated of it,
signal_difference, the 2-norm of the difference of the signals of a nominal sensor whose skin is driven by the largest
strain in plane, and what was stated; one_edge_depth: depth with the nearest edge alone over that with all, less 1;
times: CPU seconds over those with the nearest edge alone. Run by `make bench`, which pins threads; writes
results/several_edges.csv next to this file.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from conditions import quick, shown, written
from materials import TABLE_1

from eitsim.electrics.forward.nominal_sensor import signal_differences
from eitsim.mechanics.rim.solve_near_rim import solve_near_rim
from eitsim.scene.nearest_edge import nearest_edge
from eitsim.scene.outline import corners_and_edges
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Punch
from touchcal.jit import cpu_s

RECTANGLE = Body(outline="rectangle", width_m=0.12, height_m=0.08)
STRIP = Body(outline="rectangle", width_m=0.2, height_m=0.03)
HOLED = Body(outline="polygon", points_m=((0, 0), (0.2, 0), (0.2, 0.06), (0.08, 0.06), (0.08, 0.15), (0, 0.15)),
             holes_m=((0.04, 0.1, 0.012),))


def corner(gap_m: float, force_N: float = 1.0) -> tuple[Body, Punch]:
    return RECTANGLE, Punch(0.053 - gap_m, 0.033 - gap_m, 0.014, force_N=force_N)


CASES = quick({
    "corner, 10 mm from both edges": corner(0.01), "corner, 5 mm": corner(0.005), "corner, 2 mm": corner(0.002),
    "corner, 2 mm, 0.1 N": corner(0.002, 0.1), "middle of a strip of 30 mm": (STRIP, Punch(0, 0, 0.014, force_N=1)),
    "re-entrant corner": (HOLED, Punch(0.075, 0.055, 0.014, force_N=1)),
    "2 mm from a hole": (HOLED, Punch(0.04, 0.079, 0.014, force_N=1)),
    "between hole and edge": (HOLED, Punch(0.014, 0.1, 0.01, force_N=1)),
}, {"corner, 5 mm": corner(0.005)})


def signals_off(body: Body, punch: Punch, one: Touch, other: Touch) -> float:
    """Relative difference of the nominal sensor's signals by two touches, of the skin alone."""
    assert one.rim is not None
    assert other.rim is not None
    edge, place = nearest_edge(body.shape, (punch.x_m, punch.y_m)), np.array([punch.x_m, punch.y_m])
    start, end = corners_and_edges(body.shape)
    disc = Body(radius_m=body.radius_m, thickness_m=body.thickness_m)
    x, y = ((disc.radius_m - edge.distance_m) * edge.towards).tolist()
    moved = Punch(x, y, punch.diameter_m, force_N=punch.force_N)
    off = signal_differences(disc, moved, other, one.rim, other.rim, (start - place, end - place))
    return float(off[STRAINS.index("principal")])


def rows() -> Iterator[dict[str, object]]:
    for case, (body, punch) in CASES.items():
        begun = cpu_s()
        alone = solve_near_rim(TABLE_1, body, punch)
        one_cpu_s = cpu_s() - begun
        begun = cpu_s()
        found = solve_near_rim(TABLE_1, body, punch, all_edges=True)
        spent = cpu_s() - begun
        finer = solve_near_rim(TABLE_1, body, punch, all_edges=True, whole=True)
        yield {"case": case, "force_N": punch.force_N, "depth_mm": found.depth_m * 1e3,
               "depth_difference": found.depth_m / finer.depth_m - 1, "depth_estimate": found.depth_error,
               "signal_difference": signals_off(body, punch, found, finer),
               "signal_estimate": float(found.signal_errors[STRAINS.index("principal")]),
               "one_edge_depth": alone.depth_m / found.depth_m - 1, "cpu_s": spent, "times": spent / one_cpu_s}


def main() -> None:
    solve_near_rim(TABLE_1, *corner(0.01), all_edges=True)  # compiles
    found: list[dict[str, object]] = []
    for one in rows():
        found.append(one)
        table = written(found, "several_edges")
    shown(table)


if __name__ == "__main__":
    main()
