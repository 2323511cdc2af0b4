"""Stages of a long run: commands whose results are kept, and made again only where what they are made from changed."""

import hashlib
import json
import os
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from reports.document.provenance import Source, combined, machine, source
from touchcal.document import Keys, Number
from touchcal.errors import NotConverged
from touchcal.json_file import read_json, write_json
from touchcal.terminal import NOT_CONVERGED

RECORD, BEGUN, LOG = ".stage.json", ".begun.json", ".log"
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
State = Literal["missing", "stale", "current"]


@dataclass(frozen=True)
class Stage:
    """One command of a run and the folder that it fills."""

    name: str
    folder: Path  # where its results lie
    # what follows `python -m`; a place is a Path, of which only the name counts in the key
    command: tuple[str | Path, ...]
    inputs: tuple[Path, ...]  # files and folders that it reads
    code: str  # hash of the code that decides its numbers
    goes_on: bool = False  # whether the command goes on where it was stopped
    extra: tuple[str, ...] = ()  # further arguments that decide no number, such as how many processes share the work


def content(place: Path) -> Source:
    """Name and hash of a file, or of all files of a folder but the hidden ones."""
    if place.is_file():
        return source(place)
    files = [Source(path.relative_to(place).as_posix(), source(path).sha256) for path in sorted(place.rglob("*"))
             if path.is_file() and not path.name.startswith(".")]
    return combined(place.name, files)


def key(stage: Stage) -> str:
    """SHA-256 of what decides a stage's results: its command, the content of its inputs, and its code."""
    words = [part.name if isinstance(part, Path) else part for part in stage.command]
    inputs = [[found.name, found.sha256] for found in map(content, stage.inputs)]
    return hashlib.sha256(json.dumps([words, inputs, stage.code]).encode()).hexdigest()


def state(stage: Stage) -> State:
    """Whether a stage's results are there and made from what lies there now: its key and its files agree."""
    record = read_record(stage.folder)
    if record is None:
        return "missing"
    if not all(place.exists() for place in stage.inputs):
        return "stale"
    same = record["key"] == key(stage) and record["results"] == content(stage.folder).sha256
    return "current" if same else "stale"


def read_record(folder: Path) -> Mapping[str, Any] | None:
    """What a finished stage wrote of itself; None where it is not finished. InputFileError where it cannot be read."""
    path = folder / RECORD
    if not path.is_file():
        return None
    return read_json(path, "what a stage wrote of itself", "Delete it; the stage is then made again.",
                     Keys({"key": str, "results": str}, {"cpu_s": Number(), "wall_s": Number()}))


def made(stage: Stage) -> bool:
    """Make a stage's results unless they are current; whether anything was done. ValueError, or NotConverged where the
    command exits with 3, with the last words of a command that fails."""
    if state(stage) == "current":
        return False
    now = key(stage)
    _prepare(stage, now)
    began, before = time.perf_counter(), _child_cpu_s()
    _run(stage)
    write_json({"name": stage.name, "key": now, "code": stage.code, "results": content(stage.folder).sha256,
                "cpu_s": _child_cpu_s() - before, "wall_s": time.perf_counter() - began, "machine": machine(),
                "date": datetime.now(UTC).date().isoformat()}, stage.folder / RECORD)
    return True


def _prepare(stage: Stage, now: str) -> None:
    """An empty folder, or that of the same stage where its command goes on."""
    begun = stage.folder / BEGUN
    same = begun.is_file() and json.loads(begun.read_text(encoding="utf-8")) == now
    if stage.folder.exists() and not (stage.goes_on and same):
        shutil.rmtree(stage.folder)
    stage.folder.mkdir(parents=True, exist_ok=True)
    (stage.folder / RECORD).unlink(missing_ok=True)
    begun.write_text(json.dumps(now), encoding="utf-8")


def _run(stage: Stage) -> None:
    """Run the command, one thread a process; its words go to the log of the folder."""
    log = stage.folder / LOG
    with log.open("w", encoding="utf-8") as words:
        command = [sys.executable, "-m", *map(str, stage.command), *stage.extra]
        done = subprocess.run(command, stdout=words, stderr=words, env=dict.fromkeys(THREADS, "1") | os.environ)
    if done.returncode:
        last = "".join(log.read_text(encoding="utf-8").splitlines(keepends=True)[-3:]).strip()
        said = (f"stage {stage.name} failed with exit status {done.returncode}: {last} Fix that and start again with "
                f"the same --out; stages that are finished are not made again. All its words: {log}.")
        raise NotConverged(said) if done.returncode == NOT_CONVERGED else ValueError(said)


def _child_cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
