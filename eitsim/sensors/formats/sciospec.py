"""Sciospec's .eit files: a frame a file, voltages of all channels by injection and frequency, complex.

The first line is the number of header lines, 18 in the files of today: version, name, date, lowest and highest
frequency, scale, count of frequencies, amplitude, rate, phase correction, gain, ADC range, measuring mode, boundary,
switch, and two lists of channels. Then, for each injection, a line with its two electrodes, from 1, and a line for each
frequency with real and imaginary part of every channel, separated by tabs. Layout as EIDORS and sciopy read it.
"""

from pathlib import Path

import numpy as np

from eitsim.sensors.formats.layout import Layout, first_lines, frames, text_lines
from eitsim.sensors.recording import Recording
from touchcal.arrays import Complex
from touchcal.errors import InputFileError

_FEWEST_HEADERS, _MOST_HEADERS = 10, 100


def _is_sciospec(path: Path) -> bool:
    if path.is_dir():
        return any(path.glob("*.eit"))
    lines = first_lines(path)
    return path.suffix.lower() == ".eit" and bool(lines) and _headers(lines[0]) is not None


def _read_sciospec(path: Path, kind: str) -> Recording:
    """The frames of one file, or of all in a folder in the order of their names."""
    files = sorted(path.glob("*.eit")) if path.is_dir() else [path]
    read = [_frame(file) for file in files]
    for file, frame in zip(files, read, strict=True):
        if len(frame) != len(read[0]):
            raise InputFileError(file, f"{len(frame)} readings, and {files[0].name} has {len(read[0])}. Put files of "
                                       "other settings into another folder.")
    return frames(path, np.array(read), "voltage" if kind == "magnitude" else kind)


def _frame(path: Path) -> Complex:
    lines = text_lines(path)
    headers = _headers(lines[0] if lines else "")
    if headers is None:
        raise InputFileError(path, "its first line is not the number of header lines. Export the frames as .eit with "
                                   "the instrument's software.", line=1)
    body = [(number, line) for number, line in enumerate(lines[headers:], start=headers + 1) if line.strip()]
    out: list[list[complex]] = []
    injection = False
    for number, line in body:
        cells = _numbers(path, number, line)
        if len(cells) == 2 and not injection:
            injection = True
            continue
        if not injection and out:
            raise InputFileError(path, "a second line of voltages for one injection: several frequencies. Export one.",
                                 line=number)
        if not injection or len(cells) % 2 or not cells:
            raise InputFileError(path, "expected a line `a b` of the injection's electrodes, then a line of re and im "
                                       "of every channel.", line=number)
        out.append([complex(re, im) for re, im in zip(cells[::2], cells[1::2], strict=True)])
        injection = False
    if not out:
        raise InputFileError(path, "no voltages below the header; the file was cut. Copy it again.")
    if injection or len({len(row) for row in out}) > 1:
        raise InputFileError(path, "an injection without its voltages, or with another number of channels; the file "
                                   "was cut. Copy it again.", line=body[-1][0])
    return np.array(out, dtype=np.complex128).ravel()


def _headers(line: str) -> int | None:
    text = line.strip()
    return int(text) if text.isdecimal() and len(text) < 4 and _FEWEST_HEADERS <= int(text) <= _MOST_HEADERS else None


def _numbers(path: Path, number: int, line: str) -> list[float]:
    try:
        return [float(cell) for cell in line.split()]
    except ValueError:
        raise InputFileError(path, f"'{line[:30]}' holds no numbers. Expected an injection `a b`, then re and im of "
                                   "every channel.", line=number) from None


FORMAT = Layout("Sciospec .eit, a file or a folder of them", _is_sciospec, _read_sciospec)
