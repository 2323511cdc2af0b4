"""Touches near several edges of a skin against finer solutions: corners, a strip, a re-entrant corner, holes.

A flat punch of 14 mm (10 mm in the strip between hole and edge) on 10 mm of table 1's foam. Each touch is solved as
scenes do, and on finer meshes with more harmonics (`whole`); columns: depth_difference and what was stated of it,
signal_difference, the 2-norm of the difference of the signals of a nominal sensor whose skin is driven by the largest
strain in plane, and what was stated; one_edge_depth: depth with the nearest edge alone over that with all, less 1;
times: CPU seconds over those with the nearest edge alone. Writes results/several_edges.csv next to this file.

results/added_edges.csv: what two straight edges change, added up, against both solved together, on one mesh: relative
differences of the nominal sensor's signals by each strain, and the products of what both edges may change of them, as
plans tabulate it. Run by `make bench`, which pins threads.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from conditions import quick, shown, written
from materials import TABLE_1

from eitsim.electrics.forward.nominal_sensor import signal_differences
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.harmonics.arcs import OffsetDisc, OffsetOutline
from eitsim.mechanics.load_paths.several_edges import summed_changes
from eitsim.mechanics.rim.solve_near_rim import COARSE, rim_change
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Outline
from eitsim.scene.nearest_edge import nearest_edge
from eitsim.scene.polygons import corners_and_edges
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Punch
from eitsim.simulation.edge_effects import rim_effect
from eitsim.simulation.near_edges import solve_near_rim
from touchcal.jit import cpu_s

RECTANGLE = Body(Outline("rectangle", width_m=0.12, height_m=0.08))
STRIP = Body(Outline("rectangle", width_m=0.2, height_m=0.03))
HOLED = Body(Outline("polygon", points_m=((0, 0), (0.2, 0), (0.2, 0.06), (0.08, 0.06), (0.08, 0.15), (0, 0.15)),
    holes_m=((0.04, 0.1, 0.012),)))


def corner(gap_m: float, force_N: float = 1.0) -> tuple[Body, Punch]:
    return RECTANGLE, Punch(0.053 - gap_m, 0.033 - gap_m, 0.014, force_N=force_N)


CASES = quick({
    "corner, 10 mm from both edges": corner(0.01), "corner, 5 mm": corner(0.005), "corner, 2 mm": corner(0.002),
    "corner, 2 mm, 0.1 N": corner(0.002, 0.1), "middle of a strip of 30 mm": (STRIP, Punch(0, 0, 0.014, force_N=1)),
    "re-entrant corner": (HOLED, Punch(0.075, 0.055, 0.014, force_N=1)),
    "2 mm from a hole": (HOLED, Punch(0.04, 0.079, 0.014, force_N=1)),
    "between hole and edge": (HOLED, Punch(0.014, 0.1, 0.01, force_N=1)),
}, {"corner, 5 mm": corner(0.005)})
# Gaps of two edges, thicknesses.
PAIRS = quick((("corner", 0.5, 0.5), ("corner", 1.0, 1.0), ("corner", 2.0, 2.0), ("corner", 0.5, 2.0),
               ("corner", 0.2, 1.0), ("strip", 0.5, 0.5), ("strip", 1.0, 1.0), ("strip", 1.0, 2.0)),
              (("corner", 1.0, 1.0),))
FORCES_N = quick((0.1, 1.0), (1.0,))


def signals_off(body: Body, punch: Punch, one: Touch, other: Touch) -> float:
    """Relative difference of the nominal sensor's signals by two touches, of the skin alone."""
    assert one.rim is not None
    assert other.rim is not None
    edge, place = nearest_edge(body.outline, (punch.x_m, punch.y_m)), np.array([punch.x_m, punch.y_m])
    start, end = corners_and_edges(body.outline)
    disc = Body(Disc(body.radius_m), body.thickness_m)
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


def edges(right: float, left: float, up: float) -> OffsetOutline:
    """A rectangle about a punch, m, its lower edge far away."""
    loop = np.array([[-left, -0.3], [right, -0.3], [right, up], [-left, up]])
    return OffsetOutline(loop, np.roll(loop, -1, axis=0))


def added() -> Iterator[dict[str, object]]:
    disc = Body(Disc(0.1), 0.01)
    for force, (kind, first, second) in itertools.product(FORCES_N, PAIRS):
        punch = Punch(diameter_m=0.014, force_N=force)
        touch = solve_touch(TABLE_1, disc, punch)
        near, far = (gap * disc.thickness_m + punch.diameter_m / 2 for gap in (first, second))
        outline = edges(near, 0.3, far) if kind == "corner" else edges(near, far, 0.3)
        together = rim_change(TABLE_1, disc, punch, COARSE, outline)
        each = [rim_change(TABLE_1, disc, punch, COARSE, OffsetDisc(100.0, 100.0 - away)) for away in (near, far)]
        towards = [np.array([1.0, 0.0]), np.array([0.0, 1.0] if kind == "corner" else [-1.0, 0.0])]
        summed = summed_changes(each, towards)
        off = signal_differences(disc, replace(punch, x_m=disc.radius_m - near), touch, summed.field, together.field,
                                 (outline.start, outline.end))
        yield {"kind": kind, "first_gap": first, "second_gap": second, "force_N": force,
               "depth_difference": (summed.depth_m - together.depth_m) / touch.depth_m,
               **{f"{strain}_difference": value for strain, value in zip(STRAINS, off, strict=True)},
               **{f"{strain}_product": np.prod([rim_effect(gap, 1.0, strain) for gap in (first, second)])
                  for strain in STRAINS}}


def main() -> None:
    solve_near_rim(TABLE_1, *corner(0.01), all_edges=True)  # compiles
    shown(written(list(added()), "added_edges"))
    found: list[dict[str, object]] = []
    for one in rows():
        found.append(one)
        table = written(found, "several_edges")
    shown(table)


if __name__ == "__main__":
    main()
