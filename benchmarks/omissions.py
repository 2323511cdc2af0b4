"""What each omission of the plan changes when it alone is taken back, against the bound that is stated for it.

For each omission, SCENES random touches of Table 1 (8 to 20 mm, forces log-uniform from 0.01 N to 0.4 mu_0 pi d^2,
places and what else the omission needs at random): relative change of depth, of the surface's normal strain (L2 over
the disc) and of the 208 signals dV (2-norm) of a skin that this strain drives, the stated bound of each, and CPU
seconds with and without. The rim is left out at the gaps where a wanted signal of 1 to 30 % allows it. So is a
neighbour, of pairs about the middle of the disc against the same solved together: depth and strain of the worse touch,
dV of both, d_mm and F_N of the first, and gap_mm between the edges, bounds as a result tells them; pairs that are not
found together are named and left out. Run by `make bench`, which pins threads; --scenes and --only shorten it, --only
keeps the other omissions' rows of before; writes results/omissions.csv (a row a touch) and
results/omissions_summary.csv next to this file.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from conditions import CONDITIONS, earlier, quick, written
from materials import SKIN_LAW, TABLE_1

from eitsim.electrics.forward.solve_forward import solve
from eitsim.mechanics.axisymmetric.hold import HoldHistory, kept, states_over
from eitsim.mechanics.axisymmetric.solve_axisymmetric import (
    force_unit,
    mesh_hierarchy,
    solve_touch,
    touch_of,
    under_force,
)
from eitsim.mechanics.load_paths.table import shape_of, touch_from
from eitsim.mechanics.load_paths.types import Table
from eitsim.mechanics.rim.correction import no_correction
from eitsim.mechanics.rim.interaction import edge_gap_m, expected, gap_for, interaction
from eitsim.mechanics.rim.two_punches import LEAST_GAP
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import RimField, Touch, of_strain
from eitsim.scene.scene import Body, Drive, Electrodes, Hold, Punch, Scene, Skin
from eitsim.sheet.sheet_conductance import changes
from eitsim.simulation.assumptions import stored_choice
from eitsim.simulation.edge_effects import rim_effect
from eitsim.simulation.near_edges import solve_near_rim, solved_together
from eitsim.simulation.reuse import table_for
from matcal.laws.prony import Prony
from touchcal.errors import NotConverged

SERIES = Prony(np.array([0.15, 0.1, 0.1]), np.array([0.29, 5.0, 60.0]))
# the skin's strain decides the bounds of the rim, of meshes and of tables, and dV
BODY, SKIN, SCENES, SEED = Body(), Skin(strain="normal"), quick(100, 2), 11
LEAST_N, MOST = 0.01, 0.4
# What a hold at a depth leaves out is stepped through, from the touch to this time in as many steps per decade: four
# instead of one changed the force by 1e-7, the change of strain by 1 % of it.
TIME_S, PER_DECADE = 60.0, 1


@dataclass(frozen=True)
class Pair:
    """A touch with an omission and without it."""

    punch: Punch
    # with the omission, and without
    left_out: Touch
    full: Touch
    # CPU time of each, s
    cpu_s: tuple[float, float]
    # stated relative errors of depth, of the normal strain (L2) and of dV that the omission may cost
    depth_bound: float
    strain_bound: float
    signal_bound: float
    # how the skin of the touch with the omission and without is solved
    methods: tuple[str, str] = ("auto", "auto")


def timed(solved: Callable[[], Touch]) -> tuple[Touch, float]:
    begun = time.process_time()
    touch = solved()
    return touch, time.process_time() - begun


def random_punch(rng: np.random.Generator, gap_m: float | None = None) -> Punch:
    """A punch at a random place, 10 mm from the rim or more, or at a distance from its edge to the rim."""
    diameter = rng.uniform(0.008, 0.02)
    force = np.exp(rng.uniform(np.log(LEAST_N), np.log(MOST * TABLE_1.mu_0_Pa * np.pi * diameter**2)))
    room = BODY.radius_m - diameter / 2
    away = (room - 0.01) * np.sqrt(rng.uniform()) if gap_m is None else room - gap_m
    angle = rng.uniform(0, 2 * np.pi)
    return Punch(x_m=away * np.cos(angle), y_m=away * np.sin(angle), diameter_m=diameter, force_N=float(force))


def strain_error(touch: Touch) -> float:
    assert touch.strain_errors is not None
    return of_strain(touch.strain_errors, SKIN.strain)


def rim_left_out(rng: np.random.Generator) -> Pair:
    allowed, gaps = np.exp(rng.uniform(np.log(0.005), np.log(0.15))), np.arange(0.0, 0.06, 1e-4)
    least = gaps[np.argmax([rim_effect(gap, BODY.thickness_m, SKIN.strain) <= allowed for gap in gaps])]
    punch = random_punch(rng, least * rng.uniform(1.0, 1.3))
    left_out, first = timed(lambda: solve_touch(TABLE_1, BODY, punch))
    full, second = timed(lambda: solve_near_rim(TABLE_1, BODY, punch))
    gap = BODY.radius_m - float(np.hypot(punch.x_m, punch.y_m)) - punch.diameter_m / 2
    bound = rim_effect(gap, BODY.thickness_m, SKIN.strain)
    assert full.rim is not None
    left_out = replace(left_out, rim=no_correction(full.rim))
    return Pair(punch, left_out, full, (first, second), bound, bound, bound, ("mesh", "mesh"))


def finer_mesh_left_out(rng: np.random.Generator) -> Pair:
    punch = random_punch(rng)
    left_out, first = timed(lambda: solve_touch(TABLE_1, BODY, punch))
    full, second = timed(lambda: solve_touch(TABLE_1, BODY, punch, element_m=default_element_m(BODY, punch) / 2))
    return Pair(punch, left_out, full, (first, second), left_out.depth_error, strain_error(left_out),
                of_strain(left_out.signal_errors, SKIN.strain))


def rings_for_a_mesh(rng: np.random.Generator) -> Pair:
    punch = random_punch(rng)
    touch, seconds = timed(lambda: solve_touch(TABLE_1, BODY, punch))
    return Pair(punch, touch, touch, (seconds, seconds), 0.0, 0.0, np.nan, ("multipole", "mesh"))


def steps_in_time_left_out(rng: np.random.Generator) -> Pair:
    punch, law, hold = random_punch(rng), replace(TABLE_1, moduli="instantaneous"), Hold((TIME_S,), "depth")
    assert punch.force_N is not None
    levels = mesh_hierarchy(law, BODY, punch, None, None)[-2:]
    loaded = under_force(levels, punch.force_N / force_unit(law, BODY))

    def stepped_through() -> Touch:
        states = [states_over(model, HoldHistory(SERIES, None, state.depth, hold), PER_DECADE, state)[-1]
                  for model, state in zip(levels, loaded, strict=True)]
        return touch_of(law, BODY, levels, states, time.process_time())

    left_out, first = timed(lambda: kept(SERIES, hold, solve_touch(law, BODY, punch))[-1][1])
    full, second = timed(stepped_through)
    return Pair(punch, left_out, full, (first, first + second), left_out.depth_error, strain_error(left_out),
                of_strain(left_out.signal_errors, SKIN.strain))


def fresh_solution_left_out(table: Table) -> Callable[[np.random.Generator], Pair | None]:
    def pair(rng: np.random.Generator) -> Pair | None:
        punch = random_punch(rng)
        begun = time.process_time()
        left_out = touch_from(table, TABLE_1, BODY, punch)
        first = time.process_time() - begun
        if left_out is None:
            return None
        full, second = timed(lambda: solve_touch(TABLE_1, BODY, punch))
        made = stored_choice(table, left_out, Scene(body=BODY, skin=SKIN))
        assert made.cost is not None
        return Pair(punch, left_out, full, (first, second), made.cost, made.values["strain_bound"], made.cost)
    return pair


def normal_strain(touch: Touch, points: np.ndarray) -> np.ndarray:
    strain = np.interp(np.hypot(*points.T), touch.radius_m, touch.stretch_normal)
    if isinstance(touch.rim, RimField):
        strain = strain * changes(touch.rim, points)[1]
    return strain - 1


def strain_change(pair: Pair) -> float:
    """Relative change of the normal strain, L2 over the half disc that the rim's symmetry leaves."""
    field, edge = pair.full.rim, pair.punch.diameter_m / 2
    edges = np.union1d(np.linspace(0, 0.05, 401), np.linspace(0.9, 1.1, 101) * edge)
    radius, angle = np.meshgrid((edges[1:] + edges[:-1]) / 2, (np.arange(24) + 0.5) / 24 * np.pi, indexing="ij")
    weight = (radius * np.diff(edges)[:, None]).ravel()
    points = np.column_stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()])
    if isinstance(field, RimField):
        inside = np.hypot(points[:, 0] + field.offset_m, points[:, 1]) < field.disc_m
        points, weight = points[inside], weight[inside]
    one, other = normal_strain(pair.left_out, points), normal_strain(pair.full, points)
    return float(np.sqrt(np.sum(weight * (one - other) ** 2) / np.sum(weight * other**2)))


def row(name: str, number: int, pair: Pair) -> dict[str, object]:
    first, second = (solve(BODY, SKIN, Electrodes(), Drive(), ((pair.punch, touch),), SKIN_LAW, signal=0.0005,
                           method=method)
                     for touch, method in zip((pair.left_out, pair.full), pair.methods, strict=True))
    missed = np.linalg.norm(first.signal_V - second.signal_V) / np.linalg.norm(second.signal_V)
    electrics = first.signal_error + second.signal_error if pair.methods == ("multipole", "mesh") else 0.0
    bound = electrics if np.isnan(pair.signal_bound) else pair.signal_bound
    away = float(np.hypot(pair.punch.x_m, pair.punch.y_m))
    cpu = pair.cpu_s if pair.methods[0] == pair.methods[1] else (first.cpu_s, second.cpu_s)
    return {"omission": name, "scene": number, "d_mm": pair.punch.diameter_m * 1e3, "F_N": pair.full.force_N,
            "gap_mm": (BODY.radius_m - away - pair.punch.diameter_m / 2) * 1e3,
            "depth_change": abs(pair.left_out.depth_m / pair.full.depth_m - 1), "depth_bound": pair.depth_bound,
            "strain_change_L2": strain_change(pair), "strain_bound": pair.strain_bound,
            "signal_change": float(missed), "signal_bound": bound,
            "cpu_s": cpu[0], "cpu_s_without": cpu[1]}


def random_pair(rng: np.random.Generator) -> tuple[Punch, Punch]:
    """Two punches on either side of the disc's middle, as far apart as a random wanted error asks for."""
    allowed = float(np.exp(rng.uniform(np.log(0.005), np.log(0.15))))
    gap = max(gap_for(allowed, BODY.thickness_m), LEAST_GAP * BODY.thickness_m) * rng.uniform(1.0, 1.3)
    one, other, angle = random_punch(rng), random_punch(rng), rng.uniform(0, 2 * np.pi)
    half = (gap + (one.diameter_m + other.diameter_m) / 2) / 2 * np.array([np.cos(angle), np.sin(angle)])
    return replace(one, x_m=half[0], y_m=half[1]), replace(other, x_m=-half[0], y_m=-half[1])


def neighbour_left_out(number: int, rng: np.random.Generator) -> dict[str, object] | None:
    """A row of two touches, each solved as if it were alone; None where they are not found together."""
    punches = random_pair(rng)
    begun = time.process_time()
    alone = tuple(solve_touch(TABLE_1, BODY, punch) for punch in punches)
    first = time.process_time() - begun
    try:
        both = solved_together(alone, TABLE_1, BODY, punches)
    except NotConverged as error:
        print(f"{APART}, {number}: {error}")
        return None
    second, planned = time.process_time() - begun, expected(BODY, punches)
    solved = interaction(tuple(zip(punches, alone, strict=True)))
    depth, strain, signal = (max(planned, solved[key]) for key in ("depth", "strain", "signal"))
    both_ways = [Pair(punch, left_out, full, (first, second), depth, strain, signal)
                 for punch, left_out, full in zip(punches, alone, both, strict=True)]
    signals = [solve(BODY, SKIN, Electrodes(), Drive(), tuple(zip(punches, touches, strict=True)), SKIN_LAW,
                     signal=0.0005, method="mesh").signal_V for touches in (alone, both)]
    return {"omission": APART, "scene": number, "d_mm": punches[0].diameter_m * 1e3,
            "F_N": punches[0].force_N, "gap_mm": edge_gap_m(*punches) * 1e3,
            "depth_change": max(abs(pair.left_out.depth_m / pair.full.depth_m - 1) for pair in both_ways),
            "depth_bound": depth, "strain_change_L2": max(strain_change(pair) for pair in both_ways),
            "strain_bound": strain,
            "signal_change": float(np.linalg.norm(signals[0] - signals[1]) / np.linalg.norm(signals[1])),
            "signal_bound": signal, "cpu_s": first, "cpu_s_without": second}


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """For each omission the share of touches within the bounds, changes, and what it saves."""
    out = []
    for name, part in rows.groupby("omission", sort=False):
        rounding = 1e-9
        out.append({
            "omission": name, "scenes": len(part),
            "depth_within": np.mean(part["depth_change"] <= part["depth_bound"] + rounding),
            "strain_within": np.mean(part["strain_change_L2"] <= part["strain_bound"] + rounding),
            "signal_within": np.mean(part["signal_change"] <= part["signal_bound"] + rounding),
            **{f"{key}_{label}": part[key].quantile(share) for key in ("depth_change", "strain_change_L2",
                                                                       "signal_change")
               for label, share in (("median", 0.5), ("95", 0.95))},
            "cpu_s_median": part["cpu_s"].median(), "cpu_s_without_median": part["cpu_s_without"].median(),
            **{key: ", ".join(sorted({str(told) for told in part[key]})) for key in CONDITIONS}})
    return pd.DataFrame(out)


def pairs(name: str, table: Table | None) -> Callable[[np.random.Generator], Pair | None]:
    if name == "load path reused":
        assert table is not None
        return fresh_solution_left_out(table)
    return {"axisymmetric: the rim left out": rim_left_out, "default mesh: the finer one left out": finer_mesh_left_out,
            "rings: the skin's mesh left out": rings_for_a_mesh,
            "depth hold: steps in time left out": steps_in_time_left_out}[name]


APART = "touches, each solved as if it were alone"
OMISSIONS = ("axisymmetric: the rim left out", "default mesh: the finer one left out",
             "rings: the skin's mesh left out", "depth hold: steps in time left out", "load path reused", APART)


def rows_of(name: str, scenes: int) -> Iterator[dict[str, object]]:
    table = None
    if name == APART:
        for number in range(scenes):
            found = neighbour_left_out(number, np.random.default_rng([SEED, OMISSIONS.index(name), number]))
            if found is not None:
                yield found
        return
    if name == "load path reused":
        table, _ = table_for(shape_of(TABLE_1, BODY, Punch(), [0.008, 0.02], spans=True))
    chosen = pairs(name, table)
    for number in range(scenes):
        pair = chosen(np.random.default_rng([SEED, OMISSIONS.index(name), number]))
        if pair is not None:
            yield row(name, number, pair)


def with_rows_of_before(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows and those of an earlier table for other omissions, in the order of OMISSIONS."""
    before = earlier("omissions")
    if len(before):
        others = ~before["omission"].isin(list(rows["omission"].unique()))
        rows = pd.concat([before.loc[others], rows])
    return rows.sort_values("omission", key=lambda names: names.map(OMISSIONS.index), kind="stable")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--scenes", type=int, default=SCENES)
    options.add_argument("--only", choices=OMISSIONS, action="append")
    given = options.parse_args()
    rows = pd.DataFrame([r for name in given.only or OMISSIONS for r in rows_of(name, given.scenes)])
    if given.only:
        rows = with_rows_of_before(rows)
    table = written(summary(written(rows, "omissions")), "omissions_summary", 3)
    print(table.T.to_string())


if __name__ == "__main__":
    main()
