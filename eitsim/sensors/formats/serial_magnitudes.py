"""Serial lines of OpenEIT and Spectra boards: `magnitudes : v,v,...`, a frame a line."""

from pathlib import Path

from eitsim.sensors.formats.layout import Layout, equally_long, first_lines, frames, text_lines
from eitsim.sensors.recording import Recording
from touchcal.errors import InputFileError

_LABEL = "magnitudes"


def labelled(line: str) -> str | None:
    """What follows the label, `v,v,...`; None for a line without it."""
    label, colon, values = line.partition(":")
    return values.strip().rstrip(",") if colon and label.strip().lower() == _LABEL else None


def _is_serial(path: Path) -> bool:
    return any(labelled(line) is not None for line in first_lines(path))


def _read_serial(path: Path, kind: str) -> Recording:
    """Lines with the label; what a board prints between them is left out. Simulated ones of the programs may have signs
    under it, and are voltages."""
    rows, lines = [], []
    for number, line in enumerate(text_lines(path), start=1):
        values = labelled(line)
        if values is None:
            continue
        try:
            rows.append([float(cell) for cell in values.split(",") if cell.strip()])
        except ValueError:
            raise InputFileError(path, "a frame that holds no numbers only: it was cut, or two ran into one. Delete "
                                       "it.", line=number) from None
        lines.append(number)
    table = equally_long(path, rows, lines, "magnitudes")
    return frames(path, table, "magnitude" if (table >= 0).all() else "voltage")


FORMAT = Layout("serial lines of OpenEIT and Spectra, `magnitudes : v,v,...`", _is_serial, _read_serial)
