"""Touches in three dimensions against finer meshes and against the fast routes, on random skins; what they cost.

Touches are those of `stiff_electrodes.py` from another seed, near edges, with soft electrodes and without friction.
"fast" is the cheapest other route that serves the scene, "finer" the FINE level of the same solver, elements half as
large, where that is predicted to take no more than MOST_S. depth and normal, principal and areal are relative
differences of depth and of all touch signals (2-norm) to the default level, whose own statement is estimate_*;
other_estimate_* is that of the other. reach is how far meshes go from
the punch, gap the distance of the punch's edge from the nearest edge in thicknesses,
predicted_cpu_s what the default level was expected to take. Run by `make bench`, which pins threads; writes
results/general_errors.csv.
"""

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import stiff_electrodes
from conditions import quick, written
from general_touches import predicted_s
from materials import TABLE_1

from eitsim.mechanics.general.meshing.levels import COARSE, FINE, ROUGH
from eitsim.mechanics.general.solve_general import solve_general
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Scene, rim_gap_m
from eitsim.simulation.choose import choose_ways
from touchcal.errors import NotConverged

FIRST, TOUCHES, MOST_S, REACH = 1000, quick(20, 1), 25.0, 4.0
DEFAULT, ROUGHER, FINER = (replace(level, reach=REACH) for level in (COARSE, ROUGH, FINE))


def soft(k: int) -> Scene:
    scene = stiff_electrodes.drawn(k)
    return replace(scene, electrodes=replace(scene.electrodes, soft=True))


def stated(touch: Touch, name: str) -> dict[str, float]:
    return {f"{name}_depth": touch.depth_error, **{
        f"{name}_{strain}": float(error) for strain, error in zip(STRAINS, touch.signal_errors, strict=True)}}


def row(what: str, route: str, default: dict[str, object], scene: Scene, touch: Touch,
        solved: Callable[[], Touch]) -> dict[str, object]:
    begun = time.process_time()
    other = solved()
    return {"what": what, "route": route, **default, "other_cpu_s": time.process_time() - begun,
            **stated(other, "other_estimate"), "depth": other.depth_m / touch.depth_m - 1,
            **{strain: stiff_electrodes.effect(scene, strain, other, touch) for strain in STRAINS}}


def on_default(k: int, scene: Scene) -> tuple[Touch, dict[str, object]]:
    begun = time.process_time()
    (touch,) = solve_general(TABLE_1, scene.body, scene.punches, level=DEFAULT, coarser=ROUGHER).touches
    (punch,) = scene.punches
    return touch, {
        "touch": k, "reach": REACH, "gap": rim_gap_m(scene.body, punch) / scene.body.thickness_m,
        **stated(touch, "estimate"), "cpu_s": time.process_time() - begun,
        "predicted_cpu_s": predicted_s(scene.body, scene.punches, DEFAULT, ROUGHER)}


def rows(k: int) -> Iterator[dict[str, object]]:
    scene = soft(k)
    touch, default = on_default(k, scene)
    ((way,), _) = choose_ways(scene, bodies=False)
    yield row("fast", way.route.kind, default, scene, touch, lambda: way.route.solve(way.case, TABLE_1, False))
    if predicted_s(scene.body, scene.punches, FINER, DEFAULT) < MOST_S:
        yield row("finer", "general", default, scene, touch, lambda: solve_general(
            TABLE_1, scene.body, scene.punches, level=FINER, coarser=DEFAULT).touches[0])


def main() -> None:
    table = []
    for k in range(FIRST, FIRST + TOUCHES):
        try:
            for one in rows(k):
                table.append(one)
                print({key: float(f"{v:.4g}") if isinstance(v, float | np.floating) else v for key, v in one.items()},
                      flush=True)
                written(table, "general_errors")
        except NotConverged as error:
            print(k, error, file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
