"""LabVIEW's binary files (tdms), read with npTDMS where it is installed: one table a group of channels."""

import io
from pathlib import Path
from typing import Any

import numpy as np

from matcal.readers.cells import Grid, with_seconds
from touchcal.errors import InputFileError

MARK = b"TDSm"


def groups_of(data: bytes, path: Path) -> dict[str, Grid]:
    """Group -> grid of its channels, names and units above, with the clock that the channels state; InputFileError
    where npTDMS is absent or the file is damaged. What a parser may raise is open-ended, hence the broad except."""
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise InputFileError(path, "this is a LabVIEW file (.tdms), for which npTDMS is needed: pip install "
                                   "'.[labview]' in the project's folder. Or export it as text.") from None
    try:
        found = TdmsFile.read(io.BytesIO(data))
        grids = {group.name: _grid(group, path) for group in found.groups() if group.channels()}
    except Exception as error:
        raise InputFileError(path, f"this LabVIEW file (.tdms) is damaged ({type(error).__name__}). Save it again, or "
                                   "export it as text.") from None
    return {name: grid for name, grid in grids.items() if len(grid.rows) > 2}


def _grid(group: Any, path: Path) -> Grid:
    channels = [channel for channel in group.channels() if len(channel)]
    columns = [[channel.name, str(channel.properties.get("unit_string", "")), *_cells(channel[:])]
               for channel in channels]
    clocked = next((channel for channel in channels if channel.properties.get("wf_increment")), None)
    if clocked is not None and not any(channel.name.lower().startswith(("time", "zeit")) for channel in channels):
        start, step = (float(clocked.properties.get(key, 0.0)) for key in ("wf_start_offset", "wf_increment"))
        columns.insert(0, ["Time", "s", *(repr(start + k * step) for k in range(len(clocked)))])
    rows = [[column[n] if n < len(column) else "" for column in columns]
            for n in range(max(map(len, columns), default=0))]
    return with_seconds(Grid(path, rows, range(1, len(rows) + 1), sheet=group.name))


def _cells(values: Any) -> list[str]:
    values = np.asarray(values)
    return [repr(float(value)) for value in values] if np.issubdtype(values.dtype, np.number) else \
        [str(value) for value in values]
