"""Many scenes into a data set, by one or many workers; a sweep that was stopped goes on where it was."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from eitsim.mechanics.load_paths.law_family import Family, central_of
from eitsim.mechanics.load_paths.types import Table
from eitsim.simulation.material import material_of
from eitsim.sweeps.dataset import code_history, hdf5_fields, parquet
from eitsim.sweeps.dataset.outcome_counts import OutcomeCounts
from eitsim.sweeps.design import nested_design
from eitsim.sweeps.design.card_draws import Cards, cards_for
from eitsim.sweeps.design.design import Design, representative_scene
from eitsim.sweeps.run.folder import Standing, keep_to_table, missing, sole_writer, start_or_continue
from eitsim.sweeps.run.load_path_choice import method_for, table_of, told
from eitsim.sweeps.run.omissions import omissions
from eitsim.sweeps.run.parts import Part, solved_parts
from eitsim.sweeps.run.rows import blank_row
from eitsim.sweeps.run.run_log import Run, Spent, record, runs_of
from matcal.card import MaterialCard, read_card
from matcal.laws.conductivity import Conductivity
from touchcal.parallel.pool import WorkerPool
from touchcal.parallel.processes import processes

# Rows of a part: files cost as much as some dozen rows from a table, and little beside rows that are solved afresh.
ROWS_FROM_TABLE, ROWS_AFRESH = 64, 16

Loads = Table | Family | None


@dataclass(frozen=True)
class Progress:
    """How far a sweep is."""

    # rows of the data set, and scenes of its design
    done: int
    scenes: int
    # rows that stood there before
    kept: int
    # outcome -> number of rows
    outcomes: Mapping[str, int]
    # "table" while load paths are solved, else "rows"
    stage: str = "rows"
    # estimated relative signal errors of ok rows so far, the median and what 95 % lie below; None without such rows
    signal_error: tuple[float, float] | None = None


@dataclass(frozen=True)
class Account:
    """What a sweep did."""

    # outcome -> number of rows, over the whole data set
    outcomes: Mapping[str, int]
    # outcome other than "ok" -> the message of its first row
    reasons: Mapping[str, str]
    # rows solved by this call
    solved: int
    # rows that stood there before
    kept: int
    # how touches were solved, in words
    method: str
    # what the call spent; None where all rows were there
    run: Run | None = None


def sweep(design: Design, card_path: Path, folder: Path, *, workers: int = 1,
          pool: AbstractContextManager[WorkerPool] | WorkerPool | None = None, reuse: bool | None = None,
          exact: bool = False, other_code: bool = False) -> Iterator[Progress | Account]:
    """Solve every scene of `design` that `folder` lacks; yields Progress at the start and after each part, then the
    Account.

    workers: processes of this machine, 1 for this process itself; pool: who works instead, as cluster.cluster(address)
    or pool.ExecutorPool(executor, count). reuse: whether touches come from a table of load paths, by default where
    that repays
    its cost; exact: every row as simulate(exact=True), without a table. A folder keeps to what it was started with.
    other_code: go on where other code or libraries made the rows; the manifest tells which scenes are whose.
    Rows, but for COST, depend on the design, the card and these two only, not on who works or how often the sweep was
    stopped. A scene whose solution takes its process with it, again and again, is a row "crashed", which the next call
    solves again.
    ValueError where the folder belongs to another design or card, was started otherwise or by other code, where reuse
    is asked for and the design has no use for a table, or where another sweep is writing to it; PoolUnavailable where
    nobody works, before anything is written where `pool` tells it; OSError where the folder cannot be written.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}.")
    if exact and reuse:
        raise ValueError("exact solves every touch afresh; leave out reuse.")
    card = read_card(card_path)
    _check_card(card, design)
    cards = cards_for(design.material, design.seed, card, card_path, in_pairs=design.sampler == nested_design.SAMPLER)
    with _entered(pool) as lent:
        folder.mkdir(parents=True, exist_ok=True)
        with sole_writer(folder):
            work = _work(design, cards, card_path, folder, reuse, exact, other_code)
            account = yield from _done(work, lent, workers)
    yield account


@dataclass(frozen=True, eq=False)
class _Work:
    """What a call has to do in a folder."""

    design: Design
    cards: Cards
    folder: Path
    manifest: Mapping[str, Any]
    before: Standing
    # scenes without a row, by part
    todo: list[range]

    @property
    def method(self) -> Mapping[str, Any]:
        """How touches are solved, as the folder was started."""
        return self.manifest["method"]

    def progress(self, counts: OutcomeCounts, stage: str = "rows") -> Progress:
        """How far the rows of these counts are."""
        median, most = counts.error_below(0.5), counts.error_below(0.95)
        return Progress(counts.rows, self.design.scenes, self.before.counts.rows, counts.outcomes, stage,
                        None if median is None or most is None else (median, most))


def _work(design: Design, cards: Cards, card_path: Path, folder: Path, reuse: bool | None, exact: bool,
          other_code: bool) -> _Work:
    method = method_for(design, cards, reuse, exact)
    size = ROWS_FROM_TABLE if method["reuse"] else ROWS_AFRESH
    manifest, before = start_or_continue(folder, design, cards, card_path, method, size, reuse,
                                         list(blank_row(design, cards)), other_code)
    return _Work(design, cards, folder, manifest, before, missing(before.there, manifest["rows_per_part"]))


def _done(work: _Work, lent: WorkerPool | None, workers: int) -> Generator[Progress, None, Account]:
    """Solve and keep what is to be done, and put on record what it cost."""
    count, spent, run = workers if work.method["reuse"] or len(work.todo) > 1 else 1, Spent(), None
    with processes(count) if lent is None else nullcontext(lent) as hands:
        work, table, note = yield from _with_table(work, hands, spent)
        counts = yield from _rows(work, hands, table, spent)
    if work.todo:
        kept = work.before.counts
        run = spent.run(_how(work, table, note), counts.rows - kept.rows, counts.cpu_s - kept.cpu_s,
                        count if lent is None else None, central_of(table))
        record(work.folder, work.manifest, run,
               omissions(work.design, work.cards, exact=work.method["exact"], table=table))
    parquet.settle(work.folder)
    return _account(work, counts, run)


def _with_table(work: _Work, hands: WorkerPool, spent: Spent) -> Generator[Progress, None, tuple[_Work, Loads, str]]:
    """The load paths where touches are taken from them, which the manifest then tells, and a note on them."""
    if not work.method["reuse"] or not work.todo:
        return work, None, ""
    yield work.progress(work.before.counts, "table")
    with spent.on("table"):
        table, note = table_of(work.design, work.cards, hands, work.method)
    return replace(work, manifest=keep_to_table(work.folder, work.manifest, table, note)), table, note


def _rows(work: _Work, hands: WorkerPool, table: Loads, spent: Spent) -> Generator[Progress, None, OutcomeCounts]:
    """Solve and keep the parts that are missing; the counts of all rows."""
    counts = work.before.counts
    yield work.progress(counts)
    with spent.on("rows"):
        for part in solved_parts(hands, work.design, work.cards, work.todo, exact=work.method["exact"], table=table):
            with spent.on("writing"):
                _keep(work.folder, work.design, part, work.manifest["rows_per_part"])
            counts, spent.encoding_cpu_s = counts + part.counts, spent.encoding_cpu_s + part.encoding_cpu_s
            yield work.progress(counts)
    return counts


def _how(work: _Work, table: Loads, note: str) -> str:
    """How the rows of this call were solved, in words."""
    crashed = work.before.crashed
    return (told(work.method, table, note) + code_history.in_words(work.manifest)
            + (f"; {crashed} rows that had crashed solved again" if crashed else ""))


def _account(work: _Work, counts: OutcomeCounts, run: Run | None) -> Account:
    before, kept = runs_of(work.manifest), work.before.counts.rows
    how = run or (before[-1] if before else None)
    return Account(counts.outcomes, {name: message for name, (_, message) in counts.first.items()}, counts.rows - kept,
                   kept, told(work.method, None, "") if how is None else how.method, run)


def _entered(pool: AbstractContextManager[WorkerPool] | WorkerPool | None) -> AbstractContextManager[WorkerPool | None]:
    """Who works instead of processes of this machine, connected to where that is still to be done."""
    return pool if isinstance(pool, AbstractContextManager) else nullcontext(pool)


def _keep(folder: Path, design: Design, part: Part, size: int) -> None:
    """Put a part in its place, its fields first; what stands there of other scenes stays."""
    place, content = parquet.part_path(folder, part.scenes[0] // size * size), part.content
    beside, fields = place.with_suffix(hdf5_fields.SUFFIX), part.fields
    if place.exists():
        content = parquet.with_rows(place.read_bytes(), content)
        if design.fields is not None and fields is not None:
            fields = hdf5_fields.continued(beside, design.fields, representative_scene(design).body, fields)
    try:
        if fields is not None:
            parquet.put(beside, fields)
        parquet.put(place, content)
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}. What is finished is kept; the same command goes on from there",
                      str(place)) from None


def _check_card(card: MaterialCard, design: Design) -> Conductivity:
    """The skin's law; ValueError before the first row where the card lacks what every row needs."""
    return material_of(representative_scene(design), card).skin
