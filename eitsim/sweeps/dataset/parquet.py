"""A data set of scenes on disk: Parquet parts, each written in one step, with a manifest `design.json`.

A part holds neighbouring scenes and is named by the first; a sweep's parts have a size that its manifest keeps.
"""

import contextlib
import hashlib
import io
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from eitsim.scene.scene import scene_keys
from eitsim.sweeps.dataset.sweep_record import Account, Run
from touchcal.document import Keys, Number, check
from touchcal.errors import InputFileError
from touchcal.input_file import check_unpacked, regular
from touchcal.json_file import read_json, write_json
from touchcal.whole_file import written

SCHEMA = 2
# Older ones that can be read: in 1 parts were named by their last scene too.
_READABLE = (1, SCHEMA)
MANIFEST = "design.json"
# Folder, in that of a set, of the set of its first touches by punches of other profiles.
OTHER_PROFILES = "other_profiles"
# Key of the manifest, and of what each part says of itself: a hash that only one sweep or measurement has. Sets that
# were made earlier have none.
IDENTITY = "identity"
_STAMP = b"touchcal"  # Key of a part's Parquet metadata: JSON of IDENTITY and of the hash of its rows.
# What follows of a touch; sets that were made before one of these was computed lack its column.
OUTPUTS = ("sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2", "delta_max_mm")
TOUCH = ("x_mm", "y_mm", "d_mm", "F_N")
# What differs where a row is solved again: CPU time in all, and of it for touches, for readings and for fields, s.
COST = ("cpu_s", "mechanics_cpu_s", "electrics_cpu_s", "fields_cpu_s")
# How touches and readings of a row were solved, in words.
METHODS = ("mechanics_method", "electrics_method")
# Share of a row's signal that comes from skin strained outside the fitted range; rows of earlier sets have none.
EXTRAPOLATED = "signal_share_extrapolated"
FIXED = ("scene", "outcome", *TOUCH, *OUTPUTS, "card_sample", "signal_error", "cpu_s")

RELAXATION = "relaxation"  # key of the manifest: the card's Prony series, and the moduli by which touches are pressed
_COUNT, _OBJECT = Number(0, 1e15, whole=True), (dict, None)
_METHOD = Keys(allowed={"exact": bool, "reuse": (bool, None), "rim": bool, "reason": str,
                        "table": Keys({"used": bool, "rim": bool, "note": str})})
_TABLES = Keys(allowed={**dict.fromkeys(scene_keys(), dict), "punch": (dict, [dict])})
# What a manifest must hold to be read.
_SHAPE = Keys({"schema": _COUNT, "design": Keys({"scenes": Number(1, 1e15, whole=True), "tables": _TABLES}, {
    "seed": _COUNT, "sampler": str, "material": _OBJECT, "measurement": _OBJECT, "fields": _OBJECT,
    "source": _OBJECT})}, {
    "card": (Keys(allowed={"name": str, "sha256": str, "file": (str, None), "synthetic": bool}), None),
    "versions": {str: str}, "method": _METHOD, "rows_per_part": Number(1, 1e9, whole=True), "code": str,
    "posterior": Keys(allowed={"sha256": str}), "left_out": [dict],
    RELAXATION: Keys({"g": [Number(0, 1)], "tau_s": [Number(0)], "moduli": str}),
    "runs": [Keys({each.name: (Number(), str, None) for each in fields(Run)}, further=False)],
    "clean": Keys(allowed={"folder": str, "sha256": str}), "measured": dict, "measured_by": str})
# What it must hold in addition for a sweep to go on.
CONTINUED = Keys({"design": Keys(dict.fromkeys(("seed", "sampler"), object)),
                  "card": Keys(dict.fromkeys(("name", "sha256"), object)),
                  "method": Keys(dict.fromkeys(("exact", "reuse", "rim"), object)),
                  **dict.fromkeys(("versions", "rows_per_part", "code"), object)})


@dataclass(frozen=True, eq=False)
class Dataset:
    """A data set of scenes on disk, whose rows are read when they are first asked for."""

    folder: Path  # where it lies
    manifest: Mapping[str, Any]  # the manifest: schema, design, card, versions
    columns: Sequence[str] | None = None  # columns that `table` has next to FIXED; None: all that are stored
    account: Account | None = None  # what the call of `sweep` did that returned the set; None of one that was opened

    @cached_property
    def table(self) -> pd.DataFrame:
        """One row a scene, sorted by scene: FIXED, then v_000 ... (touched, V) and dv_000 ... (signal, V),
        pattern-major. InputFileError where a part is damaged, lacks a column, or holds a scene that stands in another.
        """
        names = None if self.columns is None else [*dict.fromkeys([*FIXED, *self.columns])]
        found = [read_part(path, names, self.manifest) for path in parts(self.folder)]
        table = pd.concat(found, ignore_index=True).sort_values("scene", ignore_index=True)
        if missing := [name for name in FIXED if name not in (*table.columns, *OUTPUTS)]:
            raise InputFileError(self.folder, f"the column {missing[0]} is missing from its Parquet parts.")
        if table["scene"].duplicated().any():
            twice = int(table.loc[table["scene"].duplicated(), "scene"].iloc[0])
            raise InputFileError(self.folder, f"scene {twice} stands in it twice. Remove the part that does not belong "
                                              "to it.")
        return table

    @property
    def ok(self) -> pd.DataFrame:
        """The rows whose outcome is "ok"."""
        return self.table.loc[self.table["outcome"] == "ok"].reset_index(drop=True)

    @property
    def design(self) -> Mapping[str, Any]:
        """The design that the rows were drawn from, as in its file."""
        return self.manifest["design"]


def write_part(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write rows (sorted by scene) as one Parquet part, atomically; returns its path."""
    table = pd.DataFrame(sorted(rows, key=lambda row: row["scene"]))
    path = part_path(folder, int(table["scene"].iloc[0]))
    write_table(path, table)
    return path


def part_path(folder: Path, first: int) -> Path:
    """Where the part lies that begins with the scene `first`."""
    return folder / f"part-{first:09d}.parquet"


def write_table(path: Path, table: pd.DataFrame, identity: str | None = None) -> None:
    """Write a table as one Parquet file, atomically."""
    put(path, encoded(table, identity))


def encoded(table: pd.DataFrame, identity: str | None = None) -> bytes:
    """A table as the content of a Parquet file, with checksums, the hash of its rows, and the set that they belong to.

    Without dictionaries, and without statistics and the frame's own schema, which for columns of few different rows
    would take more than the numbers.
    """
    place = io.BytesIO()
    plain = pa.Table.from_pandas(table, preserve_index=False).replace_schema_metadata(None)
    stated = [name for name in ("scene", "outcome") if name in table.columns]
    with pq.ParquetWriter(place, plain.schema, use_dictionary=False, store_schema=False, write_page_checksum=True,
                          write_statistics=stated) as file:  # pyright: ignore[reportArgumentType]
        file.write_table(plain)
        file.add_key_value_metadata({_STAMP.decode(): json.dumps({IDENTITY: identity, "sha256": _hash(plain)})})
    return place.getvalue()


def decoded(content: bytes | Path) -> pd.DataFrame:
    """The table of a Parquet file or of its content; OSError where its checksums do not hold."""
    source = pa.BufferReader(content) if isinstance(content, bytes) else content
    return pq.ParquetFile(source, page_checksum_verification=True).read().to_pandas()


def read_part(path: Path, columns: list[str] | None = None, of: Mapping[str, Any] | None = None) -> pd.DataFrame:
    """The table of a part, of some columns or, checked by its hash, of all; InputFileError where it is damaged, was
    changed, or does not belong to the set of the manifest `of`."""
    try:
        file = pq.ParquetFile(regular(path), page_checksum_verification=True)
        check_unpacked(path, 8 * file.metadata.num_rows * file.metadata.num_columns)
        whole, stamp = file.read(columns=columns), json.loads((file.metadata.metadata or {}).get(_STAMP, b"{}"))
    except (pa.ArrowException, OSError, ValueError) as error:
        raise error if isinstance(error, InputFileError) else _damaged(path, str(error).splitlines()[0]) from None
    if columns is None and "sha256" in stamp and stamp["sha256"] != _hash(whole):
        raise _damaged(path, "its rows are not those that were written")
    for name in ("scene", "outcome"):
        if (columns is None or name in columns) and (name not in whole.column_names or whole[name].null_count):
            raise _damaged(path, f"not every row has its {name}")
    if not whole.num_rows:
        raise _damaged(path, "it holds no rows")
    table = whole.to_pandas()
    if of is not None and not (stamp.get(IDENTITY) == of.get(IDENTITY) and _in_place(path, table, of)):
        raise InputFileError(path, f"the part does not belong to this sweep, the one of {MANIFEST} next to it. Remove "
                                   "it, and sweep again.")
    if columns is None and "sha256" not in stamp:
        _check_readings(path, table)
    return table


def _in_place(path: Path, table: pd.DataFrame, manifest: Mapping[str, Any]) -> bool:
    """Whether a part's name tells its first scene, and all of them are scenes of the design."""
    first, last, number = table["scene"].iloc[0], table["scene"].max(), path.stem.split("-")[1]
    return (pd.api.types.is_integer_dtype(table["scene"]) and number.isdecimal() and int(number) == first
            and bool(last < manifest["design"].get("scenes", np.inf)))


def _check_readings(path: Path, table: pd.DataFrame) -> None:
    """InputFileError where an ok row lacks a reading whose signal it has; parts without a hash are checked by this."""
    lost = table.loc[table["outcome"] == "ok"].isna()
    for name in [name for name in lost if name.startswith("v_") and f"d{name}" in lost]:
        if (odd := lost[name] & ~lost[f"d{name}"]).any():
            raise _damaged(path, f"{name} of scene {table['scene'][odd.idxmax()]} is missing, though the row says ok")


def columns_of(path: Path) -> list[str]:
    """Names of the columns of a part, without its rows."""
    try:
        return pq.read_schema(regular(path)).names
    except (pa.ArrowException, OSError) as error:
        raise _damaged(path, str(error).splitlines()[0]) from None


def _damaged(path: Path, why: str) -> InputFileError:
    return InputFileError(path, f"the part is damaged ({why}). Remove it, and sweep again.")


def _hash(table: pa.Table) -> str:
    """SHA-256 of the names, types and values of a table's columns, NaN as missing."""
    found = hashlib.sha256()
    for name in table.column_names:
        values = table[name].to_numpy()
        text = values.tobytes() if values.dtype != object else json.dumps(values.tolist(), default=str).encode()
        found.update(f"{name} {values.dtype} {len(values)} ".encode() + text)
    return found.hexdigest()


def missing_rows(folder: Path) -> str:
    """How many scenes of a set's design lack a row, in words; empty where none does."""
    rows = sum(pq.read_metadata(path).num_rows for path in parts(folder))
    scenes = read_manifest(folder)["design"].get("scenes", rows)
    return (f"{scenes - rows} of its {scenes} scenes have no row: the sweep is unfinished, or parts were lost. The "
            "same `eitsim sweep` command solves them") if rows < scenes else ""


def joined(contents: Sequence[bytes], identity: str | None = None) -> bytes:
    """One part of several contents, in their order."""
    return encoded(pd.concat([decoded(content) for content in contents], ignore_index=True), identity)


def with_rows(content: bytes, more: bytes, identity: str | None = None) -> bytes:
    """A part with the rows of another, which take the place of those of the same scenes."""
    there, new = decoded(content), decoded(more)
    kept = there.loc[~there["scene"].isin(new["scene"])]
    if kept.empty:
        return more
    return encoded(pd.concat([kept, new], ignore_index=True).sort_values("scene", ignore_index=True), identity)


def put(path: Path, content: bytes) -> None:
    """Write a file next to its place, wait for the disk, and move it there in one step: what is there is whole, even
    after a loss of power, which may cost the last moves unless `settle` was waited for."""
    with written(path) as file:
        file.write(content)


def settle(folder: Path) -> None:
    """Wait until the disk knows what was moved into a folder, where the file system can tell."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):
            os.fsync(handle)
    finally:
        os.close(handle)


def parts(folder: Path) -> list[Path]:
    """Finished parts of a data set, sorted by name."""
    return sorted(folder.glob("part-*.parquet"))


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest, atomically."""
    write_json({"schema": SCHEMA, **manifest}, folder / MANIFEST)


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a data set; InputFileError where there is none, or it is of another schema or shape."""
    path = folder / MANIFEST
    if not path.exists():
        raise InputFileError(folder, f"not a data set: it holds no {MANIFEST}. A data set is the folder that "
                                     "`eitsim sweep --out` writes.")
    manifest = read_json(path, "the manifest of a data set", "It was changed or cut short: restore it from a copy, or "
                         "sweep again into another folder.", Keys({"schema": object}))
    if manifest.get("schema") not in _READABLE:
        raise InputFileError(path, f"data set schema {manifest.get('schema')!r} is none of "
                                   f"{', '.join(map(str, _READABLE))}. Sweep again.")
    check_manifest(folder, manifest)
    return manifest


def check_manifest(folder: Path, manifest: Mapping[str, Any], shape: Keys = _SHAPE) -> None:
    """InputFileError where a manifest read from a folder has not the shape that is needed."""
    try:
        check(manifest, shape)
    except ValueError as error:
        raise InputFileError(folder / MANIFEST, f"{error} Restore it from a copy, or sweep again into another folder."
                             ) from None


def open_dataset(folder: Path | str, columns: Sequence[str] | None = None) -> Dataset:
    """Open a data set that `sweep` or `measure` wrote; its rows are read when they are first asked for.

    Parameters
    ----------
    folder
        Where it lies.
    columns
        Read of its columns only FIXED and those of these that it has.

    Returns
    -------
    Dataset
        `table` and `ok` are pandas tables of one row a scene, units in the names of the columns.

    Raises
    ------
    InputFileError
        Where the folder is no data set or has no rows.

    Examples
    --------
    >>> import eitsim
    >>> eitsim.open_dataset("nowhere")
    Traceback (most recent call last):
    touchcal.errors.InputFileError: nowhere: not a data set: it holds no design.json. A data set is the folder that \
`eitsim sweep --out` writes.
    """
    if isinstance(columns, str):
        raise ValueError(f"columns must be a list of names, got '{columns}'; write [\"{columns}\"].")
    folder = Path(folder)
    manifest = read_manifest(folder)
    if not parts(folder):
        raise InputFileError(folder, "the data set has no rows yet. Run `eitsim sweep` on it.")
    return Dataset(folder, manifest, columns)


def read_dataset(folder: Path | str, columns: Sequence[str] | None = None) -> Dataset:
    """open_dataset, with the rows read at once, so that damage shows."""
    data = open_dataset(folder, columns)
    _ = data.table
    return data
