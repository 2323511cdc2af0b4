"""Lines of a device: a serial port, read from its first whole line of numbers, and lines that boards write."""

from __future__ import annotations

import io
import os
import threading
import tty
from collections.abc import Iterator

import numpy as np
import pytest

from surrogate.data import frame_source
from surrogate.data.frame_rows import frames_as_they_come
from surrogate.data.frame_source import SKIPPED, check_no_port, comes_live, opened


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """The device's end of a serial line, a pseudo-terminal, and the name of its port."""
    pytest.importorskip("serial")
    device, port = os.openpty()
    tty.setraw(port)
    yield device, os.ttyname(port)
    os.close(port)
    os.close(device)


def frames_of_port(line: tuple[int, str], text: bytes, count: int, readings: int) -> list[list[float]]:
    device, port = line
    with opened(f"serial:{port}@9600") as source:
        os.write(device, text)
        found: list[list[float]] = []
        for read in frames_as_they_come(source, readings):
            found += read.volts[[not problem for problem in read.problem]].tolist()
            if len(found) >= count:
                break
    return found


@pytest.mark.parametrize(("text", "expected"), [
    (b"23,0.2\n1.5,0.2\n2.5,0.4\n", [[1.5, 0.2], [2.5, 0.4]]),  # the first line may be a cut 1.23,0.2
    (b"e-3\r\nboard ready, v 1.2\r\n1.5,0.2\r\n\r\noops,1\r\n2.5,0.4\r\n", [[1.5, 0.2], [2.5, 0.4]]),
    (b"v_001,v_000\n1.5,0.2\n2.5,0.4\n", [[0.2, 1.5], [0.4, 2.5]]),
    (b"magnitudes : 1.5,0.2,\nfps: 20\nmagnitudes : 2.5,0.4,\n", [[1.5, 0.2], [2.5, 0.4]])],
    ids=["cut", "banner", "header", "labelled"])
def test_a_port_is_read_from_its_first_whole_line_of_numbers(line: tuple[int, str], text: bytes,
                                                             expected: list[list[float]]) -> None:
    assert frames_of_port(line, text, 2, 2) == expected


def test_lines_of_a_board_are_frames_and_what_it_prints_between_is_none() -> None:
    lines = b"Magnitudes: 1,2,\nfps: 20\nmagnitudes : 3,4\nmagnitudes : 5,\n"
    read = list(frames_as_they_come(io.BytesIO(lines), 2))
    assert np.concatenate([one.line for one in read]).tolist() == [1, 3, 4]
    assert read[0].volts[:2].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert read[0].problem == ["", "", "unreadable: 1 columns, expected 2 voltages separated by commas"]


def test_what_comes_live() -> None:
    assert [comes_live(text) for text in ("-", "serial:COM3", "serial:/dev/ttyACM0@9600")] == [True] * 3
    assert [comes_live(text) for text in (None, "frames.csv", "COM3")] == [False] * 3


@pytest.mark.parametrize("text", ["serial:", "serial:COM3@", "serial:COM3@fast", "serial:COM3@0"])
def test_a_source_that_names_no_port_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"names no serial port. Write serial:PORT or serial:PORT@BAUD"), opened(text):
        pass


def test_a_port_that_is_not_there_is_named_with_those_that_are() -> None:
    pytest.importorskip("serial")
    with (pytest.raises(ValueError, match=r"^serial port /dev/nothing: .*Check its name, its cable.*ports here: "),
          opened("serial:/dev/nothing")):
        pass


@pytest.mark.parametrize("text", [b"", b"1,2\n", b"1,2\n3,4\n"])
def test_a_device_that_goes_away_is_an_error_of_its_port(text: bytes) -> None:
    pytest.importorskip("serial")
    device, port = os.openpty()
    tty.setraw(port)
    with opened(f"serial:{os.ttyname(port)}") as source:
        os.write(device, text)
        os.close(port)
        os.close(device)
        with pytest.raises(ValueError, match=r"^serial port .* unplugged, or another program"):
            list(frames_as_they_come(source, 2))


def test_what_a_program_says_before_its_first_frame_is_left_out() -> None:
    text = b"skin board 1.0, ready\nbaud 9600\n0.1,0.2,0.3\nstopped\n"
    (read,) = frames_as_they_come(io.BytesIO(text), 3)
    assert read.line.tolist() == [3, 4]
    assert read.problem == ["", "unreadable: 1 columns, expected 3 voltages separated by commas"]
    (read,) = frames_as_they_come(io.BytesIO(b"OpenEIT\nmagnitudes : 1,2,3,\n"), 3)
    assert read.volts.tolist() == [[1.0, 2.0, 3.0]]


def test_a_port_says_that_its_lines_hold_no_numbers(line: tuple[int, str]) -> None:
    device, port = line
    said: list[str] = []
    with opened(f"serial:{port}@9600", said.append) as source:
        os.write(device, b"\xfe\x12;\n" * SKIPPED + b"1.5,0.2\n")
        assert source.read1() == b"1.5,0.2\n"
    assert len(said) == 1
    assert f"serial port {port}: {SKIPPED} lines came, none of numbers" in said[0]
    assert "Is 9600 its baud rate?" in said[0]


def test_a_port_says_once_that_nothing_comes_and_goes_on(line: tuple[int, str],
                                                         monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_source, "QUIET_S", 0.05)
    device, port = line
    said: list[str] = []

    def speak(words: str) -> None:
        said.append(words)
        os.write(device, b"7\n1.5,")
        threading.Timer(0.2, os.write, (device, b"0.2\n")).start()

    with opened(f"serial:{port}", speak) as source:
        assert source.read1() == b"1.5,0.2\n"
        threading.Timer(0.2, os.write, (device, b"2.5,")).start()
        assert source.read1() == b"2"  # a pause is no end
    assert [f"serial port {port}: no line came within 0.05 s" in words for words in said] == [True]


@pytest.mark.parametrize("name", ["/dev/ttyACM0", "/dev/cu.usbmodem14", "com3"])
def test_a_port_without_its_word_is_named(name: str) -> None:
    with pytest.raises(ValueError, match=rf"is a serial port. Write serial:{name}, or"):
        check_no_port(name)
    for other in ("frames.csv", "-", f"serial:{name}", "com3.csv"):
        check_no_port(other)
