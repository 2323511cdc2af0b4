"""The account of a data set: outcomes, errors of signals, and what each stage of its making cost."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum, auto
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from eitsim.scene.scene import Accuracy
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.dataset.hdf5_fields import SUFFIX
from eitsim.sweeps.dataset.outcome_counts import OutcomeCounts, count_outcomes
from eitsim.sweeps.dataset.sweep_record import Run, runs_of
from eitsim.sweeps.run.omissions import Omission, omissions_of
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.number_words import counted

_WANTED = "accuracy_signal"
_COLUMNS = ["scene", "outcome", "message", "signal_error", _WANTED, parquet.EXTRAPOLATED, *parquet.COST,
            *parquet.METHODS]


class Work(StrEnum):
    """Kinds of stages, in the order of the work."""

    TABLE = auto()
    TOUCHES = auto()
    READINGS = auto()
    FIELDS = auto()
    PLANNING = auto()
    UNSOLVED = auto()
    PARTS = auto()


@dataclass(frozen=True)
class Stage:
    """One stage of making a data set."""

    kind: Work
    name: str  # what was done, in words
    count: int  # how often: paths, places on the rim, or rows
    cpu_s: float  # CPU time, s


@dataclass(frozen=True)
class Errors:
    """Estimated relative errors of the signals of ok rows."""

    median: float
    # what 95 % lie below, and the largest
    p95: float
    largest: float
    share_above: float  # part of the rows whose error is above the requested one
    requested: float | None  # None where it differs between rows


@dataclass(frozen=True)
class Accounted:
    """What is in a data set, and what it cost."""

    # rows that are there, and scenes of the design
    rows: int
    scenes: int
    outcomes: Mapping[str, int]  # outcome -> number of rows
    errors: Errors | None  # None without rows that are ok
    # in the order of the work; CPU time of all rows, and of tables and of encoding and writing parts as far as runs
    # are on record
    stages: tuple[Stage, ...]
    # on disk, of Parquet parts and of stored fields
    bytes_per_row: float
    field_bytes_per_row: float
    # calls that came to an end, the first one first; empty of sets that were made before these were kept
    runs: tuple[Run, ...]
    left_out: tuple[Omission, ...]  # the costliest first, with the last run
    # median and largest share of a signal that comes from extrapolated conductivity; None where no row tells it
    extrapolated: tuple[float, float] | None = None

    @property
    def cpu_s(self) -> float:
        """CPU time of all stages, s."""
        return sum(stage.cpu_s for stage in self.stages)

    @property
    def rows_per_core_hour(self) -> float | None:
        """Rows over the CPU time of all stages but tables, which are made once; None where rows tell no time."""
        spent = sum(stage.cpu_s for stage in self.stages if stage.kind is not Work.TABLE)
        return 3600 * self.rows / spent if spent else None


def account_of(folder: Path) -> Accounted:
    """The account of a data set, read part by part in the columns that it needs: 8 bytes a row are kept. InputFileError
    where it is none or holds no rows."""
    manifest, parts = parquet.read_manifest(folder), parquet.parts(folder)
    if not parts:
        raise InputFileError(folder, "the data set has no rows yet. Run `eitsim sweep` on it.")
    counts, stages = OutcomeCounts(), list[pd.DataFrame]()
    found, shares, above = [], [], 0
    asked = manifest["design"]["tables"].get("accuracy", {}).get("signal", Accuracy().signal)
    asked = float(asked) if isinstance(asked, int | float) else None
    for path in parts:
        table = parquet.read_part(path, _COLUMNS, manifest).reindex(columns=_COLUMNS)
        counts = counts + count_outcomes(table)
        stages.append(_by_stage(table))
        ok = table.loc[table["outcome"] == "ok"]
        errors = ok["signal_error"].to_numpy(dtype=float)
        above += int((errors > (ok[_WANTED].to_numpy(dtype=float) if asked is None else asked)).sum())
        found.append(errors)
        shares.append(ok[parquet.EXTRAPOLATED].dropna().to_numpy(dtype=float))
    runs = tuple(runs_of(manifest))
    every, spread = np.concatenate(found), None
    if every.size:
        median, p95, largest = np.quantile(every, [0.5, 0.95, 1]).tolist()
        spread = Errors(median, p95, largest, above / every.size, asked)
    return Accounted(counts.rows, manifest["design"]["scenes"], dict(counts.outcomes), spread,
                     (*_of_tables(runs), *_of_rows(stages), *_of_parts(runs)), _bytes(parts) / counts.rows,
                     _bytes(path.with_suffix(SUFFIX) for path in parts) / counts.rows, runs,
                     tuple(omissions_of(manifest)),
                     (float(np.median(told)), float(told.max())) if (told := np.concatenate(shares)).size else None)


def _bytes(files: Iterable[Path]) -> int:
    return sum(path.stat().st_size for path in files if path.exists())


def _by_stage(table: pd.DataFrame) -> pd.DataFrame:
    """Rows and CPU time (count, cpu_s) of one part, by stage."""
    named = table["electrics_cpu_s"].notna() | (table["outcome"] == "ok")
    how = table[list(parquet.METHODS)].astype(object).fillna("not recorded").replace("", "not recorded")
    rest = table["cpu_s"] - table[list(parquet.COST[1:])].fillna(0.0).sum(axis=1)
    parts = [(Work.TOUCHES, "touches: " + how["mechanics_method"], table["mechanics_cpu_s"]),
             (Work.READINGS, "readings: " + how["electrics_method"], table["electrics_cpu_s"]),
             (Work.FIELDS, "fields on the skin", table["fields_cpu_s"]),
             (Work.PLANNING, "planning and the rest of rows", rest)]
    parts = [(kind, name, cost.where(named)) for kind, name, cost in parts]
    parts.append((Work.UNSOLVED, "rows that were not solved", table["cpu_s"].where(~named)))
    whole = pd.concat([pd.DataFrame({"kind": kind.value, "stage": name, "count": 1.0, "cpu_s": cost})
                       for kind, name, cost in parts])
    return whole.loc[whole["cpu_s"].notna()].groupby(["kind", "stage"], sort=False).sum()


def _of_tables(runs: tuple[Run, ...]) -> list[Stage]:
    last = next((run for run in reversed(runs) if run.paths), None)
    if last is None:
        return []
    return [Stage(Work.TABLE, "table: load paths", last.paths, last.paths_cpu_s)] + (
        [Stage(Work.TABLE, "table: what the rim changes", last.rim, last.rim_cpu_s)] if last.rim else [])


def _of_rows(parts: Sequence[pd.DataFrame]) -> list[Stage]:
    spent: dict[tuple[str, str], Array] = {}
    for part in parts:
        for at, numbers in zip(part.index, part[["count", "cpu_s"]].to_numpy(dtype=float), strict=True):
            spent[at] = spent.get(at, 0.0) + numbers
    rows = [Stage(Work(kind), name, int(count), float(cpu_s)) for (kind, name), (count, cpu_s) in spent.items()]
    return sorted(rows, key=lambda stage: ([*Work].index(stage.kind), stage.name))


def _of_parts(runs: tuple[Run, ...]) -> list[Stage]:
    if not runs:
        return []
    rows = sum(run.rows for run in runs)
    return [Stage(Work.PARTS, "encoding parts", rows, sum(run.encoding_cpu_s for run in runs)),
            Stage(Work.PARTS, "writing parts", rows, sum(run.writing_cpu_s for run in runs))]


def document(account: Accounted) -> dict[str, Any]:
    """An account as JSON holds it."""
    return asdict(account) | {
        "cpu_s": account.cpu_s, "rows_per_core_hour": account.rows_per_core_hour,
        "runs": [asdict(run) | {"efficiency": run.efficiency} for run in account.runs]}


def lines(account: Accounted) -> list[str]:
    """An account as it is printed."""
    out = [] if account.errors is None else _error_lines(account.errors, account.left_out)
    if account.extrapolated:
        median, largest = map(_percent, account.extrapolated)
        out.append(f"{median} of the signal comes from extrapolated conductivity in the median row, at most {largest}")
    whole = account.cpu_s or 1.0
    out.append(f"{'stage':42}{'count':>9}{'CPU s':>11}{'share':>9}")
    out += [f"{stage.name:42}{stage.count:9d}{stage.cpu_s:11.3g}{100 * stage.cpu_s / whole:7.1f} %"
            for stage in account.stages]
    if (rate := account.rows_per_core_hour) is not None:
        out.append(f"{rate:.3g} rows per core-hour without tables; {account.bytes_per_row:.0f} bytes a row"
                   + (f" and {account.field_bytes_per_row:.0f} of fields" if account.field_bytes_per_row else ""))
    return out + [in_words(run) for run in account.runs[-1:]]


def _error_lines(errors: Errors, left_out: Iterable[Omission]) -> list[str]:
    """Estimated errors in per cent and, where rows miss the requested one, what the plans count most for."""
    limit = "requested one" if errors.requested is None else f"requested {_percent(errors.requested)}"
    text = [f"signal error {_percent(errors.median)} in the median, 95 % below {_percent(errors.p95)}, at most "
            f"{_percent(errors.largest)}; {_percent(errors.share_above)} of ok rows above the {limit}"]
    if errors.share_above and (worst := next((one for one in left_out if one.error_bound > 0), None)):
        text.append(f"what the plans count most for: {worst.decision}, at most {_percent(worst.error_bound)} "
                    f"({counted(worst.rows, 'row')} of the {worst.of} looked at)")
    return text


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.3g} %"


def in_words(run: Run) -> str:
    """Wall time of a run, and how busy its workers were; times below 0.1 s are left out."""
    by = "lent workers" if run.workers is None else counted(run.workers, "worker")
    text = [f"last run: {counted(run.rows, 'row')} in {run.rows_wall_s:.1f} s on {by}"]
    text += [] if run.efficiency is None else [f"busy with rows for {_percent(run.efficiency)}"]
    text += [f"{run.writing_wall_s:.1f} s of it spent on writing"] if run.writing_wall_s >= 0.05 else []
    return ", ".join(text) + (f"; {run.table_wall_s:.1f} s for the table before" if run.table_wall_s >= 0.05 else "")
