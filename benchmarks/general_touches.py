"""Touches solved in three dimensions, any number together, against solvers of one touch and an independent program.

On the paper's foam, 10 mm thick. "alone": one punch far from all edges, against the axisymmetric touch at half of its
default element size; a flat punch of 14 mm, and profiles. "edge": 14 mm and 1 N, so many mm from the straight edge of a
rectangle of 240 x 200 mm, against the finest mesh of the independent program of `edge_touches.py`. "three, to
the coarser mesh": three punches by an edge and a hole, against the coarser of the solver's two meshes.

depth_difference is relative to that; depth_estimate is what the solver states. "mesh alone" leaves in what the mesh
leaves of each punch alone. unknowns count all meshes of the finer level, peak_MB is of the whole process.
Run by `make bench`, which pins threads; writes results/general_touches.csv next to this file.
"""

import resource
from collections.abc import Iterator, Sequence
from typing import Any

from conditions import earlier, quick, shown, written
from materials import TABLE_1

from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.general.meshing.levels import COARSE, ROUGH, Level
from eitsim.mechanics.general.solve_general import GeneralSolution, predicted_cpu_s, solve_general
from eitsim.mechanics.general.solved_layer import lone_touches, problem
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Outline
from eitsim.scene.scene import Body, Punch

DISC = Body(Disc(0.1))
RECTANGLE = Body(Outline("rectangle", width_m=0.24, height_m=0.2))
HOLED = Body(Outline("rectangle", width_m=0.16, height_m=0.1, holes_m=((0.045, 0.02, 0.004),)))
FLAT = Punch(diameter_m=0.014, force_N=1.0)
ALONE = quick((FLAT, Punch(force_N=2.0), Punch(profile="sphere", diameter_m=0.02), Punch(force_N=0.2)), (FLAT,))
GAPS_M = quick((0.005, 0.002), (0.005,))
THREE = (Punch(x_m=0.066, y_m=0.03), Punch(x_m=0.045, y_m=0.038, force_N=0.5, diameter_m=0.01),
         Punch(x_m=0.062, y_m=0.008, force_N=0.8, profile="sphere"))


def row(what: str, found: GeneralSolution, k: int, expected_m: float, predicted_s: float) -> dict[str, Any]:
    """What one punch's touch is off."""
    touch, solved = found.touches[k], found.corrected.solved
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return {"what": what, "punch": k, "depth_mm": touch.depth_m * 1e3, "expected_mm": expected_m * 1e3,
            "depth_difference": touch.depth_m / expected_m - 1, "depth_estimate": touch.depth_error,
            "mesh_alone": solved.depths[k] * solved.field.thickness_m / expected_m - 1,
            "signal_estimate": float(touch.signal_errors[1]), "unknowns": found.unknowns,
            "iterations": touch.iterations, "cpu_s": found.cpu_s, "predicted_cpu_s": predicted_s, "peak_MB": peak}


def solved(body: Body, punches: Sequence[Punch]) -> tuple[GeneralSolution, float]:
    return solve_general(TABLE_1, body, punches), predicted_s(body, punches, COARSE, ROUGH)


def predicted_s(body: Body, punches: Sequence[Punch], level: Level, coarser: Level) -> float:
    """CPU time that `solve_general` is predicted to take, without solving."""
    lone, levels = lone_touches(TABLE_1, body, punches), (coarser, level)
    return predicted_cpu_s([problem(TABLE_1, body, punches, lone, each) for each in levels], levels, lone)


def alone() -> Iterator[dict[str, Any]]:
    for punch in ALONE:
        exact = solve_touch(TABLE_1, DISC, punch, element_m=default_element_m(DISC, punch) / 2)
        found, predicted = solved(DISC, [punch])
        yield row(f"alone, {punch.profile}, {punch.force_N:g} N", found, 0, exact.depth_m, predicted)


def edges() -> Iterator[dict[str, Any]]:
    peer = earlier("edge_touches")
    for gap in GAPS_M:
        expected = float(peer.loc[peer["gap_mm"] == gap * 1e3, "peer_depth_mm"].max()) / 1e3
        punch = Punch(x_m=0.12 - 0.007 - gap)
        found, predicted = solved(RECTANGLE, [punch])
        yield row(f"edge, {gap * 1e3:g} mm", found, 0, expected, predicted)


def three() -> Iterator[dict[str, Any]]:
    found, predicted = solved(HOLED, THREE)
    for k, depth in enumerate(found.coarser.depths.tolist()):
        yield row("three, to the coarser mesh", found, k, depth * HOLED.thickness_m, predicted)


def main() -> None:
    rows = [*edges(), *alone(), *quick(three, lambda: ())()]
    shown(written(rows, "general_touches"))


if __name__ == "__main__":
    main()
