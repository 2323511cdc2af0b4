"""Parts of a sweep as its workers send them: rows encoded for the disk, and what became of them."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import pandas as pd

from eitsim.sweeps.dataset import hdf5_fields, parquet
from eitsim.sweeps.dataset.outcome_counts import OutcomeCounts, count_outcomes
from eitsim.sweeps.design.card_draws import Cards
from eitsim.sweeps.design.design import Design, flat_scene
from eitsim.sweeps.run.load_path_choice import AnyTable
from eitsim.sweeps.run.rows import crashed_row, solve_rows
from touchcal.parallel.pool import Failed, WorkerPool, answers

_TRIES, _ROW_TRIES = 2, 3  # Workers that may be lost on a whole part, and on one row of it.


@dataclass(frozen=True)
class Part:
    """Some neighbouring rows."""

    scenes: range  # their scenes
    # a Parquet file of them
    content: bytes
    counts: OutcomeCounts
    fields: bytes | None = None  # an HDF5 file of their fields; None where the design stores none
    encoding_cpu_s: float = 0.0  # CPU time that it took to encode them, s


def solved_parts(pool: WorkerPool, design: Design, cards: Cards, todo: Iterable[range], *, exact: bool,
                 table: AnyTable | None, identity: str | None = None) -> Iterator[Part]:
    """Solve the scenes of each range into a part of the set of this identity, as workers become free.

    A part that raises, or is lost with its worker again and again, is solved at the end row by row: a row for which
    this is so too is "crashed", with the reason.
    """
    solve = partial(_part, design, identity, partial(solve_rows, design, cards, exact=exact, table=table))
    separation = []
    for scenes, found in answers(pool, solve, todo, _TRIES):
        if isinstance(found, Failed):
            separation.append(scenes)
        else:
            yield found
    for scenes in separation:
        found = dict(answers(pool, solve, [range(i, i + 1) for i in scenes], _ROW_TRIES))
        rows = [_encoded(design, identity, one, [crashed_row(design, cards, one.start, part.reason)])
                if isinstance(part, Failed) else part
                for one, part in sorted(found.items(), key=lambda pair: pair[0].start)]
        kept = None if design.fields is None else hdf5_fields.joined(
            design.fields, flat_scene(design).body, [row.fields for row in rows if row.fields is not None])
        yield Part(scenes, parquet.joined([row.content for row in rows], identity),
                   sum((row.counts for row in rows), OutcomeCounts()), kept, sum(row.encoding_cpu_s for row in rows))


def _part(design: Design, identity: str | None, solve: Callable[[list[int]], list[dict[str, Any]]],
          scenes: range) -> Part:
    return _encoded(design, identity, scenes, solve(list(scenes)))


def _encoded(design: Design, identity: str | None, scenes: range, rows: list[dict[str, Any]]) -> Part:
    begun = time.process_time()
    found = {row["scene"]: row.pop("fields", {}) for row in rows}
    table = pd.DataFrame(rows)
    kept = None if design.fields is None else hdf5_fields.encoded(
        design.fields, flat_scene(design).body, found)
    return Part(scenes, parquet.encoded(table, identity), count_outcomes(table), kept, time.process_time() - begun)
