"""One door to every reader: the layout is told from the file's first lines."""

from __future__ import annotations

from pathlib import Path

from matcal.readers.plain import read_plain
from matcal.readers.recording import Recording
from matcal.readers.table import read_text


def read(path: Path | str) -> Recording:
    """The columns of one test file in SI; TestFileError names what is wrong, where, and the mend."""
    path = Path(path)
    return read_plain(read_text(path), path)
