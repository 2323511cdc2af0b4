"""What a sweep will cost on this machine, before it starts: some of its rows are solved, and the cache is looked at."""

import resource
import sys
from dataclasses import dataclass
from statistics import fmean

from eitsim.mechanics.load_paths.rim_table import changed_diameters
from eitsim.simulation.reuse import is_stored
from eitsim.sweeps.design.card_draws import cards_for
from eitsim.sweeps.design.design import Design
from eitsim.sweeps.run.load_path_choice import method_for, shape_of_design
from eitsim.sweeps.run.rows import solve_rows
from matcal.card import MaterialCard

SAMPLED = 4  # rows that are solved
# CPU time of a load path, and of what the rim changes under one diameter, over that of a touch solved directly
# (benchmarks/results/sweeps_run.csv, mechanics.csv); of a row from a table over its readings.
PATH, RIM, SERVED = 70.0, 390.0, 1.2
BYTES_TABLE, BYTES_AFRESH = 20.0, 28.0  # on disk, a reading of a row, in parts of many rows and of few


@dataclass(frozen=True)
class Forecast:
    """What a sweep will take; estimates, but for the counts."""

    rows: int
    readings: int  # of a row
    method: str  # why its touches are solved directly or taken from a table, in words
    tables: int  # load paths that are to be solved first, 0 where the cache has them
    table_cpu_s: float
    row_cpu_s: float  # mean CPU time of a row
    workers: int
    worker_MB: float  # memory of one
    disk_MB: float
    sampled: int  # rows that were solved for it
    failed: str  # what one of them said that was not solved, empty where all were

    @property
    def wall_s(self) -> float:
        """Wall time, s, on idle processors."""
        return (self.table_cpu_s + self.rows * self.row_cpu_s) / self.workers


def forecast(design: Design, card: MaterialCard, workers: int, *, reuse: bool | None = None,
             exact: bool = False) -> Forecast:
    """The cost of `sweep` of a design with a card on so many workers; ValueError as `sweep`."""
    cards = cards_for(design, card)
    method = method_for(design, cards, reuse, exact)
    asked = _spread(design.scenes)
    rows = solve_rows(design, cards, asked, exact=exact)
    solved = [row for row in rows if row["outcome"] == "ok"]
    whole, touch, readings = (fmean([row[name] for row in solved] or [0.0])
                              for name in ("cpu_s", "mechanics_cpu_s", "electrics_cpu_s"))
    table_s, paths = 0.0, 0
    if method["reuse"] and (shape := shape_of_design(design, cards)) is not None:
        least = min((row["mechanics_cpu_s"] for row in solved), default=0.0)
        if not is_stored(shape, rim=False):
            paths, table_s = len(shape.solved), PATH * least * len(shape.solved)
        if method["rim"] and not is_stored(shape, rim=True):
            table_s += RIM * least * len(changed_diameters(shape))
        whole = SERVED * readings + max(whole - touch - readings, 0.0)
    count = sum(name.startswith("dv_") for name in rows[0])
    each = BYTES_TABLE if method["reuse"] else BYTES_AFRESH
    failed = next((f"{row['outcome']}: {row['message']}" for row in rows if row["outcome"] != "ok"), "")
    return Forecast(design.scenes, count, method["reason"], paths, table_s, whole, workers, _resident_MB(),
                    1e-6 * each * count * design.scenes, len(asked), failed)


def lines(found: Forecast) -> list[str]:
    """A forecast in words."""
    tables = (f"{found.tables} load paths first, some {_time(found.table_cpu_s)} of CPU" if found.tables else
              f"what the rim changes first, some {_time(found.table_cpu_s)} of CPU" if found.table_cpu_s else
              "nothing to be solved first")
    said = [f"rows      {found.rows} of {found.readings} readings", f"touches   {found.method}",
            f"tables    {tables}", f"a row     {found.row_cpu_s:.2g} CPU s",
            f"time      {_time(found.wall_s)} on {found.workers} idle processor{'s' * (found.workers != 1)}",
            f"memory    {found.worker_MB * found.workers / 1e3:.1f} GB, {found.worker_MB:.0f} MB a worker",
            f"disk      {found.disk_MB:.3g} MB",
            f"Estimates for this machine, by {found.sampled} of its rows; rows near edges may cost more than these did."]
    return said + ([f"caution: one of them was {found.failed}"] if found.failed else [])


def _spread(scenes: int) -> list[int]:
    return sorted({i * scenes // SAMPLED for i in range(SAMPLED)})


def _time(seconds: float) -> str:
    """A time in the unit that suits it."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0), ("min", 60.0)):
        if seconds >= 2 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"


def _resident_MB() -> float:
    """Most memory of this process, which solved rows as a worker does."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1e-6 if sys.platform == "darwin" else 1e-3)
