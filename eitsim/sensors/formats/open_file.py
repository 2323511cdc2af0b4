"""Any file of frames as a recording: the first layout that recognises it reads it, else the CSV of recordings."""

from pathlib import Path

import numpy as np

from eitsim.scene.frames import Frames, read_frames
from eitsim.sensors.formats import (
    columns,
    eit_kit,
    goe_mf,
    matlab,
    numpy_array,
    quadrupoles,
    sciospec,
    serial_magnitudes,
)
from eitsim.sensors.formats.layout import Layout
from eitsim.sensors.recording import Recording, check_kind, in_phase, read_recording
from touchcal.entry_points import added
from touchcal.errors import InputFileError

# A new board is one module with a `FORMAT` and its name here, or an entry point `touchcal.formats` of an installed
# package; `columns` comes last, as it takes whatever has one column.
_BUILT_IN = tuple(module.FORMAT for module in (sciospec, matlab, numpy_array, goe_mf, serial_magnitudes, eit_kit,
                                               quadrupoles))


def formats() -> tuple[Layout, ...]:
    """All layouts, in the order in which they are asked."""
    return (*_BUILT_IN, *added("formats").values(), columns.FORMAT)


def open_recording(path: Path | str, *, kind: str = "voltage", readings: int | None = None) -> Recording:
    """Read a recording from a CSV of one row a frame or from a board's file (`formats`), each of `readings` numbers
    where that is given.

    kind: what readings are where the file does not say it. In a MATLAB file with vh and vi every frame of vi is a
    touch; other boards' files name no touches: every frame counts as untouched. InputFileError names the file, the
    line, what was expected and the fix.

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import eitsim
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "frames.csv"
    ...     _ = path.write_text("touch,v_000,v_001\\n,0.1,0.2\\na,0.1,0.3\\n")
    ...     recording = eitsim.open_recording(path)
    >>> recording.readings.shape, recording.touch.tolist()
    ((2, 2), ['', 'a'])
    """
    check_kind(kind, "kind")
    path = Path(path)
    layout = _layout(path)
    if layout is None:
        return read_recording(path, kind=kind, readings=readings)
    found = layout.read(path, kind)
    if readings is not None and found.readings.shape[1] != readings:
        raise InputFileError(path, f"{found.readings.shape[1]} readings a frame, and the model or the sensor's drive "
                                   f"has {readings}. Give a recording of that sensor, or correct [drive].")
    return found


def open_frames(path: Path | str, readings: int) -> Frames:
    """Read the frames of a CSV, as `read_frames`, or of a board's file (`formats`), complex ones turned to their common
    phase, with the number of each frame from 1 in place of its line; errors as those of `read_frames`."""
    path = Path(path)
    if not is_board_file(path):
        return read_frames(path, readings)
    found = in_phase(open_recording(path, readings=readings).readings)
    return Frames(found, np.arange(1, len(found) + 1))


def is_board_file(path: Path) -> bool:
    """Whether a file is read by one of `formats`, and not as a CSV of one row a frame."""
    return _layout(path) is not None


def _layout(path: Path) -> Layout | None:
    return next((one for one in formats() if one.recognises(path)), None)
