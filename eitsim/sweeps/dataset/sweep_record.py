"""What a call of a sweep did and spent: what it returns, and what the manifest of its folder keeps."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

RUNS = "runs"  # Key of the manifest: what each call spent.


@dataclass(frozen=True)
class Run:
    """One call of a sweep, from its first row to its last; without one that was killed."""

    method: str  # how touches were solved, in words
    # rows solved, and their CPU time, s
    rows: int
    rows_cpu_s: float
    # wall time from the first row handed out to the last one on disk, s; the start of workers counts
    rows_wall_s: float
    workers: int | None  # processes that solved them; None where others lent them
    table_wall_s: float  # wall time until the table of load paths was there, s
    encoding_cpu_s: float  # CPU time of encoding parts, s, with the workers
    # CPU and wall time of writing parts, s, alone in the parent
    writing_cpu_s: float
    writing_wall_s: float
    # how many load paths, and CPU time when they were solved, s, here or earlier
    paths: int = 0
    paths_cpu_s: float = 0.0
    # the same of the rim's changes
    rim: int = 0
    rim_cpu_s: float = 0.0

    @property
    def efficiency(self) -> float | None:
        """CPU time of rows over the wall time of all workers; None where their number is not known."""
        return None if not self.workers or not self.rows else self.rows_cpu_s / (self.rows_wall_s * self.workers)


@dataclass(frozen=True)
class Account:
    """What a sweep did."""

    outcomes: Mapping[str, int]  # outcome -> number of rows, over the whole data set
    reasons: Mapping[str, str]  # outcome other than "ok" -> the message of its first row
    solved: int  # rows solved by this call
    kept: int  # rows that stood there before
    method: str  # how touches were solved, in words
    run: Run | None = None  # what the call spent; None where all rows were there


def runs_of(manifest: Mapping[str, Any]) -> list[Run]:
    """All that are on record, the first one first."""
    try:
        return [Run(**run) for run in manifest.get(RUNS, [])]
    except TypeError:
        raise ValueError(f"design.json: {RUNS} does not hold what each call spent. It was changed: restore it from a "
                         "copy, or sweep again into another folder.") from None
