"""Many scenes into a data set, by one or many workers; a sweep that was stopped goes on where it was."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from eitsim import dataset, fields_file, made_by
from eitsim.crew import Crew
from eitsim.design import Design, example
from eitsim.family import Family, central_of
from eitsim.family_reuse import family_for, family_repays, span_for
from eitsim.materials import Cards, cards_for, foam_varies
from eitsim.pieces import Pieces
from eitsim.plan import law_of
from eitsim.reuse import (
    design_shape,
    diameters_of,
    fine_enough_for,
    repays,
    rim_repays,
    table_for,
    with_diameters,
)
from eitsim.rows import blank_row
from eitsim.solved_parts import Part, solved_parts
from eitsim.sweep_folder import keep_to_table, missing, sole_writer, start_or_continue
from eitsim.sweep_omissions import omissions
from eitsim.sweep_runs import Run, Spent, record, runs_of
from eitsim.table import Table
from eitsim.tally import Tally
from eitsim.workers import processes
from matcal.card import MaterialCard, read_card, require
from matcal.errors import NotConverged

# Rows of a part: files cost as much as some dozen rows from a table, and little beside rows that are solved afresh.
ROWS_FROM_TABLE, ROWS_AFRESH = 64, 16


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
          crew: AbstractContextManager[Crew] | Crew | None = None, reuse: bool | None = None,
          exact: bool = False, other_code: bool = False) -> Iterator[Progress | Account]:
    """Solve every scene of `design` that `folder` lacks; yields Progress at the start and after each part, then the
    Account.

    workers: processes of this machine, 1 for this process itself; crew: who works instead, as cluster.cluster(address)
    or crew.Lent(executor, count). reuse: whether touches come from a table of load paths, by default where that repays
    its cost; exact: every row as simulate(exact=True), without a table. A folder keeps to what it was started with.
    other_code: go on where other code or libraries made the rows; the manifest tells which scenes are whose.
    Rows, but for COST, depend on the design, the card and these two only, not on who works or how often the sweep was
    stopped. A scene whose solution takes its process with it, again and again, is a row "crashed", which the next call
    solves again.
    ValueError where the folder belongs to another design or card, was started otherwise or by other code, where reuse
    is asked for and the design has no use for a table, or where another sweep is writing to it; NoCrew where nobody
    works; OSError where the folder cannot be written.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}.")
    if exact and reuse:
        raise ValueError("exact solves every touch afresh; leave out reuse.")
    card = read_card(card_path)
    _check_card(card, design)
    cards = cards_for(design.material, design.seed, card, card_path)
    folder.mkdir(parents=True, exist_ok=True)
    with sole_writer(folder):
        wanted = _wanted(design, cards, reuse, exact)
        size = ROWS_FROM_TABLE if wanted["reuse"] else ROWS_AFRESH
        manifest, before = start_or_continue(folder, design, cards, card_path, wanted, size, reuse,
                                             list(blank_row(design, cards)), other_code)
        method, size = manifest["method"], manifest["rows_per_part"]
        todo, tally, kept = missing(before.there, size), before.tally, before.tally.rows
        table, note, spent, done, run = None, "", Spent(), tally, None
        count = workers if method["reuse"] or len(todo) > 1 else 1
        with _crew(crew, count) as hands:
            if method["reuse"] and todo:
                yield Progress(kept, design.scenes, kept, tally.outcomes, "table")
                with spent.on("table"):
                    table, note = _table(design, cards, hands, method)
                manifest = keep_to_table(folder, manifest, table, note)
            yield _progress(design, done, kept)
            with spent.on("rows"):
                for part in solved_parts(hands, design, cards, todo, exact=method["exact"], table=table):
                    with spent.on("writing"):
                        _keep(folder, design, part, size)
                    done, spent.encoding_cpu_s = done + part.tally, spent.encoding_cpu_s + part.encoding_cpu_s
                    yield _progress(design, done, kept)
        if todo:
            told = _told(method, table, note) + made_by.in_words(manifest)
            if before.crashed:
                told += f"; {before.crashed} rows that had crashed solved again"
            run = spent.run(told, done.rows - kept, done.cpu_s - tally.cpu_s, count if crew is None else None,
                            central_of(table))
            record(folder, manifest, run, omissions(design, card, exact=method["exact"]))
        dataset.settle(folder)
    yield Account(done.outcomes, {name: message for name, (_, message) in done.first.items()}, done.rows - kept, kept,
                  run.method if run is not None else _told_before(manifest), run)


def _told_before(manifest: Mapping[str, Any]) -> str:
    """How touches were solved when the rows were."""
    runs = runs_of(manifest)
    return runs[-1].method if runs else _told(manifest["method"], None, "")


def _progress(design: Design, done: Tally, kept: int) -> Progress:
    median, most = done.error_below(0.5), done.error_below(0.95)
    return Progress(done.rows, design.scenes, kept, done.outcomes,
                    signal_error=None if median is None or most is None else (median, most))


def _crew(crew: AbstractContextManager[Crew] | Crew | None, workers: int) -> AbstractContextManager[Crew]:
    if crew is None:
        return processes(workers)
    return crew if isinstance(crew, AbstractContextManager) else nullcontext(crew)


def _keep(folder: Path, design: Design, part: Part, size: int) -> None:
    """Put a part in its place, its fields first; what stands there of other scenes stays."""
    place, content = dataset.part_path(folder, part.scenes[0] // size * size), part.content
    beside, fields = place.with_suffix(fields_file.SUFFIX), part.fields
    if place.exists():
        content = dataset.with_rows(place.read_bytes(), content)
        if design.fields is not None and fields is not None:
            fields = fields_file.continued(beside, design.fields, example(design).body, fields)
    try:
        if fields is not None:
            dataset.put(beside, fields)
        dataset.put(place, content)
    except OSError as error:
        raise OSError(error.errno, f"{error.strerror}. What is finished is kept; the same command goes on from there",
                      str(place)) from None


def _wanted(design: Design, cards: Cards, reuse: bool | None, exact: bool) -> dict[str, Any]:
    """How a new folder's touches are to be solved, and why."""
    if exact or reuse is False:
        return {"exact": exact, "reuse": False, "rim": False, "reason": "as asked for"}
    try:
        if foam_varies(cards):
            shape, span = span_for(design, cards)
            repaid = family_repays(design, shape, span)
        else:
            shape = design_shape(design, cards.card)
            repaid = repays(design, shape)
    except ValueError as error:
        if reuse:
            raise ValueError(f"{error} Leave out --reuse: every touch is then solved afresh.") from None
        return {"exact": False, "reuse": False, "rim": False, "reason": str(error)}
    used = bool(reuse or repaid)
    why = ("as asked for" if reuse else "a table of load paths repays its cost" if repaid else
           "a table of load paths costs more than so few touches (--reuse makes one)")
    found = {"exact": False, "reuse": used, "rim": used and rim_repays(design, shape), "reason": why}
    return found | ({"shape": diameters_of(shape)} if used else {})


def _table(design: Design, cards: Cards, crew: Crew, method: Mapping[str, Any]) -> tuple[Table | Family | None, str]:
    """The table of a design, or the family of its drawn laws, and a note; none where paths are not found or too rough,
    or were not when the folder was started.
    """
    before = method.get("table", {"used": True, "rim": method["rim"], "note": ""})
    if not before["used"]:
        return None, before["note"]
    kept = method.get("shape")
    if foam_varies(cards):
        shape, span = span_for(design, cards)
        make = partial(family_for, with_diameters(shape, kept), span)
    else:
        make = partial(table_for, with_diameters(design_shape(design, cards.card), kept))
    pieces = Pieces(crew)
    found, note = _made(make, pieces, before["rim"])
    pieces.forget()
    table = central_of(found)
    if table is None:
        return None, note
    fine, rough = fine_enough_for(design, table)
    note = "; ".join(part for part in (before["note"], note, rough) if part)
    return (replace(found, table=fine) if isinstance(found, Family) and fine is not None else fine), note


def _made(make: Callable[..., tuple[Table | Family, str]], run: Pieces,
          rim: bool) -> tuple[Table | Family | None, str]:
    try:
        found, note = make(run)
    except NotConverged as error:
        return None, f"no table: {error}"
    if not rim:
        return found, note
    try:
        return make(run, rim=True)
    except NotConverged as error:
        return found, f"no table of what the rim changes: {error}"


def _told(method: Mapping[str, Any], found: Table | Family | None, note: str) -> str:
    table = central_of(found)
    if table is None:
        how = "exactly" if method["exact"] else "afresh"
        return f"every touch solved {how}: {note or method['reason']}"
    error, rim = table.error, "those near the rim or beyond the table afresh"
    if table.rim is not None:
        rim = (f"near the rim another {table.rim.error.depth:.1e} and {table.rim.error.signal:.1e}; those beyond the "
               "tables afresh")
    paths = f"{len(table.shape.solved)} load paths"
    if isinstance(found, Family) and found.span.chosen:
        paths += f" of a central law and what {len(found.span.chosen)} other drawn laws change of them"
    return (f"touches from a table of {paths} ({table.whole_cpu_s:.0f} CPU s, once, not counted in the rows' cpu_s), "
            f"at most {error.depth:.1e} off in depth and {error.signal:.1e} in signal; {rim}"
            + (f"; {note}" if note else ""))


def _check_card(card: MaterialCard, design: Design) -> None:
    """Fail before the first row where the card lacks what every row needs."""
    law_of(example(design), card)
    require(card, "conductivity", "the skin")
