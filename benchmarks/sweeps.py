"""What sweeps cost by kind of row, on one and two workers, and a million scenes on a thousand cores, simulated.

`python benchmarks/sweeps.py`: small sweeps of every kind with the account of each (CPU time by stage, signal errors,
bytes), what a worker takes to start and to hold the tables, and, from the rows' own times, schedules of a million
scenes (benchmarks/schedule.py); writes results/sweeps.csv, results/sweeps_stages.csv and results/sweeps_schedule.csv.
`--card` gives a fitted card, without which no cards are drawn from a posterior; `--kinds` some kinds alone.

`python benchmarks/sweeps.py run DIR CARD`: the paper's sweep, examples/paper.toml, into DIR and results/sweeps_run.csv.

`python benchmarks/sweeps.py check DIR CARD`: rows of a data set, 40 from the table far from the rim and 8 near it,
solved afresh, as planned and finely (`finely_solved`); writes results/sweeps_check.csv and, what a row costs and misses
either way, results/sweeps_ways.csv (sweeps_check_drawn.csv and sweeps_ways_drawn.csv where cards are drawn from a
posterior).
Errors are of the signal, relative in the 2-norm: row_error is what the row states beyond what both leave out alike,
fresh_error what solving left in the fine one, and times_smaller their ratio. Run by `make bench`, which pins threads.
"""

import argparse
import os
import pickle
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from conditions import quick, written
from finer import finely_solved
from materials import SKIN_LAW, TABLE_1
from schedule import schedule

from eitsim.scene.results import of_strain
from eitsim.simulation.reuse import table_for
from eitsim.simulation.simulate import simulate
from eitsim.sweeps.dataset.parquet import parts, read_dataset, read_manifest
from eitsim.sweeps.design.card_draws import Material, card_at, cards_for
from eitsim.sweeps.design.design import Design, card_number, design_from, read_design, scene_at
from eitsim.sweeps.run.account import Accounted, account_of
from eitsim.sweeps.run.load_path_choice import design_shape
from eitsim.sweeps.run.sweep import Progress, sweep
from matcal.card import MaterialCard, read_card, write_card
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from touchcal.errors import NotConverged
from touchcal.parallel.processes import processes

PUNCH = {"diameter_mm": {"choice": [10, 12, 14, 16, 18]}, "force_N": [0.1, 2.0]}
INTERIOR = {"x_mm": [-35.0, 35.0], "y_mm": [-35.0, 35.0]}
# kind -> design without its count, whether from a table (None: as the sweep chooses), rows, workers
KINDS: dict[str, tuple[Mapping[str, Any], bool | None, int, int]] = {
    "table, interior": ({"punch": PUNCH | INTERIOR}, True, 512, 1),
    "table, interior, two workers": ({"punch": PUNCH | INTERIOR}, True, 512, 2),
    "table, near the rim": ({"punch": PUNCH | {"x_mm": [70.0, 88.0], "y_mm": 0.0}}, True, 128, 1),
    "table, whole disc": ({"punch": PUNCH}, True, 512, 1),
    "beyond the tables": ({"punch": PUNCH | {"x_mm": [90.2, 90.8], "y_mm": 0.0, "diameter_mm": 18}}, True, 16, 1),
    "afresh, interior": ({"punch": PUNCH | INTERIOR}, False, 32, 1),
    "afresh, interior, two workers": ({"punch": PUNCH | INTERIOR}, False, 64, 2),
    "afresh, near the rim": ({"punch": PUNCH | {"x_mm": [70.0, 88.0], "y_mm": 0.0}}, False, 8, 1),
    "cards of a posterior": ({"punch": PUNCH | INTERIOR, "material": {"draws": 200}}, None, 32, 1),
    "holds of 60 s": ({"punch": PUNCH | INTERIOR, "hold": {"time_s": 60.0}}, None, 8, 1),
    "two touches": ({"punch": [PUNCH | {"x_mm": [-38.0, -15.0], "y_mm": [-30.0, 30.0]},
                               PUNCH | {"x_mm": [15.0, 38.0], "y_mm": [-30.0, 30.0]}]}, False, 16, 1)}
# kinds whose tables hold what the rim changes
RIM = {"table, near the rim", "table, whole disc"}
# of these rows a quick run takes one in so many, and of these kinds
FEWER, QUICK_KINDS = quick(1, 8), quick((*KINDS,), ("table, interior", "afresh, interior", "two touches"))
SCENES, CORES = quick(1_000_000, 10_000), (1, 2, 100, 1000)
CHECKED = {"table": 40, "table near the rim": 8}


def default_card() -> MaterialCard:
    foam = Hyperfoam(TABLE_1.mu_Pa, TABLE_1.alpha, TABLE_1.nu, "instantaneous")
    return MaterialCard("Table 1", foam, Prony(np.array([0.1, 0.1]), np.array([1.0, 30.0])), SKIN_LAW)


def measured(kind: str, card: Path, folder: Path) -> tuple[dict[str, Any], Accounted]:
    """Row of results/sweeps.csv of one kind, and its account."""
    raw, reuse, rows, workers = KINDS[kind]
    design = design_from({"seed": 11, "hold": {"moduli": "instantaneous"}} | dict(raw), max(rows // FEWER, 4))
    seen = []

    def note(step: Progress) -> None:
        if step.stage == "rows":
            seen.append(time.process_time())

    sweep(design, card, folder, reuse=reuse, workers=workers, progress=note)
    account, table = account_of(folder), read_dataset(folder).table
    run, errors = account.runs[-1], account.errors
    return {"what": kind, "rows": account.rows, "ok": account.outcomes.get("ok", 0),
            "rows_per_core_hour": account.rows_per_core_hour, "bytes_per_row": account.bytes_per_row,
            **{f"cpu_s_{name}": float(np.nanquantile(table["cpu_s"], share))
               for name, share in (("median", 0.5), ("p95", 0.95), ("largest", 1.0))},
            "signal_error_median": errors and errors.median, "signal_error_p95": errors and errors.p95,
            "workers": workers, "wall_s": run.rows_wall_s, "busy": run.efficiency, "table_wall_s": run.table_wall_s,
            "rows_per_part": read_manifest(folder)["rows_per_part"],
            "parent_ms_per_part": 1e3 * (seen[-1] - seen[1]) / max(len(seen) - 2, 1) if workers > 1 else None,
            "writing_ms_per_part": 1e3 * run.writing_wall_s / len(parts(folder))}, account


def stages(kind: str, account: Accounted) -> list[dict[str, Any]]:
    """CPU time by stage; a million scenes take as many tables as these, and of all else in proportion."""
    return [{"what": kind, "share": stage.cpu_s / account.cpu_s, "core_hours_per_million": stage.cpu_s / 3600 * (
        1 if stage.name.startswith("table:") else SCENES / account.rows)} | asdict(stage) for stage in account.stages]


def started(_: int) -> tuple[float, float]:
    """CPU time, s, and memory, MB, of a worker that has loaded what it solves with."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return time.process_time(), pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def workers_row() -> dict[str, Any]:
    """What a worker takes until its first answer."""
    begun = time.perf_counter()
    with processes(2) as pool:
        cpu_s, memory_MB = pool.broadcast(started)(0).result()
    return {"what": "start of a worker", "wall_s": time.perf_counter() - begun, "cpu_s_median": cpu_s,
            "memory_MB": memory_MB}


def table_row(card: Path, rim: bool) -> dict[str, Any]:
    """What a worker takes to hold the tables that rows were solved from, from the cache; with the rim's, or without."""
    design = design_from({"punch": PUNCH}, 1)
    begun = time.process_time()
    table, _ = table_for(design_shape(design, read_card(card)), rim=rim)
    spent = time.process_time() - begun
    return {"what": "tables, read from the cache", "cpu_s_median": spent,
            "memory_MB": len(pickle.dumps(table)) / 1e6}


def schedules(cpu_s: np.ndarray, run: Mapping[str, float]) -> list[dict[str, Any]]:
    """A million scenes whose rows cost as these, on more and more cores, and with rows that cost ten times as much."""
    rng, out = np.random.default_rng(3), []
    size = int(run["rows_per_part"])
    parent_s = max(run["parent_ms_per_part"], run["writing_ms_per_part"]) / 1e3
    for factor in (1, 10):
        drawn = factor * rng.choice(cpu_s, (-(-SCENES // size), size)).sum(axis=1)
        for cores in CORES:
            found = schedule(drawn, cores, parent_s, run["start_s"])
            out.append({"scenes": SCENES, "cores": cores, "row_cpu_s": float(factor * cpu_s.mean()),
                        "parent_ms_per_part": 1e3 * parent_s, "parent_rows_per_s": size / parent_s,
                        "data_GB": SCENES * run["bytes_per_row"] / 1e9} | asdict(found))
    return out


def measure(given: argparse.Namespace) -> None:
    """All kinds, and schedules after those that two workers solved; from a table, of rows anywhere on the disc."""
    rows, told, planned, costs = [], [], [], {}
    with tempfile.TemporaryDirectory() as place:
        card = given.card or Path(place) / "card.json"
        if given.card is None:
            write_card(default_card(), card)
        for i, kind in enumerate(given.kinds):
            if "posterior" in kind and given.card is None:
                print(f"{kind}: left out, since it needs --card with a fitted card")
                continue
            row, account = measured(kind, card, Path(place) / str(i))
            costs[kind] = read_dataset(Path(place) / str(i)).table["cpu_s"].dropna().to_numpy()
            rows.append(row)
            told += stages(kind, account)
            print(pd.Series(row).to_string(), flush=True)
        rows.append(workers_row())
        if any(KINDS[kind][1] for kind in costs):
            rows.append(table_row(card, rim=not RIM.isdisjoint(costs)))
    written(rows, "sweeps")
    written(told, "sweeps_stages")
    for two in (row for row in rows if row.get("workers") == 2):
        drawn = "table, whole disc" if two["what"].startswith("table") and "table, whole disc" in costs else two["what"]
        run = {"start_s": next(row["wall_s"] for row in rows if row["what"] == "start of a worker"),
               **{key: two[key] for key in (
                   "parent_ms_per_part", "writing_ms_per_part", "bytes_per_row", "rows_per_part")}}
        planned += [{"rows_as": drawn} | row for row in schedules(costs[drawn], run)]
    if planned:
        written(planned, "sweeps_schedule")


def run_paper(given: argparse.Namespace) -> None:
    """The paper's sweep: its account as rows of a table."""
    design = read_design(Path(__file__).parent.parent / "examples" / "paper.toml", given.scenes)
    sweep(design, given.card, given.folder, workers=given.workers)
    account = account_of(given.folder)
    assert account.errors is not None
    whole = {"scenes": account.rows, "ok": account.outcomes.get("ok", 0), "bytes_per_row": account.bytes_per_row,
             "rows_per_core_hour": account.rows_per_core_hour, "signal_error_median": account.errors.median,
             "signal_error_p95": account.errors.p95, "share_above_wanted": account.errors.share_above}
    runs = [{"what": "run", "wall_s": run.table_wall_s + run.rows_wall_s, "table_wall_s": run.table_wall_s,
             "rows_wall_s": run.rows_wall_s, "count": run.rows, "workers": run.workers, "busy": run.efficiency} | whole
            for run in account.runs]
    written([*runs, *({"what": stage.name, "count": stage.count, "cpu_s": stage.cpu_s} for stage in account.stages)],
            "sweeps_run")


def check(given: argparse.Namespace) -> None:
    """Rows of a data set against scenes solved afresh."""
    held = read_manifest(given.folder)["design"]
    material = None if held["material"] is None else Material(**held["material"])
    design = Design(**{**held, "material": material, "fields": None})
    card = read_card(given.card)
    cards = cards_for(design.material, design.seed, card)
    ok, rng, found = read_dataset(given.folder).ok, np.random.default_rng(5), []
    for method, count in CHECKED.items():
        chosen = ok.loc[ok["mechanics_method"] == method]
        for at in sorted(rng.permutation(len(chosen))[:count]):
            row = {str(name): value for name, value in chosen.iloc[at].items()}
            found.append(against_fresh(row, design, card_at(cards, card_number(design, int(row["scene"])))))
            print(pd.Series(found[-1]).to_string(), flush=True)
            written(found, f"sweeps_check{'' if material is None else '_drawn'}")
    written(ways(pd.DataFrame(found), account_of(given.folder)), f"sweeps_ways{'' if material is None else '_drawn'}")


def ways(checked: pd.DataFrame, account: Accounted) -> Iterator[dict[str, Any]]:
    """What a row costs and misses of its finer solution, from the tables of the set and solved afresh."""
    once = sum(stage.cpu_s for stage in account.stages if stage.name.startswith("table:"))
    for method, rows in checked.groupby("method", sort=False):
        for way, error, cost, first in (("from the tables", "signal_deviation", "row_cpu_s", once / account.rows),
                                        ("solved afresh", "plain_deviation", "plain_cpu_s", 0.0)):
            yield {"place": "near the rim" if str(method).endswith("rim") else "far from the rim", "way": way,
                   "rows": len(rows), "dv_error": rows[error].median(), "dv_error_p95": rows[error].quantile(0.95),
                   "cpu_s": rows[cost].median(), "tables_cpu_s_per_row": first, "table_rows": account.rows}


def against_fresh(row: Mapping[str, Any], design: Design, card: MaterialCard) -> dict[str, Any]:
    """One row and its scene solved afresh, as the plan does and finely."""
    scene = scene_at(design, int(row["scene"]))
    plain, begun = simulate(scene, card), time.process_time()
    told: dict[str, Any] = {"scene": int(row["scene"]), "method": row["mechanics_method"], "x_mm": row["x_mm"],
                            "y_mm": row["y_mm"], "d_mm": row["d_mm"], "F_N": row["F_N"], "row_cpu_s": row["cpu_s"],
                            "plain_cpu_s": plain.cost["cpu_s"], "outcome": "not_converged"}
    try:
        touch, readings = finely_solved(scene, card)
    except NotConverged:
        return told
    told |= {"cpu_s": time.process_time() - begun}
    if plain.readings is None:
        return told
    signal = readings.signal_V.ravel()
    fresh_error = of_strain(touch.signal_errors, scene.skin.strain) + readings.signal_error
    own = np.array([value for name, value in row.items() if name.startswith("dv_")], dtype=float)
    row_error = row["signal_error"] - plain.plan.error_bound
    missed = [np.linalg.norm(found - signal) / np.linalg.norm(signal)
              for found in (own, plain.readings.signal_V.ravel())]
    return told | {"outcome": "ok", "signal_deviation": missed[0], "plain_deviation": missed[1],
                   "depth_deviation": abs(row["delta_max_mm"] / touch.depth_m / 1e3 - 1), "row_error": row_error,
                   "row_stated": row["signal_error"], "fresh_error": fresh_error,
                   "times_smaller": row_error / fresh_error}


def main() -> None:
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--card", type=Path)
    options.add_argument("--kinds", nargs="+", choices=[*KINDS], default=QUICK_KINDS, metavar="KIND")
    commands = options.add_subparsers()
    for name, does in (("run", run_paper), ("check", check)):
        command = commands.add_parser(name)
        command.add_argument("folder", type=Path)
        command.add_argument("card", type=Path)
        command.set_defaults(does=does)
    commands.choices["run"].add_argument("--workers", type=int, default=2)
    commands.choices["run"].add_argument("--scenes", type=int)
    options.set_defaults(does=measure)
    given = options.parse_args()
    given.does(given)


if __name__ == "__main__":
    main()
