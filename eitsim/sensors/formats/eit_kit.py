"""EIT-kit's frames: `origin` and `framei`, each followed by magnitudes with four decimals, one after the other.

The board drives every pair of neighbours and reads every pair, n x n magnitudes a frame; it leaves out those that are
0, which are the ones on driven electrodes, and writes no separator (its Arduino library, take_measurements).
"""

import re
from pathlib import Path

from eitsim.sensors.formats.layout import Layout, equally_long, first_lines, frames, text_lines
from eitsim.sensors.recording import Recording

_MARK = re.compile(r"^(origin|framei)(?![a-z])", re.IGNORECASE | re.MULTILINE)
_VALUE = re.compile(r"\d+\.\d{4}")


def _is_eit_kit(path: Path) -> bool:
    return bool(_MARK.search("\n".join(first_lines(path))))


def _read_eit_kit(path: Path, kind: str) -> Recording:
    text = "\n".join(text_lines(path))
    marks = list(_MARK.finditer(text))
    ends = [mark.start() for mark in marks[1:]] + [len(text)]
    rows = [[float(value) for value in _VALUE.findall(text[mark.end():end])]
            for mark, end in zip(marks, ends, strict=True)]
    lines = [text.count("\n", 0, mark.start()) + 1 for mark in marks]
    return frames(path, equally_long(path, rows, lines, "magnitudes"), "magnitude")


FORMAT = Layout("EIT-kit's frames, `origin` and `framei`", _is_eit_kit, _read_eit_kit)
