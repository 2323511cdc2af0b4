"""Many scenes into a data set, on one or several processes; a sweep that was stopped goes on where it was."""

from __future__ import annotations

import fcntl
import multiprocessing
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eitsim import dataset
from eitsim.design import Design, scene_at
from eitsim.drive import read_electrodes
from eitsim.plan import law_of
from eitsim.provenance import card_identity, versions
from eitsim.results import Result
from eitsim.scene import Scene
from eitsim.simulate import mechanical, simulate
from matcal.card import MaterialCard, read_card, require
from matcal.errors import TestFileError

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


def sweep(design: Design, card_path: Path, folder: Path, *, workers: int = 1) -> Iterator[int | Account]:
    """Solve every scene of `design` that `folder` lacks; yields the rows done after each part, then the Account.

    Rows depend on the design and the card only, not on the order or the number of workers. ValueError where the
    folder belongs to another design or card, or another sweep is writing to it.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}.")
    card = read_card(card_path)
    _check_card(card, design)
    folder.mkdir(parents=True, exist_ok=True)
    with _sole_writer(folder):
        _start_or_continue(folder, design, card, card_path)
        kept = dataset.finished_scenes(folder)
        missing = [i for i in range(design.scenes) if i not in kept]
        done = len(kept & set(range(design.scenes)))
        for rows in _solved(design, card, missing, workers):
            dataset.write_part(folder, rows)
            done += len(rows)
            yield done
    table = dataset.read_dataset(folder).table
    failed = table[table["outcome"] != "ok"].groupby("outcome")["message"].first()
    yield Account(dict(Counter(table["outcome"])), {str(k): str(v) for k, v in failed.items()}, len(missing), len(kept))


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


def _start_or_continue(folder: Path, design: Design, card: MaterialCard, card_path: Path) -> None:
    manifest = {"design": asdict(design), "card": card_identity(card, card_path), "versions": versions()}
    if not (folder / dataset.MANIFEST).exists():
        if dataset.parts(folder):
            raise TestFileError(folder, f"it holds Parquet parts but no {dataset.MANIFEST}. Choose an empty folder.")
        dataset.write_manifest(folder, manifest)
        return
    old = dataset.read_manifest(folder)
    if old["card"]["sha256"] != manifest["card"]["sha256"]:
        raise ValueError(f"{folder} was made with the card '{old['card']['name']}' ({old['card']['sha256'][:12]}), not "
                         f"with this one ({manifest['card']['sha256'][:12]}). Choose another folder for this card.")
    _check_same_design(folder, old["design"], manifest["design"])
    dataset.write_manifest(folder, {**old, "design": manifest["design"], "schema": dataset.SCHEMA})


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


def _solved(design: Design, card: MaterialCard, missing: list[int], workers: int) -> Iterator[list[dict[str, Any]]]:
    chunks = [missing[i:i + CHUNK] for i in range(0, len(missing), CHUNK)]
    if workers == 1 or len(chunks) < 2:
        for chunk in chunks:
            yield solve_rows(design, card, chunk)
        return
    for name in THREAD_VARIABLES:
        os.environ.setdefault(name, "1")
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        futures = [pool.submit(solve_rows, design, card, chunk) for chunk in chunks]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def solve_rows(design: Design, card: MaterialCard, indices: list[int]) -> list[dict[str, Any]]:
    """Rows of these scenes; a scene that fails is a row with its outcome."""
    first = scene_at(design, 0)
    blank = _blank(read_electrodes(first.drive, first.electrodes.count).size)
    return [blank | {"scene": index} | _row(design, card, index) for index in indices]


def _row(design: Design, card: MaterialCard, index: int) -> dict[str, Any]:
    keys: dict[str, Any] = {}
    try:
        scene = scene_at(design, index)
        keys = _touch_keys(scene)
        result = simulate(scene, card)
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
