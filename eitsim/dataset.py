"""A data set of scenes on disk: Parquet parts, each written in one step, beside a manifest `design.json`."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from matcal.card import write_json
from matcal.errors import TestFileError

SCHEMA = 1
MANIFEST = "design.json"
OUTPUTS = ("sigma_max_kPa", "sigma_ave_kPa", "A_c_mm2", "delta_max_mm")
TOUCH = ("x_mm", "y_mm", "d_mm", "F_N")
FIXED = ("scene", "outcome", *TOUCH, *OUTPUTS, "card_sample", "signal_error", "cpu_s")


@dataclass(frozen=True)
class Dataset:
    """Rows of a sweep, sorted by scene."""

    # one row a scene: FIXED, then v_000 ... (touched, V) and dv_000 ... (signal, V), pattern-major
    table: pd.DataFrame
    # the manifest: schema, design, card, versions
    manifest: Mapping[str, Any]

    @property
    def ok(self) -> pd.DataFrame:
        """The rows whose outcome is "ok"."""
        return self.table.loc[self.table["outcome"] == "ok"].reset_index(drop=True)

    @property
    def design(self) -> Mapping[str, Any]:
        """The design that the rows were drawn from, as in its file."""
        return self.manifest["design"]


def voltage_columns(count: int, prefix: str = "v") -> list[str]:
    """Names of `count` reading columns: v_000, v_001 ... (prefix "v" touched, "dv" signal)."""
    return [f"{prefix}_{i:03d}" for i in range(count)]


def write_part(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Write rows (sorted by scene) as one Parquet part, atomically; returns its path."""
    table = pd.DataFrame(sorted(rows, key=lambda row: row["scene"]))
    first, last = int(table["scene"].iloc[0]), int(table["scene"].iloc[-1])
    path = folder / f"part-{first:07d}-{last:07d}.parquet"
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=".part-", suffix=".tmp")
    os.close(handle)
    try:
        table.to_parquet(temporary, index=False)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    return path


def parts(folder: Path) -> list[Path]:
    """Finished parts of a data set, sorted by name."""
    return sorted(folder.glob("part-*.parquet"))


def finished_scenes(folder: Path) -> set[int]:
    """Scene numbers that have a row."""
    return {int(i) for path in parts(folder) for i in pd.read_parquet(path, columns=["scene"])["scene"]}


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest, atomically."""
    write_json({"schema": SCHEMA, **manifest}, folder / MANIFEST)


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a data set; TestFileError where there is none or it is of another schema."""
    path = folder / MANIFEST
    if not path.is_file():
        raise TestFileError(folder, f"not a data set: it holds no {MANIFEST}. A data set is the folder that "
                                    "`eitsim sweep --out` writes.")
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise TestFileError(path, f"not JSON: {error.msg}.", line=error.lineno) from None
    if manifest.get("schema") != SCHEMA:
        raise TestFileError(path, f"data set schema {manifest.get('schema')!r} is not {SCHEMA}. Sweep again.")
    return manifest


def read_dataset(folder: Path | str) -> Dataset:
    """Read a data set; TestFileError where it is none, has no rows, or holds a scene twice."""
    folder = Path(folder)
    manifest = read_manifest(folder)
    files = parts(folder)
    if not files:
        raise TestFileError(folder, "the data set has no rows yet. Run `eitsim sweep` on it.")
    table = pd.concat([pd.read_parquet(path) for path in files], ignore_index=True)
    table = table.sort_values("scene", ignore_index=True)
    _require_columns(folder, table, FIXED)
    if table["scene"].duplicated().any():
        twice = int(table.loc[table["scene"].duplicated(), "scene"].iloc[0])
        raise TestFileError(folder, f"scene {twice} stands in it twice. Remove the part that does not belong to it.")
    return Dataset(table, manifest)


def _require_columns(folder: Path, table: pd.DataFrame, names: Iterable[str]) -> None:
    if missing := [name for name in names if name not in table.columns]:
        raise TestFileError(folder, f"the column {missing[0]} is missing from its Parquet parts.")
