"""A CSV table of scenes as a design: one row a scene, a column a key, the other keys from a scene file."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from eitsim.scene.scene import LISTS, check_value, scene_from, scene_keys
from eitsim.scene.scene_files import with_files
from eitsim.sweeps.design.design import Design, design_from, read_design, with_scenes
from eitsim.sweeps.design.sampling import row_tables
from eitsim.sweeps.design.variables import SENSOR, layout_of
from eitsim.sweeps.run.row_columns import OWN, key_column, numbered
from touchcal.csv_numbers import csv_rows
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml

MOST_TOUCHES = 20  # Touches that a table may have columns for.
# What a scene file may hold for the sake of a design.
_OF_DESIGNS = ("seed", "material", "measurement", "fields")
_RIVALS = {"force_N": "depth_mm", "depth_mm": "force_N"}

Where = tuple[str, int, str]  # table, touch from 0, key


@dataclass(frozen=True)
class _Cells:
    """A table's cells."""

    columns: Mapping[str, Where]  # column -> where its values belong
    rows: tuple[Mapping[Where, Any], ...]  # one a scene: where -> value; empty cells are not there
    lines: tuple[int, ...]  # line of each row in the file, from 1


def as_design(design: Design | Path | str, scenes: int | None = None, scene: Path | str | None = None) -> Design:
    """A design itself, or that of a file (TOML) or of a table of scenes (CSV) with its scene file, with so many scenes;
    ValueError or InputFileError where they make none."""
    table = not isinstance(design, Design) and Path(design).suffix == ".csv"
    if scene is not None and not table:
        what = "the design" if isinstance(design, Design) else design
        raise ValueError(f"--scene goes with a table of scenes (.csv); {what} holds the tables of a scene itself.")
    if isinstance(design, Design):
        return design if scenes is None else with_scenes(design, scenes)
    return read_scene_table(design, scene, scenes) if table else read_design(design, scenes)


def read_scene_table(path: Path | str, base: Path | str | None = None, scenes: int | None = None) -> Design:
    """The design whose scene i is row i of a CSV.

    Columns are x_mm, y_mm, d_mm, F_N, any key of [punch], or table.key; of further touches x_2_mm or punch_2_profile.
    Also as data sets call them (skin_thickness_um). An empty cell is what the scene file `base`, or else its default,
    says; a row without any cell of a further touch has fewer touches. `base` may also hold seed, [material],
    [measurement] and [fields] as designs do. `scenes`: only so many rows. InputFileError names line and column.
    """
    path = Path(path)
    given, more = _base(Path(base)) if base is not None else ({}, {})
    cells = _read(path)
    punches = given.pop("punch", {})
    punches = punches if isinstance(punches, list) else [punches]
    counts = [_touches(path, row, line, len(punches)) for row, line in zip(cells.rows, cells.lines, strict=True)]
    most = max(counts)
    named = given.keys() | {table for table, _, _ in cells.columns.values()}
    tables: dict[str, Any] = {name: dict(given.get(name, {})) for name in sorted(named)}
    tables["punch"] = [{"x_mm": 0.0, "y_mm": 0.0, **punches[min(k, len(punches) - 1)]} for k in range(most)]
    for where in _with_rivals(cells, tables):
        table, k, key = where  # a row's own cell, else what the scene file says, unless the row gives the rival key
        if k < most:
            held = tables["punch"][k] if table == "punch" else tables[table]
            usual, rival = held.get(key), (table, k, _RIVALS.get(key))
            held[key] = {"rows": [row.get(where, None if rival in row else usual) for row in cells.rows]}
    count = len(cells.rows) if scenes is None else scenes
    if not 0 < count <= len(cells.rows):
        raise InputFileError(path, f"it holds {len(cells.rows)} scenes; {count} are asked for.")
    raw = {**tables, **more, **({"touches": {"rows": counts}} if most > 1 else {})}
    return _checked(path, raw, count, cells.lines)


def _base(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The tables of a scene file, and what else it holds for a design."""
    raw = with_files(read_toml(path), path.parent)
    tables = {name: value for name, value in raw.items() if name not in (*_OF_DESIGNS, "card")}
    more = {name: value for name, value in raw.items() if name in _OF_DESIGNS}
    try:
        if len(scene_from(tables).hold.time_s) > 1:
            raise ValueError("time_s in [hold] holds several times, and a row of a table is one scene at one time. "
                             "Give one, or a column hold.time_s.")
        design_from({"scenes": 1, **tables, **more})
    except ValueError as error:
        raise InputFileError(path, str(error)) from None
    return tables, more


def _read(path: Path) -> _Cells:
    found = csv_rows(path, "scenes")
    if len(found) < 2:
        raise InputFileError(path, "it holds no scenes. Expected a header such as x_mm,y_mm,d_mm,F_N and one row a "
                                   "scene.")
    (line, header), *rows = found
    columns = _columns(path, header, line)
    return _Cells(columns, tuple(_row(path, columns, row, line) for line, row in rows), tuple(n for n, _ in rows))


def _columns(path: Path, header: list[str], line: int) -> dict[str, Where]:
    known, columns = _known_columns(), {}
    for name in header:
        if name not in known:
            raise InputFileError(path, f"the column '{name}' is unknown; known: {', '.join(OWN.values())}, a key of "
                                 f"[punch] ({', '.join(scene_keys()['punch'])}), table.key as in skin.thickness_um, "
                                 "and of further touches x_2_mm or punch_2_profile.", line=line)
        table, _, key = known[name]
        if (table, key) in SENSOR:
            raise InputFileError(path, f"the column '{name}' decides which readings a row holds, and those of all rows "
                                 "stand in the same columns. Give it in a scene file (--scene).", line=line)
        if known[name] in columns.values():
            raise InputFileError(path, f"the column '{name}' says again what another one says. Leave one out.",
                                 line=line)
        columns[name] = known[name]
    return columns


def _known_columns() -> dict[str, Where]:
    known: dict[str, Where] = {}
    for table, keys in scene_keys().items():
        for key in keys:
            if key not in LISTS.get(table, ()):  # a cell holds no list
                known[f"{table}.{key}"] = known[key_column(table, key)] = table, 0, key
    for key in scene_keys()["punch"]:
        known[key] = "punch", 0, key
        for k in range(1, MOST_TOUCHES):
            known[key_column("punch", key, k)] = "punch", k, key
    for key, column in {**OWN, "depth_mm": "depth_mm"}.items():
        known |= {numbered(column, k): ("punch", k, key) for k in range(MOST_TOUCHES)}
    return known


def _row(path: Path, columns: Mapping[str, Where], row: list[str], line: int) -> dict[Where, Any]:
    if len(row) != len(columns):
        commas = " A decimal comma parts a cell in two: use points in numbers." if len(row) > len(columns) else ""
        raise InputFileError(path, f"{len(row)} cells, expected {len(columns)} as in the header.{commas}", line=line)
    values = {}
    for (name, where), cell in zip(columns.items(), row, strict=True):
        if cell:
            values[where] = _parsed(cell)
            try:
                check_value(where[0], where[2], values[where])
            except ValueError as error:
                raise InputFileError(path, f"column {name}: {error}", line=line) from None
    return values


def _parsed(cell: str) -> Any:
    if cell.lower() in ("true", "false"):
        return cell.lower() == "true"
    try:
        return float(cell)
    except ValueError:
        return cell


def _touches(path: Path, row: Mapping[Where, Any], line: int, least: int) -> int:
    """The number of touches of a row: those of the scene file, and further ones that have a cell."""
    own = {k for table, k, _ in row if table == "punch" and k >= least}
    if own and (gap := set(range(least, max(own))) - own):
        raise InputFileError(path, f"touch {max(own) + 1} is given and touch {min(gap) + 1} is not. Number the touches "
                                   "of a row without gaps.", line=line)
    return max(own, default=least - 1) + 1


def _with_rivals(cells: _Cells, tables: Mapping[str, Any]) -> list[Where]:
    """Where values vary by row: the columns, and a force or depth of the scene file that some row's cell replaces."""
    found = list(cells.columns.values())
    for table, k, key in cells.columns.values():
        if key in _RIVALS and k < len(tables["punch"]) and _RIVALS[key] in tables["punch"][k]:
            found.append((table, k, _RIVALS[key]))
    return list(dict.fromkeys(found))


def _checked(path: Path, raw: Mapping[str, Any], count: int, lines: tuple[int, ...]) -> Design:
    """The design of a table whose rows are all scenes."""
    layout = layout_of({name: raw[name] for name in scene_keys() if name in raw}, raw.get("touches"))
    for index in range(count):
        try:
            scene_from(row_tables(layout, "random", count, 0, index))
        except ValueError as error:
            raise InputFileError(path, str(error), line=lines[index]) from None
    source = {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
    try:
        return replace(design_from(raw, count), source=source)
    except ValueError as error:
        raise InputFileError(path, str(error)) from None
