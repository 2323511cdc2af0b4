"""What a sweep will cost on this machine, before it starts: some of its rows are solved, and the cache is looked at."""

from dataclasses import dataclass
from statistics import fmean
from typing import Any

from eitsim.mechanics.curved.moved_touches import MovedShape
from eitsim.mechanics.load_paths.build_table import course_at
from eitsim.mechanics.load_paths.load_path import traced
from eitsim.mechanics.load_paths.rim_table import changed_diameters
from eitsim.mechanics.load_paths.types import DimensionlessProblem
from eitsim.scene.curved.curved_scene import is_curved
from eitsim.simulation.curved import moved_tables
from eitsim.simulation.reuse import is_stored
from eitsim.sweeps.design import nested_design
from eitsim.sweeps.design.card_draws import Cards, cards_for
from eitsim.sweeps.design.design import Design
from eitsim.sweeps.run.load_path_choice import method_for, shape_of_design
from eitsim.sweeps.run.moved_table_choice import moved_shape
from eitsim.sweeps.run.other_profiles import other_profiles
from eitsim.sweeps.run.rows import solve_rows
from matcal.card import MaterialCard
from touchcal.jit import cpu_s
from touchcal.number_words import counted
from touchcal.run_cost import peak_MB

SAMPLED, BUDGET_S = 12, 20.0  # most rows that are solved, and CPU time from which on no more are
# CPU time of a load path that is solved or checked, and of what the rim changes under one diameter, over that of the
# BEGUN depths of one path (benchmarks/results/sweeps_run.csv); of a row from a table over its readings.
PATH, RIM, SERVED, BEGUN = 16.0, 220.0, 1.2, (0.1, 0.2)
GOLDEN = (5**0.5 - 1) / 2
BYTES_TABLE, BYTES_AFRESH = 20.0, 28.0  # on disk, a reading of a row, in parts of many rows and of few


@dataclass(frozen=True)
class Forecast:
    """What a sweep will take; estimates, but for the counts."""

    rows: int
    other_rows: int  # the first touches again by other profiles
    readings: int  # of a row
    method: str  # why its touches are solved directly or taken from a table, in words
    tables: int  # load paths, on a cylinder touches, that are to be solved first, 0 where the cache has them
    table_cpu_s: float  # CPU time of what is solved first
    row_cpu_s: float  # mean CPU time of a row
    other_cpu_s: float  # of all rows by other profiles
    workers: int
    worker_MB: float  # memory of one
    disk_MB: float
    sampled: int  # rows that were solved for it
    curved: bool  # whether its table is of touches on a cylinder
    failure: str  # what one of them said that was not solved, empty where all were

    @property
    def wall_s(self) -> float:
        """Wall time, s, on idle processors."""
        return (self.table_cpu_s + self.rows * self.row_cpu_s + self.other_cpu_s) / self.workers


def forecast(design: Design, card: MaterialCard, workers: int, reuse: bool | None = None) -> Forecast:
    """The cost of `sweep` of a design with a card, so many workers and its `reuse`; ValueError as `sweep`, and where no
    row that is tried is solved."""
    cards = cards_for(design.material, design.seed, card, in_pairs=design.sampler == nested_design.SAMPLER)
    method, others = method_for(design, cards, reuse, False), other_profiles(design)
    rows = _some_rows(design, cards)
    failure = next((f"{row['outcome']}: {row['message']}" for row in rows if row["outcome"] != "ok"), "")
    if not (solved := [row for row in rows if row["outcome"] == "ok"]):
        raise ValueError(f"none of {len(rows)} rows that were tried is solved; the first is {failure}")
    direct, touch, readings = (fmean(row[name] for row in solved)
                               for name in ("cpu_s", "mechanics_cpu_s", "electrics_cpu_s"))
    paths, table_s, each = 0, 0.0, direct
    if method["reuse"]:
        each = SERVED * readings + max(direct - touch - readings, 0.0)
        shape = shape_of_design(design, cards)
        paths, table_s = _touches_to_solve(moved_shape(design, cards), touch) if shape is None else _to_solve(
            shape, method["rim"])
    count = sum(name.startswith("dv_") for name in rows[0])
    more = 0 if others is None else others.scenes
    disk = count * (design.scenes * (BYTES_TABLE if method["reuse"] else BYTES_AFRESH) + more * BYTES_AFRESH)
    fields = fmean(sum(values.nbytes for values in row.get("fields", {}).values()) for row in solved)
    return Forecast(design.scenes, more, count, method["reason"], paths, table_s, each, more * direct, workers,
                    peak_MB(), 1e-6 * (disk + fields * design.scenes), len(rows), is_curved(design.tables),
                    failure)


def _touches_to_solve(shape: MovedShape, touch_s: float) -> tuple[int, float]:
    """Touches of a cylinder's table that the cache lacks, and CPU seconds of them, each as long as a direct one."""
    count = 0 if moved_tables.is_stored(shape) else len(shape.load_nodes) * len(shape.diameter_nodes)
    return count, count * touch_s


def _to_solve(shape: DimensionlessProblem, rim: bool) -> tuple[int, float]:
    """Load paths that the cache lacks, and CPU seconds of what is solved before the rows."""
    paths = 0 if is_stored(shape, rim=False) else len(shape.solved)
    touches = (PATH * (paths + len(shape.held_out)) if paths else 0.0) + (
        RIM * len(changed_diameters(shape)) if rim and not is_stored(shape, rim=True) else 0.0)
    return paths, touches * _path_begun_cpu_s(shape) if touches else 0.0


def _path_begun_cpu_s(shape: DimensionlessProblem) -> float:
    started = cpu_s()
    list(traced(course_at(shape, shape.base), BEGUN))
    return cpu_s() - started


def _some_rows(design: Design, cards: Cards) -> list[dict[str, Any]]:
    """Rows spread over the design, solved after one that compiles and loads what is needed once."""
    solve_rows(design, cards, [0])
    rows: list[dict[str, Any]] = []
    started = cpu_s()
    for index in dict.fromkeys(int(i * GOLDEN % 1 * design.scenes) for i in range(SAMPLED)):
        if cpu_s() - started < BUDGET_S:
            rows += solve_rows(design, cards, [index])
    return rows


def lines(expected: Forecast) -> list[str]:
    """A forecast in words."""
    s = expected
    solved = counted(s.tables, "touch", "touches") if s.curved else counted(s.tables, "load path")
    tables = (f"{solved} first, some {_time(s.table_cpu_s)} of CPU"
              if s.tables else
              f"what the rim changes first, some {_time(s.table_cpu_s)} of CPU" if s.table_cpu_s else
              "nothing to be solved first")
    more = f", and {s.other_rows} by other profiles" if s.other_rows else ""
    result = [f"rows      {s.rows} of {s.readings} readings{more}", f"touches   {s.method}",
              f"tables    {tables}", f"a row     {s.row_cpu_s:.2g} CPU s",
              f"time      {_time(s.wall_s)} on {s.workers} idle processor{'s' * (s.workers != 1)}",
              f"memory    {s.worker_MB * s.workers / 1e3:.1f} GB, {s.worker_MB:.0f} MB a worker",
              f"disk      {s.disk_MB / 1e3:.3g} GB" if s.disk_MB >= 1e3 else f"disk      {s.disk_MB:.3g} MB",
              f"Estimates for this machine, by {s.sampled} of the rows; those near edges may cost more."]
    return result + ([f"caution: one of them was {s.failure}"] if s.failure else [])


def _time(seconds: float) -> str:
    """A time in the unit that suits it."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s" if seconds < 100 else f"{seconds:.0f} s"
