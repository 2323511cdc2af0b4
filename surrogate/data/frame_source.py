"""Where lines of frames come from as a device writes them: standard input, or a serial port."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Callable, Iterator
from io import BufferedIOBase
from typing import TYPE_CHECKING

from eitsim.sensors.formats.serial_magnitudes import labelled
from surrogate.data.frame_rows import CHUNK, text_of
from touchcal.csv_numbers import is_numeric
from touchcal.lazy import needed

if TYPE_CHECKING:
    import serial

STANDARD_INPUT = "-"
BAUD = 115200  # bits a second where none are given; boards on USB take any
QUIET_S = 5.0  # how long nothing may come until a port says so
LONGEST_START = 1 << 15  # bytes that a board may send before its first line of numbers: 3 s at BAUD
_DEVICE = re.compile(r"/dev/(tty|cu)\S+|COM\d+", re.IGNORECASE)


def comes_live(frames: str | None) -> bool:
    """Whether frames come as they are written: `-` or `serial:PORT`, with @BAUD or without."""
    return frames is not None and (frames == STANDARD_INPUT or frames.startswith("serial:"))


def check_no_port(frames: str) -> None:
    """ValueError for the name of a serial port without `serial:`."""
    if _DEVICE.fullmatch(frames):
        raise ValueError(f"'{frames}' is a serial port. Write serial:{frames}, or serial:{frames}@BAUD.")


@contextlib.contextmanager
def opened(frames: str, say: Callable[[str], object] = lambda words: None) -> Iterator[BufferedIOBase]:
    """The stream of `-` or `serial:PORT@BAUD`; `say` takes words on a port that sends nothing that can be read.
    ValueError where the port cannot be opened."""
    if frames == STANDARD_INPUT:
        widen_pipe(sys.stdin.fileno())
        with open(sys.stdin.fileno(), "rb", closefd=False) as source:
            yield source
        return
    port, baud = _port(frames)
    needed("serial", "serial ports")
    import serial
    from serial.tools.list_ports import comports

    try:
        device = serial.Serial(port, baud, timeout=QUIET_S)
    except serial.SerialException as error:
        there = ", ".join(one.device for one in comports()) or "none is found"
        why = os.strerror(error.errno) if error.errno else error
        raise ValueError(f"serial port {port}: {why}. Check its name, its cable, that you may read it, and that no "
                         f"other program does; ports here: {there}.") from None
    with device:
        yield SerialLines(device, say)


def _port(frames: str) -> tuple[str, int]:
    """Name and bits a second of `serial:PORT@BAUD`."""
    port, at, baud = frames.removeprefix("serial:").partition("@")
    if not port or (at and not (baud.isdecimal() and int(baud))):
        raise ValueError(f"'{frames}' names no serial port. Write serial:PORT or serial:PORT@BAUD, as "
                         "serial:/dev/ttyACM0@115200 or serial:COM3.")
    return port, int(baud or BAUD)


class SerialLines(BufferedIOBase):
    """Bytes of a serial port from its first line of numbers on: what was cut when it was opened, and what a board
    says as it starts, come before."""

    def __init__(self, device: serial.Serial, say: Callable[[str], object]) -> None:
        self.device, self.say = device, say
        self.begun = self.waits = False  # whether numbers came; whether it was said that nothing does

    def read1(self, size: int = -1) -> bytes:
        """What waits, `size` bytes at most and at least one; ValueError where the device went away."""
        try:
            return self._waiting(size)
        except OSError:
            raise ValueError(f"serial port {self.device.port} gives no more: its device was unplugged, or another "
                             "program reads it too.") from None

    def _waiting(self, size: int) -> bytes:
        if self.begun:
            waiting = max(self.device.in_waiting, 1)
            while not (found := self.device.read(waiting if size < 0 else min(waiting, size))):
                pass  # nothing came for QUIET_S
            return found
        line = self._line(LONGEST_START)
        seen, begun = len(line), _is_named(line)  # of another first line the beginning may be lost
        while not begun:
            if seen >= LONGEST_START:
                raise ValueError(f"serial port {self.device.port}: none of its first {seen} bytes make a line of "
                                 f"numbers separated by commas; the latest line begins {text_of(line)[:30]!r}. Is it "
                                 f"{self.device.baudrate} bits a second? Give serial:PORT@BAUD, and let the board end "
                                 "lines with a line feed.")
            line = self._line(LONGEST_START - seen)
            seen, begun = seen + len(line), _is_named(line) or _is_numerics(line)
        self.begun = True
        return line

    def _line(self, most: int) -> bytes:
        """A whole line of at most so many bytes, however long it takes; says once where none comes."""
        line = self.device.readline(most)
        while len(line) < most and not line.endswith(b"\n"):
            if not self.waits:
                self.waits = True
                self.say(f"serial port {self.device.port}: no line came within {QUIET_S:g} s; waiting. Does the device "
                         "send by itself, and is this its port?")
            line += self.device.readline(most - len(line))
        return line


def _is_named(line: bytes) -> bool:
    text = text_of(line)
    return labelled(text) is not None or text.startswith(("v_", '"v_'))


def _is_numerics(line: bytes) -> bool:
    first, comma, _ = text_of(line).partition(",")
    return bool(comma) and is_numeric(first)


def widen_pipe(descriptor: int) -> None:
    """Let a pipe hold more frames than its 64 kB, where the system can, so that those of a fast writer go together."""
    with contextlib.suppress(ImportError, AttributeError, OSError):
        import fcntl

        fcntl.fcntl(descriptor, fcntl.F_SETPIPE_SZ, CHUNK)  # pyright: ignore[reportAttributeAccessIssue]
