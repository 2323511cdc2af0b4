"""Touches in three dimensions against the fast routes, on random layers that both serve, at default accuracy.

Scene k is drawn from (SEED, k): one touch or two near ones, light to deep, far from edges, near a rim, a straight edge
or a corner, on foams and rubbers. It is solved by the cheapest other route and by `General`, electrodes soft. depth and
normal, principal and areal are relative differences of depth and of all touch signals (2-norm), skins driven by that
strain; general_* and fast_* what each states of itself; within is under how many strains the signals differ by no more
than both state; times is the CPU time of `General` over that of the other. gap is from the punch's edge to the skin's
in thicknesses. A run continues where results/general_errors.csv ends; --last N stops at scene N, --seconds S starts no
scene after S seconds. Scenes without an equilibrium hold the reason. Pin threads to one as `make bench` does.
"""

import argparse
import csv
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from conditions import CONDITIONS, RESULTS, conditions, quick
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.solid.volume_projection import projects
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Drive, Scene, Skin, scene_from
from eitsim.simulation.choose import choose_ways
from eitsim.simulation.routes.general import General
from eitsim.simulation.routes.route import Case, Route
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.volumetric import nearly_incompressible
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s

SEED, SCENES, SIGNAL = 48100, 100, 2e-3
LAWS: dict[str, Law] = {
    "Table 1": TABLE_1,
    "foam": Hyperfoam(np.array([3e4]), np.array([4.0]), np.array([0.2])),
    "stiff foam": Hyperfoam(np.array([8e4]), np.array([8.0]), np.array([0.0])),
    "soft rubber": NeoHooke(2.5e4, 0.4),
    "rubber": nearly_incompressible(NeoHooke(1e5, 0.5)),
}
PLACES = {"interior": 0.3, "rim": 0.2, "edge": 0.2, "corner": 0.1, "two": 0.2}
# Force over mu_0 d^2, least and largest; gaps from edges and between punches, thicknesses.
FORCES, GAPS, BETWEEN = (0.03, 1.0), (0.05, 3.0), (0.2, 2.0)
COLUMNS = ("scene", "law", "place", "profile", "route", "outcome", "thickness_mm", "d_mm", "F_N", "gap", "depth_over_h",
           "depth", *STRAINS, "within", "times", *(f"{way}_{what}" for way in ("fast", "general")
                                for what in ("depth", *STRAINS, "cpu_s")), *CONDITIONS)


def drawn(k: int) -> tuple[str, str, Scene]:
    """Names of law and place, and scene k."""
    rng = np.random.default_rng((SEED, k))
    law, place = str(rng.choice(list(LAWS))), str(rng.choice(list(PLACES), p=list(PLACES.values())))
    thickness, punches = rng.uniform(4, 16), []
    for _ in range(2 if place == "two" else 1):
        d = rng.uniform(6, 20)
        force = np.exp(rng.uniform(*np.log(FORCES))) * LAWS[law].mu_0_Pa * (d * 1e-3) ** 2
        punches.append({"diameter_mm": d, "force_N": float(force), "x_mm": 0.0, "y_mm": 0.0,
                        "profile": str(rng.choice(["flat", "sphere", "cone"]))})
    gaps = thickness * np.exp(rng.uniform(np.log(GAPS[0]), np.log(GAPS[1]), 2))
    away, along = (gaps + punches[0]["diameter_mm"] / 2).tolist()
    angle, body = rng.uniform(0, 2 * np.pi), {"thickness_mm": thickness}
    if place == "two":
        distance = thickness * np.exp(rng.uniform(*np.log(BETWEEN))) + sum(p["diameter_mm"] for p in punches) / 2
        for punch, side in zip(punches, (-0.5, 0.5), strict=True):
            punch |= {"x_mm": side * distance * np.cos(angle), "y_mm": side * distance * np.sin(angle)}
    elif place in ("edge", "corner"):
        body |= {"outline": "rectangle", "width_mm": 220.0, "height_mm": 160.0}
        punches[0] |= {"x_mm": 110 - away, "y_mm": 80 - along if place == "corner" else rng.uniform(-20, 20)}
    else:
        body |= {"radius_mm": rng.uniform(80, 120)}
        reach = body["radius_mm"] - away if place == "rim" else rng.uniform(0, 10)
        punches[0] |= {"x_mm": reach * np.cos(angle), "y_mm": reach * np.sin(angle)}
    return law, place, scene_from({"body": body, "punch": punches, "electrodes": {"soft": True}})


def fast_ways(scene: Scene, law: Law) -> list[tuple[Route, Case]]:
    """How the touches are solved, each with its numbers; empty where another route than `General` serves not all."""
    ways, together = choose_ways(scene, bodies=False, keeps_volume=projects(law))
    used = [way for i, way in enumerate(ways) if not any(i in other.case.touches for other in together)] + [*together]
    served = all(way.why is None and not isinstance(way.route, General) for way in used)
    return [(way.route, way.case) for way in used] if served else []


def solved(ways: Sequence[tuple[Route, Case]], law: Law) -> tuple[list[Touch], float]:
    """The touches in order, and what they cost, CPU s."""
    begun, found = cpu_s(), dict[int, Touch]()
    for route, case in ways:
        alone = len(case.touches) == 1
        touches = [route.solve(case, law, False)] if alone else route.solve_together(
            case, law, False, [None] * len(case.touches))
        found |= dict(zip(case.touches, touches, strict=True))
    return [found[i] for i in sorted(found)], cpu_s() - begun


def difference(scene: Scene, strain: str, touches: Sequence[Touch], exact: Sequence[Touch]) -> float:
    """Relative difference of all signals, a skin driven by a strain; NaN where its cubic is not positive."""
    def signal(some: Sequence[Touch]) -> np.ndarray:
        return solve(scene.body, Skin(strain=strain), scene.electrodes, Drive(), tuple(
            zip(scene.punches, some, strict=True)), SKIN_LAW, signal=SIGNAL).signal_V

    try:
        one, other = signal(touches), signal(exact)
    except ValueError:
        return np.nan
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def stated(touches: Sequence[Touch], cost_s: float, name: str) -> dict[str, float]:
    signal = np.max([touch.signal_errors for touch in touches], axis=0).tolist()
    return {f"{name}_depth": max(touch.depth_error for touch in touches), f"{name}_cpu_s": cost_s, **{
        f"{name}_{strain}": error for strain, error in zip(STRAINS, signal, strict=True)}}


def row(k: int) -> dict[str, Any]:
    """Of scene k; its route is "general" where no other serves, and nothing is solved."""
    name, place, scene = drawn(k)
    law, whole, thickness_m = LAWS[name], Case(scene, tuple(range(len(scene.punches))), bodies=False), (
        scene.body.thickness_m)
    ways = fast_ways(scene, law)
    out = {"scene": k, "law": name, "place": place, "route": " ".join(route.kind for route, _ in ways) or "general",
           "profile": " ".join(punch.profile for punch in scene.punches), "thickness_mm": thickness_m * 1e3,
           "gap": whole.gap_m / thickness_m, "outcome": "ok",
           **{key: " ".join(f"{unit * getattr(punch, field):.4g}" for punch in scene.punches)
              for key, field, unit in (("d_mm", "diameter_m", 1e3), ("F_N", "force_N", 1.0))}}
    if not ways:
        return out | {"outcome": "not served"}
    try:
        fast, fast_s = solved(ways, law)
        general, general_s = solved([(General(), replace(whole, keeps_volume=projects(law)))], law)
    except NotConverged as error:
        return out | {"outcome": str(error)}
    depths = [abs(one.depth_m / other.depth_m - 1) for one, other in zip(general, fast, strict=True)]
    differences = {strain: difference(scene, strain, general, fast) for strain in STRAINS}
    both = stated(fast, fast_s, "fast") | stated(general, general_s, "general")
    within = sum(differences[strain] <= both[f"fast_{strain}"] + both[f"general_{strain}"] for strain in STRAINS)
    return out | both | differences | {"depth_over_h": max(touch.depth_m for touch in fast) / thickness_m,
                                 "depth": max(depths), "within": within, "times": general_s / fast_s}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--last", type=int, default=quick(SCENES, 2))
    options.add_argument("--seconds", type=float, default=float("inf"))
    options.add_argument("--out", type=Path, default=RESULTS / "general_errors.csv")
    given = options.parse_args()
    given.out.parent.mkdir(exist_ok=True, parents=True)
    done = set(pd.read_csv(given.out)["scene"]) if given.out.exists() else set()
    begun, fresh = time.perf_counter(), not given.out.exists()
    with given.out.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if fresh:
            writer.writeheader()
        for k in sorted(set(range(given.last)) - done):
            if time.perf_counter() - begun > given.seconds:
                break
            found = row(k) | conditions()
            writer.writerow({key: f"{cell:.4g}" if isinstance(cell, float) else cell for key, cell in found.items()})
            file.flush()
    print(pd.read_csv(given.out).drop(columns=[*CONDITIONS]).to_string(index=False))


if __name__ == "__main__":
    main()
