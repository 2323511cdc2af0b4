"""Touches in three dimensions against finer meshes and against the fast routes, on random skins; what they cost.

Touches are those of `stiff_electrodes.py` from another seed, with soft electrodes and without friction. "fast" is the
cheapest other route that serves the scene, "finer" the FINE level of the same solver, of every third touch. depth and
normal, principal and areal are relative differences of depth and of all touch signals (2-norm) to the default level;
estimate_* is what that states of itself, predicted_cpu_s what it was said to take. Run by `make bench`, which pins
threads; writes results/general_errors.csv.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import stiff_electrodes
from conditions import quick, written
from materials import TABLE_1

from eitsim.mechanics.general.meshing.levels import COARSE, FINE
from eitsim.mechanics.general.solve_general import predicted_cost, solve_general
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Scene
from eitsim.simulation.choose import choose_ways
from touchcal.errors import NotConverged

FIRST, TOUCHES, FINER = 1000, quick(24, 1), 3


def soft(k: int) -> Scene:
    scene = stiff_electrodes.drawn(k)
    return replace(scene, electrodes=replace(scene.electrodes, soft=True))


def differences(scene: Scene, touch: Touch, other: Touch) -> dict[str, float]:
    return {"depth": other.depth_m / touch.depth_m - 1,
            **{strain: stiff_electrodes.effect(scene, strain, other, touch) for strain in STRAINS}}


def rows(k: int) -> Iterator[dict[str, object]]:
    scene = soft(k)
    begun = time.process_time()
    (touch,) = solve_general(TABLE_1, scene.body, scene.punches).touches
    spent = time.process_time() - begun
    shared = {"touch": k, "estimate_depth": touch.depth_error, "cpu_s": spent, **{
        f"estimate_{strain}": float(error) for strain, error in zip(STRAINS, touch.signal_errors, strict=True)},
        "predicted_cpu_s": predicted_cost(TABLE_1, scene.body, scene.punches).cpu_s}
    ((way,), _) = choose_ways(scene)
    begun = time.process_time()
    other = way.route.solve(way.case, TABLE_1, False)
    yield {"what": "fast", "route": way.route.kind, **shared, "other_cpu_s": time.process_time() - begun,
           **differences(scene, touch, other)}
    if k % FINER == 0:
        begun = time.process_time()
        (finer,) = solve_general(TABLE_1, scene.body, scene.punches, level=FINE, coarser=COARSE).touches
        yield {"what": "finer", "route": "general", **shared, "other_cpu_s": time.process_time() - begun,
               **differences(scene, touch, finer)}


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
