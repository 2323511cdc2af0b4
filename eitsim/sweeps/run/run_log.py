"""What each call of a sweep spent, kept in the manifest of its folder."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from eitsim.mechanics.load_paths.types import Table
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.dataset.sweep_record import RUNS, Run
from eitsim.sweeps.run.omissions import LEFT_OUT, Omission


@dataclass
class Spent:
    """Times that add up while a sweep runs."""

    wall_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    cpu_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    # of encoding parts, which is not done here
    encoding_cpu_s: float = 0.0

    @contextmanager
    def on(self, stage: str) -> Iterator[None]:
        """Count what this thread does meanwhile."""
        wall, cpu = time.perf_counter(), time.thread_time()
        try:
            yield
        finally:
            self.wall_s[stage] += time.perf_counter() - wall
            self.cpu_s[stage] += time.thread_time() - cpu

    def run(self, method: str, rows: int, rows_cpu_s: float, workers: int | None, table: Table | None) -> Run:
        """What was spent on these rows, in stages "table", "rows" and "writing"."""
        return Run(method, rows, rows_cpu_s, self.wall_s["rows"], workers, self.wall_s["table"], self.encoding_cpu_s,
                   self.cpu_s["writing"], self.wall_s["writing"], **_of_table(table))


def _of_table(table: Table | None) -> dict[str, Any]:
    if table is None:
        return {}
    told: dict[str, Any] = {"paths": len(table.shape.solved), "paths_cpu_s": table.cpu_s}
    if table.rim is not None:
        told |= {"rim": len(table.rim.diameters) * len(table.rim.gaps), "rim_cpu_s": table.rim.cpu_s}
    return told


def record(folder: Path, manifest: Mapping[str, Any], run: Run, left_out: Sequence[Omission]) -> None:
    """Add a run to the manifest of a folder, with what its rows leave out."""
    kept = {key: value for key, value in manifest.items() if key != "schema"}
    parquet.write_manifest(folder, kept | {
        RUNS: [*manifest.get(RUNS, []), asdict(run)], LEFT_OUT: [asdict(one) for one in left_out]})
