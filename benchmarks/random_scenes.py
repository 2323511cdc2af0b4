"""How often random scenes fail, why, and what they cost: 2,000 touches over cards, diameters, forces and places.

Scene k is drawn from the seed (SEED, k) alone, so that pieces may be solved in any order. A run continues where
results/random_scenes.csv ends; --last N stops at scene N, --where and --friction solve only such scenes, --seconds S
starts no scene after S seconds. Each scene is solved by eitsim.simulation.simulate.simulate, so that its CPU time holds
plan, mechanics, skin and electrics. The lowest force is 1 mN for Table 1, the highest 1.3 mu_0 pi d^2, spread evenly in
its logarithm. Pin threads to one as `make bench` does.
"""

import argparse
import csv
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import CONDITIONS, RESULTS, conditions, quick
from materials import SKIN_LAW, TABLE_1

from eitsim.scene.scene import Scene, scene_from
from eitsim.scene.scene_parts import FRICTIONS
from eitsim.simulation.routes.route import Case
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.hyperfoam import Hyperfoam

SCENES, SEED = 2000, 20
# least force, N, of Table 1, and largest over mu_0 pi d^2
LEAST_N, LARGEST = 1e-3, 1.3
LAWS = {
    "Table 1": TABLE_1,
    # `matcal fit --stable drucker` of data_raw/uniaxial.csv and shear.csv
    "stable refit": Hyperfoam(np.array([79.90904941630184, -101934.87630934353, 110283.13210704742]),
                              np.array([-2.247074156838581, 4.10513558158772, 4.291536061987738]), np.zeros(3)),
    "mu x 1e-3": replace(TABLE_1, mu_Pa=1e-3 * TABLE_1.mu_Pa),
    "mu x 1e3": replace(TABLE_1, mu_Pa=1e3 * TABLE_1.mu_Pa),
    "nu 0.3": replace(TABLE_1, nu=np.full(3, 0.3)),
    # a law of three terms near confluence, as fits of a measured shoe foam give it
    "shoe foam": Hyperfoam(np.array([2143569.5152974133, -5145106.014710549, 3123996.6616385793]),
                           np.array([-0.3144148891266444, 0.012992111254543137, 0.34039911163573067]), np.zeros(3)),
}
COLUMNS = ("scene", "card", "friction", "where", "d_mm", "F_N", "x_mm", "y_mm", "outcome", "message", "depth_mm",
           "depth_error", "sigma_max_error", "signal_error", "fraction_non_elliptic", "cpu_s", "peak_MB", *CONDITIONS)


def scene_of(k: int) -> tuple[str, Scene]:
    """Name of the card and scene k; cards and frictions take turns."""
    rng, name = np.random.default_rng([SEED, k]), list(LAWS)[k % len(LAWS)]
    diameter, law = rng.uniform(8, 20), LAWS[name]
    most = LARGEST * law.mu_0_Pa * np.pi * (diameter * 1e-3) ** 2
    force = np.exp(rng.uniform(np.log(LEAST_N * law.mu_0_Pa / TABLE_1.mu_0_Pa), np.log(most)))
    away, angle = (100 - diameter / 2) * np.sqrt(rng.uniform()), rng.uniform(0, 2 * np.pi)
    punch = {"diameter_mm": diameter, "force_N": float(force), "x_mm": float(away * np.cos(angle)),
             "y_mm": float(away * np.sin(angle)), "friction": ("none", "stick")[k // len(LAWS) % 2]}
    return name, scene_from({"punch": punch})


def place_of(scene: Scene) -> str:
    """"rim" where the mechanics is three-dimensional, else "interior"."""
    return "rim" if Case(scene).near else "interior"


def solved(k: int, name: str, scene: Scene) -> dict[str, object]:
    """Row of scene k."""
    (punch,) = scene.punches
    card = MaterialCard(name, LAWS[name], None, SKIN_LAW)
    result = simulate(scene, card)
    touch = result.touches[0] if result.touches else None
    return {"scene": k, "card": name, "friction": punch.friction, "where": place_of(scene),
            "d_mm": punch.diameter_m * 1e3, "F_N": punch.force_N, "x_mm": punch.x_m * 1e3, "y_mm": punch.y_m * 1e3,
            "outcome": result.outcome, "message": result.message,
            "depth_mm": touch.depth_m * 1e3 if touch else None,
            "fraction_non_elliptic": touch.fraction_non_elliptic if touch else None,
            **{f"{key}_error": result.error_estimate.get(key) for key in ("depth", "sigma_max", "signal")},
            "cpu_s": result.cost["cpu_s"], "peak_MB": result.cost["peak_MB"]}


def solve_missing(path: Path, last: int, where: str, friction: str, seconds: float) -> None:
    """Append the scenes before `last`, of that place and friction, that the table lacks."""
    done = set(table_of(path)["scene"]) if path.exists() else set()
    begun, fresh = time.perf_counter(), not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if fresh:
            writer.writeheader()
        for k in range(last):
            name, scene = scene_of(k)
            wanted = where in ("all", place_of(scene)) and friction in ("all", scene.punches[0].friction)
            if k in done or not wanted:
                continue
            if time.perf_counter() - begun > seconds:
                return
            row = solved(k, name, scene) | conditions()
            writer.writerow({key: f"{cell:.6g}" if isinstance(cell, float) else cell for key, cell in row.items()})
            file.flush()


def table_of(path: Path) -> pd.DataFrame:
    """The scenes solved so far."""
    return pd.read_csv(path, dtype={"message": str}).fillna({"message": ""})


def summary(table: pd.DataFrame) -> str:
    """Outcomes and CPU seconds by card, friction and place, and the causes of what ended otherwise."""
    def line(group: pd.DataFrame) -> pd.Series:
        good = group["outcome"].isin(["ok", "bottomed_out"])
        return pd.Series({"scenes": len(group), "ok": int((group["outcome"] == "ok").sum()),
                          "bottomed_out": int((group["outcome"] == "bottomed_out").sum()), "good": f"{good.mean():.2%}",
                          "cpu_median_s": group["cpu_s"].median(), "cpu_p95_s": group["cpu_s"].quantile(0.95),
                          "cpu_max_s": group["cpu_s"].max(), "peak_MB": group["peak_MB"].max()})

    groups = [table.groupby(key)[table.columns.tolist()].apply(line)
              for key in ("card", ["friction", "where"])]
    whole = line(table).to_frame("all").T
    left = table[~table["outcome"].isin(["ok", "bottomed_out"])]
    causes = left.groupby(["outcome", "message"]).size().to_string() if len(left) else "none"
    return "\n\n".join([*(group.to_string(float_format=lambda v: f"{v:.3g}") for group in [*groups, whole]),
                        "neither ok nor bottomed out: " + causes])


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--last", type=int, default=quick(SCENES, 24))
    options.add_argument("--where", choices=("all", "interior", "rim"), default="all")
    options.add_argument("--friction", choices=("all", *FRICTIONS), default="all")
    options.add_argument("--seconds", type=float, default=float("inf"))
    options.add_argument("--out", type=Path, default=RESULTS / "random_scenes.csv")
    given = options.parse_args()
    given.out.parent.mkdir(exist_ok=True, parents=True)
    solve_missing(given.out, given.last, given.where, given.friction, given.seconds)
    print(summary(table_of(given.out)))


if __name__ == "__main__":
    main()
