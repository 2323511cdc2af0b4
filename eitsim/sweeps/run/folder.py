"""The folder of a sweep: started or continued by one writer at a time, and only as it was started."""

from __future__ import annotations

import errno
import fcntl
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.mechanics.load_paths.types import Table
from eitsim.sweeps.dataset import parquet
from eitsim.sweeps.dataset.code_history import by_this_code, check_columns
from eitsim.sweeps.dataset.outcome_counts import OutcomeCounts, count_outcomes
from eitsim.sweeps.design.card_draws import Cards
from eitsim.sweeps.design.design import GROWING, Design, same_or_grown
from eitsim.sweeps.run.load_path_choice import AnyTable
from matcal.card import MaterialCard, cards_identity
from touchcal.cache import key_of
from touchcal.errors import InputFileError
from touchcal.json_file import digest
from touchcal.provenance import versions
from touchcal.whole_file import lock_file

ROWS = "rows"  # Key of the manifest: how many rows stood there when the last call ended.


@contextmanager
def sole_writer(folder: Path, writer: str = "sweep") -> Iterator[None]:
    """Hold a folder for one writer, and remove what one that was killed left half written; ValueError where another
    of its kind holds it.

    A file system without locks cannot tell: then nothing is removed, and of two writers of one sweep each puts the
    same rows there, in place of those of the other.
    """
    with lock_file(folder / ".lock") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                raise ValueError(f"{folder}: another {writer} is writing to it. Wait for it, or choose another folder."
                                 ) from None
        else:
            for pattern in (".part-*", f".{parquet.MANIFEST}*.part", f"{parquet.MANIFEST}*.part"):
                for path in folder.glob(pattern):
                    path.unlink()
        yield


def check_own(folder: Path) -> None:
    """InputFileError, before anything is written, where a folder holds something that is no data set."""
    if (folder / parquet.MANIFEST).exists():
        parquet.read_manifest(folder)
        return
    for path in sorted(folder.iterdir()) if folder.exists() else []:
        if not (path.name.startswith(".") or path.name.startswith(parquet.MANIFEST)):
            what = "Parquet parts" if path.name.startswith("part-") else path.name
            raise InputFileError(folder, f"it holds {what} but no {parquet.MANIFEST}. Choose an empty folder.")


def begun(folder: Path, manifest: Mapping[str, Any]) -> dict[str, Any] | None:
    """The manifest that stands in a folder; None, and `manifest` is put there, where there is none."""
    if (folder / parquet.MANIFEST).exists():
        return parquet.read_manifest(folder)
    parquet.write_manifest(folder, manifest)
    return None


def start_or_continue(folder: Path, design: Design, cards: Cards, method: Mapping[str, Any],
                      rows_per_part: int, reuse: bool | None, columns: Sequence[str],
                      other_code: bool) -> tuple[Mapping[str, Any], Standing]:
    """Write the manifest or check the one that stands there, and the rows; returns it, with how touches are solved and
    the size of parts as the folder was started, and what stands there."""
    plain = json.loads(json.dumps(asdict(design)))  # a design as JSON holds it
    base = design.tables.get("skin", {}).get("base_card", "")
    manifest = {"design": plain, "card": cards_identity(cards.card, base), "versions": versions(),
                "method": method, "rows_per_part": rows_per_part, "code": key_of({}), "posterior": dict(cards.source)}
    manifest[parquet.IDENTITY] = digest({"design": without_folders(plain)} | {
        key: manifest[key] for key in ("card", "method", "posterior")})
    manifest |= _relaxation(design, cards.card)
    if (stands := begun(folder, manifest)) is None:
        return manifest, standing(folder, design.scenes, manifest)
    old = {"posterior": {}, **stands}
    if old["schema"] != parquet.SCHEMA:
        raise ValueError(f"{folder} was written by an earlier version, in parts of another kind. It can be read, not "
                         "continued; choose another folder.")
    if "clean" in old:
        raise ValueError(f"{folder} holds measured rows, not a sweep's own. Choose another folder.")
    parquet.check_manifest(folder, old, parquet.CONTINUED)
    if old["card"]["sha256"] != manifest["card"]["sha256"]:
        raise ValueError(f"{folder} was made with the card '{old['card']['name']}' ({old['card']['sha256'][:12]}), not "
                         f"with this one ({manifest['card']['sha256'][:12]}). Choose another folder for this card.")
    _check_same_design(folder, {"material": None, "touches": None, "fields": None, **old["design"]}, manifest["design"])
    if old["posterior"].get("sha256") != manifest["posterior"].get("sha256"):
        raise ValueError(f"{folder} was made with another posterior of this card ({old['posterior']['sha256'][:12]}, "
                         f"here {manifest['posterior']['sha256'][:12]}). Choose another folder for this one.")
    for key, requested in (("exact", method["exact"]), ("reuse", reuse)):
        if requested not in (None, old["method"][key]):
            raise ValueError(f"{folder} was started with {key} = {old['method'][key]}, here {requested}. Keep to that, "
                             "or choose another folder.")
    before, continued = standing(folder, design.scenes, old), {**old, "design": manifest["design"]}
    if not before.there.all():
        check_columns(folder, columns)
        continued = by_this_code(folder, continued, manifest, before.there, other_code)
    if continued != old:
        parquet.write_manifest(folder, continued)
    return continued, before


def _relaxation(design: Design, card: MaterialCard) -> dict[str, Any]:
    """The card's Prony series and the moduli by which touches are pressed; empty without one, or where touches are
    held."""
    hold = {"time_s": (), "moduli": "card", **design.tables.get("hold", {})}
    if card.prony is None or card.law is None or hold["time_s"]:
        return {}
    moduli = card.law.moduli if hold["moduli"] == "card" else hold["moduli"]
    return {parquet.RELAXATION: {"g": card.prony.g.tolist(), "tau_s": card.prony.tau_s.tolist(), "moduli": moduli}}


def without_folders(design: Mapping[str, Any]) -> dict[str, Any]:
    """A design without the folder of the base's card, whose content the card's hash has."""
    tables = design["tables"]
    if not (base := tables.get("skin", {}).get("base_card")):
        return dict(design)
    return {**design, "tables": {**tables, "skin": {**tables["skin"], "base_card": Path(base).name}}}


def _check_same_design(folder: Path, old: Mapping[str, Any], new: Mapping[str, Any]) -> None:
    old, new = without_folders(old), without_folders(new)
    for key in ("seed", "sampler", "tables", "touches", "material", "fields"):
        if same_or_grown(old[key], new[key]):
            continue
        if new["source"] is not None and key in ("tables", "touches"):
            raise ValueError(f"{folder} was made with another table of scenes: rows or columns that stood in it are "
                             f"changed or gone. Add rows to the end of {new['source']['file']} alone, or choose "
                             "another folder.")
        raise ValueError(f"{folder} was made with another design: its {_differing(key, old[key], new[key])}. "
                         "Choose another folder for this design.")
    if new["scenes"] < old["scenes"]:
        raise ValueError(f"{folder} holds a design of {old['scenes']} scenes; {new['scenes']} would drop some. Ask for "
                         f"{old['scenes']} or more.")
    if new["scenes"] != old["scenes"] and new["sampler"] not in GROWING:
        raise ValueError(f"{folder}: sampler \"{new['sampler']}\" fixes the count at {old['scenes']}. Only "
                         f"{' and '.join(GROWING)} may grow.")


def _differing(name: str, old: Any, new: Any) -> str:
    """The first key that differs between two values of a design's key, and both of its values."""
    if name == "tables":
        table = _first_other(old, new)
        return _differing(table, old.get(table), new.get(table))
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new) and name == "punch":
        k = next(k for k, pair in enumerate(zip(old, new, strict=True)) if not same_or_grown(*pair))
        return _differing(f"punch {k + 1}", old[k], new[k])
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        key = _first_other(old, new)
        return f"{key} in [{name}] {_both(old.get(key), new.get(key))}"
    return f"{name} {_both(old, new)}"


def _first_other(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    return next(key for key in {**old, **new}
                if key not in old or key not in new or not same_or_grown(old[key], new[key]))


def _both(old: Any, new: Any) -> str:
    before, here = ("not given" if value is None else json.dumps(value)[:100] for value in (old, new))
    return f"is {before}, here {here}"


@dataclass(frozen=True, eq=False)
class Standing:
    """Rows that are there and stay."""

    there: NDArray[np.bool_]  # (scenes,) whether a scene has one
    counts: OutcomeCounts  # what became of them
    crashed: int  # rows "crashed", which are as if not there: too little memory, or a kill, may not come again
    lost: int  # rows that stood there when the last call ended, and are gone


def standing(folder: Path, scenes: int, manifest: Mapping[str, Any]) -> Standing:
    """What a folder holds of the sweep of this manifest; InputFileError where a part is damaged or does not belong to
    such a sweep."""
    there, counts, crashed, rows_per_part = np.zeros(scenes, dtype=bool), OutcomeCounts(), 0, manifest["rows_per_part"]
    for path in parquet.parts(folder):
        table = parquet.read_part(path, of={**manifest, "design": {"scenes": scenes}})
        first, count = int(table["scene"].iloc[0]), len(table)
        whole = list(range(first, first + count)) == table["scene"].tolist() and count <= rows_per_part
        if path != parquet.part_path(folder, first) or first % rows_per_part or first + count > scenes or not whole:
            raise InputFileError(path, "the part does not belong to this sweep. Remove it, and sweep again.")
        stays = (table["outcome"] != "crashed").to_numpy()
        there[first:first + count] = stays
        counts, crashed = counts + count_outcomes(table.loc[stays]), crashed + int((~stays).sum())
    return Standing(there, counts, crashed, max(manifest.get(ROWS, 0) - counts.rows - crashed, 0))


def missing(there: NDArray[np.bool_], rows_per_part: int) -> list[range]:
    """Neighbouring scenes that have no row, where `there` tells of each whether it has one; none across two parts."""
    out = []
    for first in range(0, len(there), rows_per_part):
        scenes = first + np.flatnonzero(~there[first:first + rows_per_part])
        runs = np.split(scenes, np.flatnonzero(np.diff(scenes) > 1) + 1)
        out += [range(int(run[0]), int(run[-1]) + 1) for run in runs if run.size]
    return out


def keep_to_table(folder: Path, manifest: Mapping[str, Any], table: AnyTable | None,
                  note: str) -> Mapping[str, Any]:
    """Write to the manifest what came of the table of load paths that touches are to be taken from, so that rows to
    come are solved as these; returns it. ValueError where rows were solved with more than what came of it now."""
    method, central = manifest["method"], table
    came = {"used": central is not None, "rim": isinstance(central, Table) and central.rim is not None}
    if (before := method.get("table")) is None:
        less = not came["used"] or came["rim"] != method["rim"]
        manifest = {**manifest, "method": {**method, "table": came | {"note": note if less else ""}}}
        parquet.write_manifest(folder, manifest)
    elif any(before[key] != value for key, value in came.items()):
        raise ValueError(f"{folder}: the table of load paths that its rows were made with is not had again ({note}). "
                         "Choose another folder, or go on with the code that made them.")
    return manifest
