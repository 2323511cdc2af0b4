"""Any file of frames as a recording: the first layout that recognises it reads it, else the CSV of recordings."""

from pathlib import Path

from eitsim.sensors.formats import columns, eit_kit, matlab, sciospec, serial_magnitudes
from eitsim.sensors.recording import Recording, check_kind, read_recording
from touchcal.errors import InputFileError

# A new board is one module with a `FORMAT` and its name here, before `columns`, which takes whatever has one column.
FORMATS = tuple(module.FORMAT for module in (sciospec, matlab, serial_magnitudes, eit_kit, columns))


def open_recording(path: Path | str, *, kind: str = "voltage", readings: int | None = None) -> Recording:
    """Read a recording from a CSV of one row a frame or from a board's file (FORMATS), each of `readings` numbers where
    that is given.

    kind: what readings are where the file does not say it. Boards' files name no touches: every frame counts as
    untouched. InputFileError names the file, the line, what was expected and the fix.
    """
    check_kind(kind, "kind")
    path = Path(path)
    layout = next((one for one in FORMATS if one.recognises(path)), None)
    if layout is None:
        return read_recording(path, kind=kind, readings=readings)
    found = layout.read(path, kind)
    if readings is not None and found.readings.shape[1] != readings:
        raise InputFileError(path, f"{found.readings.shape[1]} readings a frame, and the sensor's drive makes "
                                   f"{readings}. Give the recording or the sensor file that belong together, or "
                                   "correct [drive].")
    return found
