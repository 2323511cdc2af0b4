"""Many scenes into a data set, by one or many workers; a sweep that was stopped goes on where it was."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from eitsim.mechanics.load_paths.types import Table
from eitsim.scene.curved.curved_scene import CurvedScene, is_curved
from eitsim.simulation.material import material_of
from eitsim.sweeps.dataset import code_history, hdf5_fields, parquet
from eitsim.sweeps.dataset.outcome_counts import OutcomeCounts
from eitsim.sweeps.dataset.parquet import Dataset
from eitsim.sweeps.dataset.sweep_record import RUNS, Account, Run, runs_of
from eitsim.sweeps.design import nested_design
from eitsim.sweeps.design.card_draws import Cards, cards_for
from eitsim.sweeps.design.design import Design, flat_scene, representative_scene
from eitsim.sweeps.run.folder import ROWS, Standing, check_own, keep_to_table, missing, sole_writer, start_or_continue
from eitsim.sweeps.run.load_path_choice import AnyTable, describe_method, method_for, paths_of, table_of
from eitsim.sweeps.run.omissions import LEFT_OUT, omissions
from eitsim.sweeps.run.other_profiles import other_profiles
from eitsim.sweeps.run.parts import Part, solved_parts
from eitsim.sweeps.run.rows import blank_row
from eitsim.sweeps.run.scene_table import as_design
from matcal.card import MaterialCard, as_card
from touchcal.parallel.dask_cluster import cluster
from touchcal.parallel.pool import WorkerPool
from touchcal.parallel.processes import processes

# Rows of a part: files cost as much as some dozen rows from a table, and little next to rows that are solved directly.
ROWS_FROM_TABLE, ROWS_AFRESH = 64, 16

# the address of a dask scheduler, workers, or a context that connects to them
Pool = str | WorkerPool | AbstractContextManager[WorkerPool]


@dataclass(frozen=True)
class Progress:
    """How far a sweep is."""

    # rows of the data set, and scenes of its design
    done: int
    scenes: int
    kept: int  # rows that stood there before
    outcomes: Mapping[str, int]  # outcome -> number of rows
    stage: str = "rows"  # "table" while load paths are solved, else "rows"
    # estimated relative signal errors of ok rows so far, the median and what 95 % lie below; None without such rows
    signal_error: tuple[float, float] | None = None


def sweep(design: Design | Path | str, card: MaterialCard | Path | str, out: Path | str, *,
          scenes: int | None = None, scene: Path | str | None = None, workers: int = 1, scheduler: Pool | None = None,
          reuse: bool | None = None, exact: bool = False, other_code: bool = False,
          progress: Callable[[Progress], None] | None = None) -> Dataset:
    """Solve every scene of a design that a folder lacks; one that was stopped goes on where it was. The first touches
    of many are solved by punches of other profiles as well, in a folder of their own (`other_profiles`).

    Rows, but for COST, depend on the design, the card, `reuse` and `exact` only, not on who works or how often the
    sweep was stopped. A scene whose solution takes its process with it, again and again, is a row "crashed", which the
    next call solves again.

    Parameters
    ----------
    design
        A `Design`, a design file (TOML), or a table of scenes (CSV, one row a scene).
    card
        A `MaterialCard`, or the file of one. With `[material]` draws it must have a file, next to which they lie.
    out
        Folder of the data set. It keeps to what it was started with.
    scenes
        Number of scenes, in place of the design's own.
    scene
        With a table of scenes: the scene file of what its columns leave out.
    workers
        Processes of this machine; 1 for this process itself. More of them need `if __name__ == "__main__":` around a
        script that calls this.
    scheduler
        Who works instead: the address of a dask scheduler, or a pool (`touchcal.parallel.pool.ExecutorPool`).
    reuse
        Whether touches come from a table of load paths; by default where that repays its cost.
    exact
        Every row as `simulate` with `exact`, without a table.
    other_code
        Go on where other code or libraries made the rows; the manifest tells which scenes are whose.
    progress
        Called at the start and after each part.

    Returns
    -------
    Dataset
        Its rows, and `account`: what this call did.

    Raises
    ------
    ValueError
        Where the folder belongs to another design or card, was started otherwise or by other code, where `reuse` is
        asked for and the design has no use for a table, or where another sweep is writing to the folder.
    PoolUnavailable
        Where nobody works; before anything is written where the scheduler says so.
    OSError
        Where the folder cannot be written.

    Examples
    --------
    >>> import tempfile, eitsim
    >>> from matcal.card import MaterialCard
    >>> from matcal.laws.conductivity import Conductivity
    >>> from matcal.laws.hyperfoam import Hyperfoam
    >>> from eitsim.sweeps.design.design import design_from
    >>> foam = Hyperfoam([9530.0], [8.0], [0.0], "longterm")
    >>> card = MaterialCard("foam", foam, conductivity=Conductivity(30.0, [-2, 2, -1], (0, 0.4)))
    >>> design = design_from({"scenes": 2, "punch": {"force_N": [0.1, 0.2]}, "accuracy": {"signal": 0.05}})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     data = eitsim.sweep(design, card, folder)
    ...     len(data.ok), data.account.solved
    (2, 2)
    """
    design, card = as_design(design, scenes, scene), as_card(card)
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}.")
    if exact and reuse:
        raise ValueError("exact solves every touch itself; leave out reuse.")
    first = representative_scene(design)
    # ValueError where the card lacks what every row needs
    _ = material_of(first.flat if isinstance(first, CurvedScene) else first, card).skin
    folder, others = Path(out), other_profiles(design)
    with _entered(scheduler) as pool:
        account = _swept(design, card, folder, pool, workers, reuse, exact, other_code, progress or (lambda step: None))
        if others is not None:
            _swept(others, card, folder / parquet.OTHER_PROFILES, pool, workers, None, exact, other_code,
                   lambda step: None)
    return replace(parquet.open_dataset(folder), account=account)


def _swept(design: Design, card: MaterialCard, folder: Path, pool: WorkerPool | None, workers: int, reuse: bool | None,
           exact: bool, other_code: bool, hears: Callable[[Progress], None]) -> Account:
    """What `sweep` does in one folder."""
    cards = cards_for(design.material, design.seed, card, in_pairs=design.sampler == nested_design.SAMPLER)
    check_own(folder)
    folder.mkdir(parents=True, exist_ok=True)
    with sole_writer(folder):
        return _done(_work(design, cards, folder, reuse, exact, other_code, hears), pool, workers)


@dataclass(frozen=True, eq=False)
class _Work:
    """What a call has to do in a folder."""

    design: Design
    cards: Cards
    folder: Path
    manifest: Mapping[str, Any]
    before: Standing
    todo: list[range]  # scenes without a row, by part
    hears: Callable[[Progress], None]  # who hears how far it is

    @property
    def method(self) -> Mapping[str, Any]:
        """How touches are solved, as the folder was started."""
        return self.manifest["method"]

    def tell(self, counts: OutcomeCounts, stage: str = "rows") -> None:
        """Tell how far the rows of these counts are."""
        median, most = counts.error_below(0.5), counts.error_below(0.95)
        self.hears(Progress(counts.rows, self.design.scenes, self.before.counts.rows, counts.outcomes, stage,
                            None if median is None or most is None else (median, most)))


@dataclass
class Spent:
    """Times that add up while a sweep runs."""

    wall_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    cpu_s: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    encoding_cpu_s: float = 0.0  # of encoding parts, which is not done here

    @contextmanager
    def on(self, stage: str) -> Iterator[None]:
        """Count what this thread does meanwhile."""
        wall, cpu = time.perf_counter(), time.thread_time()
        try:
            yield
        finally:
            self.wall_s[stage] += time.perf_counter() - wall
            self.cpu_s[stage] += time.thread_time() - cpu

    def run(self, method: str, rows: int, rows_cpu_s: float, workers: int | None, table: AnyTable | None) -> Run:
        """What was spent on these rows, in stages "table", "rows" and "writing"."""
        tables: dict[str, Any] = {} if table is None else {"paths": paths_of(table), "paths_cpu_s": table.cpu_s}
        if isinstance(table, Table) and table.rim is not None:
            tables |= {"rim": len(table.rim.diameters) * len(table.rim.gaps), "rim_cpu_s": table.rim.cpu_s}
        return Run(method, rows, rows_cpu_s, self.wall_s["rows"], workers, self.wall_s["table"], self.encoding_cpu_s,
                   self.cpu_s["writing"], self.wall_s["writing"], **tables)


def _work(design: Design, cards: Cards, folder: Path, reuse: bool | None, exact: bool, other_code: bool,
          hears: Callable[[Progress], None]) -> _Work:
    method = method_for(design, cards, reuse, exact)
    size = ROWS_FROM_TABLE if method["reuse"] and not is_curved(design.tables) else ROWS_AFRESH
    manifest, before = start_or_continue(folder, design, cards, method, size, reuse,
                                         list(blank_row(design, cards)), other_code)
    return _Work(design, cards, folder, manifest, before, missing(before.there, manifest["rows_per_part"]), hears)


def _done(work: _Work, lent: WorkerPool | None, workers: int) -> Account:
    """Solve and keep what is to be done, and put on record what it cost."""
    count, spent, run = workers if work.method["reuse"] or len(work.todo) > 1 else 1, Spent(), None
    with processes(count) if lent is None else nullcontext(lent) as pool:
        work, table, note = _with_table(work, pool, spent)
        counts = _rows(work, pool, table, spent)
    if work.todo:
        kept = work.before.counts
        run = spent.run(_how(work, table, note), counts.rows - kept.rows, counts.cpu_s - kept.cpu_s,
                        count if lent is None else None, table)
        left_out = omissions(work.design, work.cards, exact=work.method["exact"])
        parquet.write_manifest(work.folder, {key: value for key, value in work.manifest.items() if key != "schema"} | {
            ROWS: counts.rows, RUNS: [*work.manifest.get(RUNS, []), asdict(run)],
            LEFT_OUT: [asdict(one) for one in left_out]})
    parquet.settle(work.folder)
    return _account(work, counts, run)


def _with_table(work: _Work, pool: WorkerPool, spent: Spent) -> tuple[_Work, AnyTable | None, str]:
    """The load paths where touches are taken from them, which the manifest then tells, and a note on them."""
    if not work.method["reuse"] or not work.todo:
        return work, None, ""
    work.tell(work.before.counts, "table")
    with spent.on("table"):
        table, note = table_of(work.design, work.cards, pool, work.method)
    return replace(work, manifest=keep_to_table(work.folder, work.manifest, table, note)), table, note


def _rows(work: _Work, pool: WorkerPool, table: AnyTable | None, spent: Spent) -> OutcomeCounts:
    """Solve and keep the parts that are missing; the counts of all rows."""
    counts = work.before.counts
    work.tell(counts)
    with spent.on("rows"):
        for part in solved_parts(pool, work.design, work.cards, work.todo, exact=work.method["exact"], table=table,
                                 identity=work.manifest.get(parquet.IDENTITY)):
            with spent.on("writing"):
                _keep(work.folder, work.design, part, work.manifest)
            counts, spent.encoding_cpu_s = counts + part.counts, spent.encoding_cpu_s + part.encoding_cpu_s
            work.tell(counts)
    return counts


def _how(work: _Work, table: AnyTable | None, note: str) -> str:
    """How the rows of this call were solved, in words."""
    crashed, lost = work.before.crashed, work.before.lost
    return (describe_method(work.method, table, note, representative_scene(work.design).skin.strain)
            + code_history.in_words(work.manifest)
            + (f"; {crashed} rows that had crashed solved again" if crashed else "")
            + (f"; {lost} rows that were there before were lost and are solved again" if lost else ""))


def _account(work: _Work, counts: OutcomeCounts, run: Run | None) -> Account:
    before, kept = runs_of(work.manifest), work.before.counts.rows
    how = run or (before[-1] if before else None)
    return Account(counts.outcomes, {name: message for name, (_, message) in counts.first.items()}, counts.rows - kept,
                   kept, describe_method(work.method, None, "", "") if how is None else how.method, run)


def _entered(scheduler: Pool | None) -> AbstractContextManager[WorkerPool | None]:
    """Who works instead of processes of this machine, connected to where that is still to be done."""
    found = cluster(scheduler) if isinstance(scheduler, str) else scheduler
    return found if isinstance(found, AbstractContextManager) else nullcontext(found)


def _keep(folder: Path, design: Design, part: Part, manifest: Mapping[str, Any]) -> None:
    """Put a part in its place, its fields first; what stands there of other scenes stays."""
    size = manifest["rows_per_part"]
    place, content = parquet.part_path(folder, part.scenes[0] // size * size), part.content
    fields_at, fields = place.with_suffix(hdf5_fields.SUFFIX), part.fields
    if place.exists():
        content = parquet.with_rows(place.read_bytes(), content, manifest.get(parquet.IDENTITY))
        if design.fields is not None and fields is not None:
            fields = hdf5_fields.continued(fields_at, design.fields, flat_scene(design).body, fields)
    try:
        if fields is not None:
            parquet.put(fields_at, fields)
        parquet.put(place, content)
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}. What is finished is kept; the same command goes on from there",
                      str(place)) from None
