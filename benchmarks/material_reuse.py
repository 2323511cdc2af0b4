"""Load paths for laws drawn from a posterior against touches solved afresh: what they cost, how far off they are.

The paper's sweep (examples/paper.toml, places on the whole disc) with 200 cards drawn from the posterior of a card: the
load paths of the central law with what the rim changes, what a few other laws change of them, and the checks at laws
that are held out, on two processes, each with its CPU seconds and its stated errors. Then the first rows of the design
far from the rim and near it, from the tables and afresh: errors are relative to the touch solved afresh, of depth,
largest pressure, contact area, and the 208 signals dV (2-norm); stored_ms is the time to assemble the law's table and
serve the mechanics; zeroth_error is that of dV with the central law's paths unchanged. Run by `make bench`, or with the
path of a card that has a posterior; without one the demo's card is taken. Writes results/material_reuse.csv beside this
file.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from eitsim.axisymmetric import solve_touch
from eitsim.design import Design, card_number, read_design, scene_at
from eitsim.electrics import solve
from eitsim.family import Family, table_of
from eitsim.family_reuse import family_for, family_repays, span_for
from eitsim.law_span import Span
from eitsim.materials import Material, card_at, cards_for
from eitsim.near_rim import rim_problem, solve_near_rim
from eitsim.plan import law_of, near_rim
from eitsim.results import Touch
from eitsim.reuse import rim_repays, table_for
from eitsim.rim_table import RimTable, near_rim_from
from eitsim.scene import Scene
from eitsim.table import Shape, Table, touch_from
from eitsim.tabulate import Run
from matcal.card import MaterialCard, read_card, require

HERE = Path(__file__).parent
CARD, RESULTS = HERE.parent / "reports" / "out" / "card.json", HERE / "results"
DRAWS, FAR, NEAR, WORKERS = 200, 40, 8, 2


def part(what: str, told: Table | RimTable, cpu_s: float, wall_s: float) -> dict[str, object]:
    """What a part of the tables took, and its stated errors."""
    return {"what": what, "cpu_s": cpu_s, "wall_s": wall_s, "depth_error": told.error.depth,
            "signal_error": told.error.signal, "strain_error_L2": told.error.strain}


def paths(shape: Shape, span: Span, run: Run) -> tuple[Family, list[dict[str, object]]]:
    """The load paths, and what they took."""
    begun = time.perf_counter()
    table, _ = table_for(shape, run)
    middle = time.perf_counter()
    family, _ = family_for(shape, span, run)
    others = f"of {len(span.chosen)} other laws, and checks at {len(span.held_out)} more"
    return family, [part(f"paths of the central law, {len(shape.solved)} diameters x {len(table.depths)} depths", table,
                         table.cpu_s, middle - begun),
                    part(others, family.table, family.table.cpu_s - table.cpu_s, time.perf_counter() - middle)]


def with_changes(shape: Shape, span: Span, run: Run) -> tuple[Family, list[dict[str, object]]]:
    """The load paths with what the rim changes, and what that took."""
    begun = time.perf_counter()
    central = table_for(shape, run, rim=True)[0].rim
    middle = time.perf_counter()
    family, _ = family_for(shape, span, run, rim=True)
    rim = family.table.rim
    assert central is not None
    assert rim is not None
    return family, [part("what the rim changes, central law", central, central.cpu_s, middle - begun),
                    part("the same at the farthest held-out law", rim, rim.cpu_s - central.cpu_s,
                         time.perf_counter() - middle)]


def stored(table: Table | None, scene: Scene, card: MaterialCard, near: bool) -> Touch | None:
    """The touch of a scene from a table."""
    if table is None:
        return None
    (punch,), law = scene.punches, law_of(scene, card)
    touch = touch_from(table, law, scene.body, punch, scene.skin.strain)
    return touch if touch is None or not near else near_rim_from(table, touch, scene.body, punch)


def dv(scene: Scene, card: MaterialCard, touch: Touch) -> np.ndarray:
    """The 208 signals of a touch."""
    return solve(scene.body, scene.skin, scene.electrodes, scene.drive, ((scene.punches[0], touch),),
                 require(card, "conductivity", "the skin"), signal=1e-3).signal_V


def row(family: Family, scene: Scene, card: MaterialCard, near: bool) -> dict[str, object]:
    """One touch from the tables of its law and afresh."""
    punch, law = scene.punches[0], law_of(scene, card)
    begun = time.process_time()
    touch = stored(table_of(family, law), scene, card, near)
    spent = time.process_time() - begun
    fresh = (solve_near_rim if near else solve_touch)(law, scene.body, punch)
    gap = scene.body.radius_m - float(np.hypot(punch.x_m, punch.y_m)) - punch.diameter_m / 2
    out: dict[str, object] = {"what": "touch near the rim" if near else "touch", "gap_mm": gap * 1e3,
                              "d_mm": punch.diameter_m * 1e3, "F_N": punch.force_N, "depth_mm": fresh.depth_m * 1e3,
                              "cpu_s": fresh.cpu_s, "stored_ms": spent * 1e3}
    if touch is None:
        return out | {"what": f"{out['what']}, beyond the tables"}
    central = law_of(scene, replace(card, hyperfoam=family.span.central))
    scaled = replace(central, mu_Pa=law.mu_0_Pa / central.mu_0_Pa * central.mu_Pa)
    zeroth = stored(table_of(family, scaled), scene, replace(card, hyperfoam=scaled), near)
    signal = dv(scene, card, fresh)
    return out | {"depth_error": abs(touch.depth_m / fresh.depth_m - 1),
                  "signal_error": float(np.linalg.norm(dv(scene, card, touch) - signal) / np.linalg.norm(signal)),
                  "sigma_max_error": abs(touch.sigma_max_Pa / fresh.sigma_max_Pa - 1),
                  "area_error": abs(touch.contact_area_m2 / fresh.contact_area_m2 - 1),
                  "zeroth_error": np.nan if zeroth is None else float(
                      np.linalg.norm(dv(scene, card, zeroth) - signal) / np.linalg.norm(signal))}


def places(design: Design) -> dict[bool, list[int]]:
    """Rows of the design far from the rim and near it."""
    found: dict[bool, list[int]] = {False: [], True: []}
    for index in range(design.scenes):
        scene = scene_at(design, index)
        (punch,) = scene.punches
        if not rim_problem(scene.body, punch):
            found[near_rim(scene, punch)].append(index)
    return found


def main() -> None:
    RESULTS.mkdir(exist_ok=True)
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else CARD
    design = replace(read_design(HERE.parent / "examples" / "paper.toml"), material=Material(draws=DRAWS))
    cards = cards_for(design.material, design.seed, read_card(path), path)
    (shape, span), chosen = span_for(design, cards), places(design)
    print(f"{len(chosen[True])} of {design.scenes} rows near the rim; tables repay: "
          f"{family_repays(design, shape, span)}, near the rim {rim_repays(design, shape)}")
    found: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(
            WORKERS, mp_context=multiprocessing.get_context("spawn")) as pool:
        os.environ.setdefault("TOUCHCAL_CACHE", folder)
        for near, count, make in ((False, FAR, paths), (True, NEAR, with_changes)):
            family, told = make(shape, span, pool.map)
            found += told
            for index in chosen[near][:count]:
                card = card_at(cards, card_number(design, index))
                found.append(row(family, scene_at(design, index), card, near))
                pd.DataFrame(found).to_csv(RESULTS / "material_reuse.csv", index=False, float_format="%.4g")
    table = pd.DataFrame(found)
    print(table.to_string(index=False))
    for what, touches in table.dropna(subset=["stored_ms"]).groupby("what"):
        for name in ("depth_error", "signal_error", "sigma_max_error", "area_error", "zeroth_error", "cpu_s"):
            print(what, name, *np.nanquantile(touches[name], [0.5, 0.95, 1.0]))


if __name__ == "__main__":
    main()
