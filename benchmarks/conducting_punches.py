"""Whether the stated signal error of conducting punches holds: random ones against a finer mesh of the foam.

Scene k is drawn from the seed (--seed, k) alone: flat, sphere and cone in turn, the three strains in turn, 6 to 20 mm,
0.1 to 2 N evenly in the logarithm, contact impedances of 1e-9 to 1e-3 Ohm m^2 evenly in the logarithm, 16 or 8
electrodes, from the centre to the rim; drawn again where the rim is near, since there the touch is solved in three
dimensions, with a reference of its own (not measured here). `error` is the relative change of dV, 2-norm, by elements
of half the default size, or of a quarter where the scene was solved on those of half already. `stated` is the error
that the result states, `numerical` its numerical part alone, `held` whether it holds, `ratio` how many times the error
it is, of errors that the electrics resolve, `cancel` how many times larger a part of skin or conductor is than dV.
Every TWENTIETH scene is compared with elements of a quarter of the default size under a contact four times as stiff as
well (`finest`). A run continues where results/conducting_punches.csv ends; --seconds S starts no scene after S
seconds. The constant by which a contact ends was chosen on other touches; the table holds seed 4242.
"""

import argparse
import csv
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from conditions import CONDITIONS, RESULTS, conditions, quick
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.scene import STRAINS, Scene, profile_of, scene_from
from eitsim.simulation.routes.route import Case
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from touchcal.errors import NotConverged

SCENES, SEED, TWENTIETH = 45, 4242, 20
FINELY, ROOM_MM, SAME = 4e-4, 2.0, 1e-9
CARD = MaterialCard("Table 1", TABLE_1, None, SKIN_LAW)
COLUMNS = ("scene", "seed", "profile", "strain", "electrodes", "d_mm", "F_N", "x_mm", "impedance_Ohm_m2",
           "outcome", "stated", "numerical", "cancel", "error", "finest", "held", "ratio", "cpu_s", "fine_cpu_s",
           *CONDITIONS)


def scene_of(seed: int, k: int) -> Scene:
    """Scene k of a seed."""
    rng = np.random.default_rng([seed, k])
    while Case(scene := _drawn(rng, k)).near:
        pass
    return scene


def _drawn(rng: np.random.Generator, k: int) -> Scene:
    diameter, force = rng.uniform(6, 20), math.exp(rng.uniform(math.log(0.1), math.log(2)))
    away = (100 - ROOM_MM - diameter / 2) * rng.uniform()
    return scene_from({
        "punch": {"diameter_mm": diameter, "force_N": force, "x_mm": away, "conductor": True,
                  "profile": ("flat", "sphere", "cone")[k % 3], "contact_impedance_Ohm_m2": 10 ** rng.uniform(-9, -3)},
        "skin": {"strain": STRAINS[k // 3 % 3]}, "electrodes": {"count": (16, 8)[k // 9 % 2]}})


def row_of(seed: int, k: int) -> dict[str, Any]:
    """What a scene states and its distance from finer solutions."""
    scene = scene_of(seed, k)
    (punch,), result = scene.punches, simulate(scene, CARD)
    found: dict[str, Any] = {
        "scene": k, "seed": seed, "profile": punch.profile,
        "strain": scene.skin.strain, "electrodes": scene.electrodes.count, "d_mm": punch.diameter_m * 1e3,
        "F_N": punch.force_N, "x_mm": punch.x_m * 1e3, "impedance_Ohm_m2": punch.contact_impedance_Ohm_m2,
        "outcome": result.outcome, "cpu_s": result.cost["cpu_s"]}
    if result.readings is None:
        return found
    part, begun = result.readings.conductors, time.process_time()
    try:
        error = distance(result.readings.signal_V, finely(scene, 2, 1))
        if error < SAME:
            error = distance(result.readings.signal_V, finely(scene, 4, 1))
        found |= {"error": error, "fine_cpu_s": time.process_time() - begun}
        if k % TWENTIETH == 0:
            found["finest"] = distance(result.readings.signal_V, finely(scene, 4, 4))
    except (ValueError, NotConverged) as error:  # the skin's cubic not positive, or the edge not resolved, on that mesh
        return found | {"outcome": f"reference: {error}"[:80]}
    stated = result.error_estimate["signal"]
    return found | {"stated": stated, "numerical": result.numerical_error["signal"], "held": int(error <= stated),
                    "ratio": stated / max(error, FINELY), "cancel": part.grown if part else 1.0}


def finely(scene: Scene, finer: int, stiffer: int) -> np.ndarray:
    """dV on elements so many times smaller than the default size, under a contact so many times as stiff."""
    (punch,) = scene.punches
    fine = solve_touch(TABLE_1, scene.body, punch, element_m=default_element_m(scene.body, punch) / finer,
                       penalty=stiffer * profile_of(punch).default_penalty)
    return solve(scene.body, scene.skin, scene.electrodes, scene.drive, ((punch, fine),), SKIN_LAW,
                 signal=FINELY).signal_V


def distance(one: np.ndarray, other: np.ndarray) -> float:
    """Relative difference, 2-norm."""
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def solve_missing(path: Path, seed: int, last: int, seconds: float) -> None:
    """Append the scenes before `last` that the table lacks."""
    done = set(pd.read_csv(path).query("seed == @seed")["scene"]) if path.exists() else set()
    begun, fresh = time.perf_counter(), not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if fresh:
            writer.writeheader()
        for k in range(last):
            if k in done or time.perf_counter() - begun > seconds:
                continue
            row = row_of(seed, k) | conditions()
            writer.writerow({key: f"{cell:.4g}" if isinstance(cell, float) else cell for key, cell in row.items()})
            file.flush()


def summary(table: pd.DataFrame) -> str:
    """Share of the solved scenes whose stated error holds, by strain and profile; how large both are."""
    solved = table.dropna(subset=["error"])
    groups = [f"{name}: {held.mean():.0%} of {len(held)}" for column in ("strain", "profile")
              for name, held in solved.groupby(column)["held"]]
    fine = solved.dropna(subset=["finest"])
    return (f"{len(solved)} of {len(table)} scenes solved; the stated error holds in {solved['held'].sum():.0f} (its "
            f"numerical part alone in {(solved['error'] <= solved['numerical']).sum()}): {'; '.join(groups)}\n"
            f"error: median {solved['error'].median():.2g}, largest {solved['error'].max():.2g}; stated over error: "
            f"median {solved['ratio'].median():.2g}\nagainst the finest: "
            f"{(fine['finest'] <= fine['stated']).sum()} of {len(fine)} hold")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--last", type=int, default=quick(SCENES, 3))
    options.add_argument("--seed", type=int, default=SEED)
    options.add_argument("--seconds", type=float, default=float("inf"))
    options.add_argument("--out", type=Path, default=RESULTS / "conducting_punches.csv")
    given = options.parse_args()
    given.out.parent.mkdir(exist_ok=True, parents=True)
    solve_missing(given.out, given.seed, given.last, given.seconds)
    print(summary(pd.read_csv(given.out)))


if __name__ == "__main__":
    main()
