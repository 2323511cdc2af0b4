"""Sciospec's .eit files: a frame a file, voltages of all channels by injection and frequency, complex.

They state their order. Read are the differences of neighbours among the channels that are connected, which are those
measured (MeasurementChannels) and injected at: the voltages themselves are against the board's ground, which no
electrode of a body is at, and channels without an electrode hold noise.

The first line is the number of header lines, 18 in the files of today: version, name, date, lowest and highest
frequency, scale, count of frequencies, amplitude, rate, phase correction, gain, ADC range, measuring mode, boundary,
switch, and two lists of channels. Then, for each injection, a line with its two electrodes, from 1, and a line for each
frequency with real and imaginary part of every channel, separated by tabs. Layout as EIDORS and sciopy read it.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eitsim.sensors.formats.layout import Layout, first_lines, frames, text_lines
from eitsim.sensors.recording import Recording
from touchcal.arrays import Complex, Index
from touchcal.errors import InputFileError

_MEASURED = "MeasurementChannels"
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
        if frame.pairs.shape != read[0].pairs.shape or (frame.pairs != read[0].pairs).any():
            raise InputFileError(file, f"{len(frame.pairs)} readings, or others than the {len(read[0].pairs)} of "
                                       f"{files[0].name}. Put files of other settings into another folder.")
    return frames(path, np.array([frame.readings for frame in read]), "voltage" if kind == "magnitude" else kind,
                  read[0].pairs)


@dataclass(frozen=True, eq=False)
class _Frame:
    readings: Complex  # (m,) differences of neighbours
    pairs: Index  # (m, 4) source, sink, plus and minus, channels that are connected from 0


def _frame(path: Path) -> _Frame:
    lines = text_lines(path)
    headers = _headers(lines[0] if lines else "")
    if headers is None:
        raise InputFileError(path, "its first line is not the number of header lines. Export the frames as .eit with "
                                   "the instrument's software.", line=1)
    body = [(number, line) for number, line in enumerate(lines[headers:], start=headers + 1) if line.strip()]
    out: list[list[complex]] = []
    injections: list[tuple[int, int]] = []
    for number, line in body:
        cells = _numbers(path, number, line)
        waiting = len(injections) > len(out)
        if len(cells) == 2 and not waiting:
            injections.append(_channels(path, number, cells))
            continue
        if not waiting and out:
            raise InputFileError(path, "a second line of voltages for one injection: several frequencies. Export one.",
                                 line=number)
        if not waiting or len(cells) % 2 or not cells:
            raise InputFileError(path, "expected a line `a b` of the injection's electrodes, then a line of re and im "
                                       "of every channel.", line=number)
        out.append([complex(re, im) for re, im in zip(cells[::2], cells[1::2], strict=True)])
    if not out:
        raise InputFileError(path, "no voltages below the header; the file was cut. Copy it again.")
    if len(injections) > len(out) or len({len(row) for row in out}) > 1:
        raise InputFileError(path, "an injection without its voltages, or with another number of channels; the file "
                                   "was cut. Copy it again.", line=body[-1][0])
    return _differences(path, lines[1:headers], injections, np.array(out, dtype=np.complex128))


def _differences(path: Path, header: list[str], injections: list[tuple[int, int]], volts: Complex) -> _Frame:
    """Neighbours' differences of the connected channels, by injection, of voltages (injections, channels)."""
    measured = _listed(header, _MEASURED) or list(range(1, volts.shape[1] + 1))
    connected = np.array(sorted({*measured, *(channel for ends in injections for channel in ends)}))
    if volts.shape[1] == len(measured) and set(connected) == set(measured):
        column = {channel: k for k, channel in enumerate(measured)}
    else:
        column = {channel: channel - 1 for channel in range(1, volts.shape[1] + 1)}
    if absent := [channel for channel in connected.tolist() if channel not in column]:
        raise InputFileError(path, f"channel {absent[0]} is named by the header or an injection, and each line holds "
                                   f"{volts.shape[1]} channels. Export the frames again.")
    volts, count = volts[:, [column[channel] for channel in connected.tolist()]], len(connected)
    plus = (np.arange(count) + 1) % count
    ends = np.searchsorted(connected, np.array(injections))
    pairs = np.array([(source, sink, k, minus) for source, sink in ends for minus, k in enumerate(plus)])
    return _Frame((volts[:, plus] - volts).ravel(), pairs.astype(np.intp))


def _listed(header: list[str], name: str) -> list[int]:
    """The channels, from 1, that a line of the header lists; empty without one."""
    for line in header:
        label, colon, cells = line.partition(":")
        if colon and label.strip() == name:
            return [int(cell) for cell in cells.split(",") if cell.strip().isdecimal()]
    return []


def _channels(path: Path, number: int, cells: list[float]) -> tuple[int, int]:
    source, sink = (int(cell) for cell in cells)
    if [source, sink] != cells or min(source, sink) < 1 or source == sink:
        raise InputFileError(path, f"'{cells[0]:g} {cells[1]:g}' are no two channels, which count from 1.", line=number)
    return source, sink


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
