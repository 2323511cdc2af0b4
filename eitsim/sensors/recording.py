"""A recording: frames in time order as a sensor gave them, read from a CSV of one row a frame.

Columns: `index` (whole number) and `time_s`, where there are any; `touch`, which is empty where nothing touches; then
the readings v_000 ..., or of one word of their own (ch1, ch2 ...), in the order of the sensor's protocol, an empty cell
being a dead channel.
"""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.drive import voltage_columns
from eitsim.scene.frames import LEADING, numbered, own_names
from touchcal.arrays import Array, Complex, Mask
from touchcal.csv_numbers import DEAD, csv_lines, finite, is_numeric, without_last_commas
from touchcal.csv_numbers import cells as written_cells
from touchcal.errors import InputFileError
from touchcal.whole_file import written

# What a reading is: a signed voltage, its size alone, or a touched voltage less the untouched one.
KINDS = ("voltage", "magnitude", "difference")
_READING = "v_"  # what the names of the readings begin with
_DEAD = "leave the cell empty where it is dead"


@dataclass(frozen=True, eq=False)
class Recording:
    """Frames of one sensor in time order."""

    readings: Array | Complex  # (frames, m) volts, or the counts of the board; NaN where a channel is dead
    index: NDArray[np.int64]  # (frames,) number of each frame in time; where the file has none, its row from 0
    time_s: Array | None  # (frames,) s; None where the file has no clock
    touch: NDArray[np.str_]  # (frames,) name of the touch, "" where nothing touches
    kind: str  # one of KINDS
    source: Path  # file that it was read from
    pairs: NDArray[np.intp] | None = None  # (m, 4) source, sink, plus and minus of each, where the file states them
    columns: tuple[str, ...] = ()  # (m,) names of the readings, where the file has others than v_000 ...

    @property
    def untouched(self) -> Mask:
        """(frames,) which frames are untouched; none of differences, which have no such frame."""
        return (self.touch == "") & (self.kind != "difference")


def read_recording(path: Path | str, *, kind: str = "voltage", readings: int | None = None) -> Recording:
    """Read a CSV of frames of one kind, each of `readings` numbers where that is given.

    A file without a header holds readings alone. InputFileError names the line and the column: a name that is no
    column of a recording, readings out of order, another number of them, a cell that is no finite number, an index or
    a time that goes back. ValueError for another kind.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import eitsim
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "frames.csv"
    ...     _ = path.write_text("touch,v_000,v_001\\n,0.1,0.2\\na,0.1,0.3\\n")
    ...     recording = eitsim.read_recording(path)
    >>> recording.readings.shape, recording.touch.tolist()
    ((2, 2), ['', 'a'])
    """
    check_kind(kind, "kind")
    path = Path(path)
    rows = _rows(path, readings)
    names = numbered(rows[0][1]) if not is_numeric(rows[0][1][0]) else []
    leading = _leading(path, rows[0][0], names)
    body = rows[1:] if names else rows
    if not body:
        raise InputFileError(path, "a header without frames; give one row a frame below it.")
    width = len(body[0][1]) - len(leading)
    if readings is not None and width != readings:
        raise InputFileError(path, f"{width} readings a frame, and the model or the sensor's drive has {readings}. "
                                   "Give a recording of that sensor, or correct [drive].",
                             line=body[0][0])
    columns = {name: _column(path, body, place, name) for place, name in enumerate(leading) if name != "touch"}
    touch = ([touch_name(cells[leading.index("touch")]) for _, cells in body] if "touch" in leading
             else [""] * len(body))
    number = columns.get("index", np.arange(len(body), dtype=float))
    if odd := [row for row, value in zip(body, number, strict=True) if value % 1]:
        raise InputFileError(path, "index must hold whole numbers; call it time_s where it is a time.", line=odd[0][0])
    return Recording(_readings(path, body, len(leading)), number.astype(np.int64), columns.get("time_s"),
                     np.array(touch, dtype=np.str_), kind, path,
                     columns=own_names(rows[0][1][len(leading):]) if names else ())


def write_recording(recording: Recording, path: Path | str) -> None:
    """Write a recording of real readings as a CSV that `read_recording` reads, in one step."""
    readings = np.real(recording.readings)
    clock = {} if recording.time_s is None else {"time_s": recording.time_s.tolist()}
    leading = {"index": recording.index.tolist(), **clock, "touch": recording.touch.tolist()}
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([*leading, *voltage_columns(readings.shape[1])])
    table.writerows([*first, *row] for *first, row in zip(*leading.values(), written_cells(readings), strict=True))
    with written(Path(path)) as file:
        file.write(text.getvalue().encode())


def in_phase(readings: Array | Complex) -> Array:
    """Readings (frames, m) as real numbers: complex ones are turned to the phase that most of them have."""
    if not np.iscomplexobj(readings):
        return np.asarray(readings, dtype=float)
    phase = np.angle(np.nansum((readings / np.nanmax(np.abs(readings), initial=np.finfo(float).tiny)) ** 2)) / 2
    return np.real(readings * np.exp(-1j * phase))


def touch_name(cell: str) -> str:
    """The name of a touch; a whole number is the same touch as 7, 7. and 7.0, as tables with empty cells write it.

    >>> [touch_name(cell) for cell in ("7.0", "7", "a.0", "")]
    ['7', '7', 'a.0', '']
    """
    whole, _, rest = cell.partition(".")
    return whole if whole.isdecimal() and not rest.strip("0") else cell


def check_kind(kind: object, where: str) -> None:
    """ValueError where a kind of readings is not one of KINDS; where: what held it."""
    if kind not in KINDS:
        raise ValueError(f"{where} '{kind}' is unknown; known: {', '.join(KINDS)}.")


def _rows(path: Path, readings: int | None) -> list[tuple[int, list[str]]]:
    """Lines from 1 with their cells, blank lines and commas at the end of every line left out, all of one width."""
    rows = [(line, cells) for line, cells in csv_lines(path, "one row a frame") if len(cells) > 1 or any(cells)]
    if not rows:
        raise InputFileError(path, "the file is empty. Expected a CSV of one row a frame.")
    leading = sum(cell in LEADING for cell in rows[0][1])
    rows = without_last_commas(rows, None if readings is None else readings + leading)
    for line, cells in rows:
        if len(cells) != len(rows[0][1]):
            raise InputFileError(path, f"{len(cells)} columns, expected {len(rows[0][1])} as in line {rows[0][0]}. "
                                       "A row is a frame: leave a cell empty where a channel is dead, and leave out "
                                       "lines of other text; where a frame has several rows, write them into one.",
                                 line=line)
    return rows


def _leading(path: Path, line: int, names: Sequence[str]) -> list[str]:
    """Names of the columns before the readings; InputFileError where the header is not that of a recording."""
    count = next((k for k, name in enumerate(names) if name.startswith(_READING)), len(names))
    leading = list(names[:count])
    fix = f"Expected {', '.join(LEADING)} (each may be left out), then v_000, v_001 ... or ch0, ch1 ..."
    if odd := [name for name in leading if name not in LEADING]:
        factor = {"time_ms": 1e-3, "time_us": 1e-6, "time_min": 60.0}.get(odd[0])
        way = "" if factor is None else f"Give time_s, {factor:g} times as large. "
        raise InputFileError(path, f"the header names '{odd[0][:20]}', which is no column of a recording. {way}{fix}",
                             line=line)
    if len(set(leading)) < len(leading):
        raise InputFileError(path, f"the header names {', '.join(leading)}: one of them twice. {fix}", line=line)
    if names and count == len(names):
        raise InputFileError(path, f"the header names no readings. {fix}", line=line)
    if names and names[count].removeprefix(_READING).lstrip("0") == "1":
        raise InputFileError(path, f"the header begins at '{names[count][:20]}', and readings count from 0. {fix}",
                             line=line)
    for number, name in enumerate(names[count:]):
        if (name.removeprefix(_READING).lstrip("0") or "0") != str(number):
            raise InputFileError(path, f"the header names '{name[:20]}' where reading {number} stands. {fix}",
                                 line=line)
    return leading


def _column(path: Path, body: Sequence[tuple[int, list[str]]], place: int, name: str) -> Array:
    """Column index or time_s (frames,), which never goes back."""
    values = np.array([finite(path, line, name, cells[place]) for line, cells in body])
    if len(back := np.flatnonzero(np.diff(values) < 0)):
        raise InputFileError(path, f"{name} goes back to {values[back[0] + 1]:g}; sort the rows in time, or give each "
                                   "recording a file of its own.", line=body[back[0] + 1][0])
    return values


def _readings(path: Path, body: Sequence[tuple[int, list[str]]], first: int) -> Array:
    try:
        values = np.array([[float(cell or "nan") for cell in cells[first:]] for _, cells in body])
    except ValueError:
        values = np.array([np.nan])
    if np.isinf(values).any() or np.isnan(values).any():  # look at each cell for what is wrong; empty ones are not
        return np.array([[np.nan if cell.lower() in DEAD else finite(path, line, f"reading {k}", cell, _DEAD)
                          for k, cell in enumerate(cells[first:])] for line, cells in body])
    return values
