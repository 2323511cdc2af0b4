"""Many scenes into a data set, on one or several processes; a sweep that was stopped goes on where it was."""

from __future__ import annotations

import fcntl
import math
import multiprocessing
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eitsim import dataset
from eitsim.design import Design, scene_at
from eitsim.drive import protocol
from eitsim.plan import law_of
from eitsim.provenance import card_identity, versions
from eitsim.results import Result
from eitsim.reuse import design_shape, repays, rim_repays, table_for
from eitsim.scene import Scene
from eitsim.simulate import mechanical, simulate
from eitsim.table import Table
from matcal.card import MaterialCard, read_card, require
from matcal.errors import NotConverged, TestFileError

CHUNK = 8
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


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


def sweep(design: Design, card_path: Path, folder: Path, *, workers: int = 1, reuse: bool | None = None,
          exact: bool = False) -> Iterator[int | Account]:
    """Solve every scene of `design` that `folder` lacks; yields the rows done after each part, then the Account.

    reuse: whether touches come from a table of load paths, by default where that repays its cost; exact: every row as
    simulate(exact=True), without a table. A folder keeps to what it was started with. Rows depend on the design, the
    card and these two only, not on the order or the number of workers. ValueError where the folder belongs to another
    design or card or was started otherwise, where reuse is asked for and the design has no use for a table, or where
    another sweep is writing to it.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}.")
    if exact and reuse:
        raise ValueError("exact solves every touch afresh; leave out reuse.")
    card = read_card(card_path)
    _check_card(card, design)
    folder.mkdir(parents=True, exist_ok=True)
    with _sole_writer(folder):
        method = _start_or_continue(folder, design, card, card_path, _wanted(design, card, reuse, exact), reuse)
        kept = dataset.finished_scenes(folder)
        missing = [i for i in range(design.scenes) if i not in kept]
        done = len(kept & set(range(design.scenes)))
        chunks = [missing[i:i + CHUNK] for i in range(0, len(missing), CHUNK)]
        with _processes(workers if method["reuse"] or len(chunks) > 1 else 1) as pool:
            paths, note = _table(design, card, pool, method) if method["reuse"] and missing else (None, "")
            for rows in _solved(partial(solve_rows, design, card, exact=method["exact"], table=paths), chunks, pool):
                dataset.write_part(folder, rows)
                done += len(rows)
                yield done
    table = dataset.read_dataset(folder).table
    failed = table[table["outcome"] != "ok"].groupby("outcome")["message"].first()
    yield Account(dict(Counter(table["outcome"])), {str(k): str(v) for k, v in failed.items()}, len(missing), len(kept),
                  _told(method, paths, note))


def _wanted(design: Design, card: MaterialCard, reuse: bool | None, exact: bool) -> dict[str, Any]:
    """How a new folder's touches are to be solved, and why."""
    if exact or reuse is False:
        return {"exact": exact, "reuse": False, "rim": False, "reason": "as asked for"}
    try:
        shape = design_shape(design, card)
    except ValueError as error:
        if reuse:
            raise ValueError(f"{error} Leave out --reuse: every touch is then solved afresh.") from None
        return {"exact": False, "reuse": False, "rim": False, "reason": str(error)}
    repaid = repays(design, shape)
    used = bool(reuse or repaid)
    why = ("as asked for" if reuse else "a table of load paths repays its cost" if repaid else
           "a table of load paths costs more than so few touches (--reuse makes one)")
    return {"exact": False, "reuse": used, "rim": used and rim_repays(design, shape), "reason": why}


def _table(design: Design, card: MaterialCard, pool: ProcessPoolExecutor | None,
           method: Mapping[str, Any]) -> tuple[Table | None, str]:
    """The table of a design and a note; none where its paths are not found."""
    run, shape = map if pool is None else pool.map, design_shape(design, card)
    try:
        table, note = table_for(shape, run)
    except NotConverged as error:
        return None, f"no table: {error}"
    if not method["rim"]:
        return table, note
    try:
        return table_for(shape, run, rim=True)
    except NotConverged as error:
        return table, f"no table of what the rim changes: {error}"


def _told(method: Mapping[str, Any], table: Table | None, note: str) -> str:
    if table is None:
        how = "exactly" if method["exact"] else "afresh"
        return f"every touch solved {how}: {note or method['reason']}"
    error, rim = table.error, "those near the rim or beyond the table afresh"
    if table.rim is not None:
        rim = (f"near the rim another {table.rim.error.depth:.1e} and {table.rim.error.signal:.1e}; those beyond the "
               "tables afresh")
    return (f"touches from a table of {len(table.shape.solved)} load paths ({table.whole_cpu_s:.0f} CPU s, once, not "
            f"counted in the rows' cpu_s), at most {error.depth:.1e} off in depth and "
            f"{error.signal:.1e} in signal; {rim}" + (f"; {note}" if note else ""))


def _check_card(card: MaterialCard, design: Design) -> None:
    """Fail before the first row where the card lacks what every row needs."""
    law_of(scene_at(design, 0), card)
    require(card, "conductivity", "the skin")


@contextmanager
def _sole_writer(folder: Path) -> Iterator[None]:
    with open(folder / ".lock", "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise ValueError(f"{folder}: another sweep is writing to it. Wait for it, or choose another folder."
                             ) from None
        yield


def _start_or_continue(folder: Path, design: Design, card: MaterialCard, card_path: Path, method: Mapping[str, Any],
                       reuse: bool | None) -> Mapping[str, Any]:
    """Write the manifest or check the one that stands there; returns how its touches are solved."""
    manifest = {"design": asdict(design), "card": card_identity(card, card_path), "versions": versions(),
                "method": method}
    if not (folder / dataset.MANIFEST).exists():
        if dataset.parts(folder):
            raise TestFileError(folder, f"it holds Parquet parts but no {dataset.MANIFEST}. Choose an empty folder.")
        dataset.write_manifest(folder, manifest)
        return method
    old = {"method": {"exact": False, "reuse": False, "rim": False, "reason": "the folder was started so"},
           **dataset.read_manifest(folder)}
    if old["card"]["sha256"] != manifest["card"]["sha256"]:
        raise ValueError(f"{folder} was made with the card '{old['card']['name']}' ({old['card']['sha256'][:12]}), not "
                         f"with this one ({manifest['card']['sha256'][:12]}). Choose another folder for this card.")
    _check_same_design(folder, old["design"], manifest["design"])
    for key, wanted in (("exact", method["exact"]), ("reuse", reuse)):
        if wanted not in (None, old["method"][key]):
            raise ValueError(f"{folder} was started with {key} = {old['method'][key]}, here {wanted}. Keep to that, or "
                             "choose another folder.")
    dataset.write_manifest(folder, {**old, "design": manifest["design"], "schema": dataset.SCHEMA})
    return old["method"]


def _check_same_design(folder: Path, old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    for key in ("seed", "sampler", "tables"):
        if old[key] != new[key]:
            raise ValueError(f"{folder} was made with another design: its {key} is {old[key]}, here {new[key]}. "
                             "Choose another folder for this design.")
    if new["scenes"] < old["scenes"]:
        raise ValueError(f"{folder} holds a design of {old['scenes']} scenes; {new['scenes']} would drop some. Ask for "
                         f"{old['scenes']} or more.")
    if new["scenes"] != old["scenes"] and new["sampler"] != "random":
        raise ValueError(f"{folder}: sampler \"{new['sampler']}\" fixes the count at {old['scenes']}. Only \"random\" "
                         "may grow.")


@contextmanager
def _processes(workers: int) -> Iterator[ProcessPoolExecutor | None]:
    """Worker processes; None where this one does the work."""
    if workers == 1:
        yield None
        return
    for name in THREAD_VARIABLES:
        os.environ.setdefault(name, "1")
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        try:
            yield pool
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _solved(solve: Callable[[list[int]], list[dict[str, Any]]], chunks: list[list[int]],
            pool: ProcessPoolExecutor | None) -> Iterator[list[dict[str, Any]]]:
    if pool is None:
        yield from map(solve, chunks)
        return
    for future in as_completed([pool.submit(solve, chunk) for chunk in chunks]):
        yield future.result()


def solve_rows(design: Design, card: MaterialCard, indices: list[int], *, exact: bool = False,
               table: Table | None = None) -> list[dict[str, Any]]:
    """Rows of these scenes, solved as by `simulate`; a scene that fails is a row with its outcome."""
    first = scene_at(design, 0)
    blank = _blank(math.prod(protocol(first.drive, first.electrodes.count).shape))
    return [blank | {"scene": index} | _row(design, card, index, exact, table) for index in indices]


def _row(design: Design, card: MaterialCard, index: int, exact: bool, table: Table | None) -> dict[str, Any]:
    keys: dict[str, Any] = {}
    try:
        scene = scene_at(design, index)
        keys = _touch_keys(scene)
        result = simulate(scene, card, exact=exact, table=table)
    except ValueError as error:
        return keys | {"outcome": "refused", "message": str(error)}
    return keys | {"outcome": result.outcome, "message": result.message} | _values(result)


def _blank(readings: int) -> dict[str, Any]:
    """A row without numbers, so that every part has the same columns and types."""
    names = (*dataset.TOUCH, *dataset.OUTPUTS, "wall_contact_mm2", "signal_error", "depth_error", "cpu_s",
             "skin_fraction_extrapolated", *dataset.voltage_columns(readings), *dataset.voltage_columns(readings, "dv"))
    return {"scene": -1, "outcome": "", "message": "", "card_sample": -1} | dict.fromkeys(names, np.nan)


def _touch_keys(scene: Scene) -> dict[str, float]:
    punch = scene.punches[0]
    force = punch.force_N if punch.force_N is not None else np.nan
    return {"x_mm": punch.x_m * 1e3, "y_mm": punch.y_m * 1e3, "d_mm": punch.diameter_m * 1e3, "F_N": force}


def _values(result: Result) -> dict[str, float]:
    if result.readings is None:
        return {"cpu_s": result.cost["cpu_s"]}
    block = mechanical(result.touches[0])
    row = {"F_N": block.pop("force_N"), **block, "signal_error": result.error_estimate["signal"],
           "depth_error": result.error_estimate["depth"], "cpu_s": result.cost["cpu_s"],
           "skin_fraction_extrapolated": result.readings.skin_fraction_extrapolated}
    touched, signal = result.readings.touched_V.ravel(), result.readings.signal_V.ravel()
    row |= dict(zip(dataset.voltage_columns(touched.size), touched.tolist(), strict=True))
    return row | dict(zip(dataset.voltage_columns(signal.size, "dv"), signal.tolist(), strict=True))
