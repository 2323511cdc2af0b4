"""Lines of a device: a serial port, read from its first whole line of numbers, and lines that boards write."""

import contextlib
import io
import os
import threading
import tracemalloc
import tty
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from surrogate.data import frame_source
from surrogate.data.frame_rows import LONGEST, frames_as_they_come, waiting_lines
from surrogate.data.frame_source import check_no_port, comes_live, opened


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


@pytest.mark.parametrize("text", [b"0.5,1,\n1.5,2,\n", b"0.5, 1, \r\n1.5, 2, \r\n", b"0,5;1\n1,5;2\n",
                                  b"0.5\t1\n1.5\t2\n", b"ready\n0.5 1\n1.5 2\n"])
def test_lines_of_a_stream_are_separated_as_boards_do_it(text: bytes) -> None:
    read = list(frames_as_they_come(io.BytesIO(text), 2))
    assert np.concatenate([one.volts for one in read]).tolist() == [[0.5, 1.0], [1.5, 2.0]]


def test_lines_of_a_board_are_frames_and_what_it_prints_between_is_none() -> None:
    lines = b"Magnitudes: 1,2,\nfps: 20\nmagnitudes : 3,4\nmagnitudes : 5,\n"
    read = list(frames_as_they_come(io.BytesIO(lines), 2))
    assert np.concatenate([one.line for one in read]).tolist() == [1, 3, 4]
    assert read[0].volts[:2].tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert read[0].problem == ["", "", "unreadable: 1 columns, expected 2 voltages separated by commas"]


@pytest.mark.parametrize(("text", "problems"), [
    (b"e-05,2\n3,4\n", ["unreadable: column 1 holds 'e-05' and no number", ""]),
    (b"board 1.0\n3,4\n", [""]),
    (b"6,7,8\nmagnitudes : 3,4\nfps: 20\n", [""]),
    ("caf\u00e9\x1b,1\n3,4\n".encode("latin-1"), ["unreadable: column 1 holds 'caf\\ufffd\\x1b' and no number", ""]),
    (b"1," * LONGEST + b"\n3,4\n", [f"unreadable: {LONGEST // 2 + 1} columns, expected 2 voltages separated by commas",
                                   ""])], ids=["cut", "banner", "cut board", "rubbish", "endless"])
def test_a_first_line_that_is_no_frame_costs_no_other(text: bytes, problems: list[str]) -> None:
    read = list(frames_as_they_come(io.BytesIO(b"0,1\n" * text.startswith(b"caf") + text), 2))
    assert [problem for one in read for problem in one.problem][-len(problems):] == problems
    assert read[-1].volts[-1].tolist() == [3.0, 4.0]


class Chunks(io.BufferedIOBase):
    """What a function gives, one call after another."""

    def __init__(self, give: Callable[[], bytes]) -> None:
        self.give = give

    def read1(self, size: int = -1) -> bytes:
        return self.give()


def test_of_a_line_without_an_end_no_more_is_kept_than_may_be_one() -> None:
    """100 MB of it; it is answered as soon as it is too long."""
    chunk, left = b"0" * 10**5, iter(range(1000))
    lines = waiting_lines(Chunks(lambda: chunk if next(left, None) is not None else b""))
    tracemalloc.start()
    assert [number for number, _ in next(lines)] == [1]
    assert next(left) == 11
    assert list(lines) == []
    assert tracemalloc.get_traced_memory()[1] < 10 * LONGEST
    tracemalloc.stop()


@pytest.mark.parametrize("text", [b"\xfe\x80\x00" * 60000, b"1,2\r" * 40000, b"noise\n" * 30000],
                         ids=["rate", "returns", "words"])
def test_a_port_without_a_line_of_numbers_is_not_read_for_ever(line: tuple[int, str], text: bytes) -> None:
    device, port = line
    os.set_blocking(device, False)
    read = threading.Event()
    writer = threading.Thread(target=_written, args=(device, text, read))
    with opened(f"serial:{port}@9600") as source:
        writer.start()
        with pytest.raises(ValueError, match=r"make a line of numbers separated by commas; .* 9600 bits a second"):
            list(frames_as_they_come(source, 2))
        read.set()
        writer.join()


def _written(device: int, text: bytes, read: threading.Event) -> None:
    while text and not read.is_set():
        with contextlib.suppress(BlockingIOError):
            text = text[os.write(device, text[:512]):]


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


def test_one_labelled_line_among_plain_frames_costs_no_other() -> None:
    """Lines that wait together or come one by one: as many rows as lines, the labelled one without values."""
    lines = b"1,2,3\n" * 3 + b"magnitudes : 1,2,3\n" + b"4,5,6\n" * 3
    found = list(frames_as_they_come(io.BytesIO(lines), 3))
    problems = [problem for one in found for problem in one.problem]
    assert [bool(problem) for problem in problems] == [False] * 3 + [True] + [False] * 3
    assert problems[3].startswith("unreadable")
    assert found[-1].volts[-1].tolist() == [4, 5, 6]
