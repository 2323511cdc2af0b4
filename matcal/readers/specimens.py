"""Several specimens below one another in one table: by a column that names them, or where the record begins again."""

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from matcal.readers.cells import Grid, shown
from matcal.readers.recording import Recording
from touchcal.arrays import Array

_FEWEST = 3  # rows of a specimen, at least
# shares of the largest strain between which a record begins again: it falls from above the first to below the second
_HIGH, _LOW = 0.5, 0.1
_NAME = re.compile(
    r"(test )?(specimen|sample|coupon|replicate|repeat|rep|run|trial|piece|id|uid|probe(n|korper)?|prufling|prufkorper|"
    r"versuch|eprouvette|echantillon|essai|muestra|probeta|ensayo|provino|campione|prova|amostra|proefstuk|test|part)s?"
    r"( ?(id|no|nr|num|number|name|label|code|index|nummer|kennung|bezeichnung|n|numero|#))?\.?|试样(编号)?|样品(编号)?"
    r"|試験片")


def names_specimens(name: str) -> bool:
    """Whether a column of this name may say which specimen each row belongs to."""
    parted = unicodedata.normalize("NFD", name[:80])
    text = unicodedata.normalize("NFC", "".join(c for c in parted if not "\u0300" <= c <= "\u036f"))
    text = re.sub(r"[°º#]", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text))
    return _NAME.fullmatch(re.sub(r"[\s_.\-:]+", " ", text.lower()).strip()) is not None


def labels_of(grid: Grid, names: Sequence[str], rows: range) -> tuple[str, tuple[str, ...]]:
    """The column that says which specimen each row belongs to, and what it says; empty where there is none. Such a
    column takes a few values, words or whole numbers, each on three rows at least."""
    for n, name in enumerate(names):
        if not names_specimens(name):
            continue
        cells = tuple(grid.cell(row, n) for row in rows)
        counts = Counter(cells)
        whole = all((value := grid.number(cell)) is None or value == int(value) for cell in counts)
        if len(counts) > 1 and whole and min(counts.values()) >= _FEWEST and "" not in counts:
            return name, cells
    return "", ()


def specimens_of(recording: Recording) -> list[Recording]:
    """The recordings of single specimens that a recording holds; itself where it is one."""
    if recording.specimen:
        labels = np.array(recording.specimen)
        parts = [(label, labels == label) for label in dict.fromkeys(recording.specimen)]
        return [_part(recording, label, rows) for label, rows in parts]
    starts = [0, *_restarts(recording.columns), recording.rows]
    if len(starts) == 2:
        return [recording]
    count = len(starts) - 1
    said = (f"The record begins again in {recording.label}: taken as {count} specimens, one below the other. If "
            "they are loadings of one specimen, keep the rows of one of them.")
    cut = replace(recording, cautions=(*recording.cautions, said))
    index = np.arange(recording.rows)
    return [_part(cut, f"part {k}", (index >= a) & (index < b))
            for k, (a, b) in enumerate(pairwise(starts), 1)]


def _part(recording: Recording, label: str, rows: NDArray[np.bool_]) -> Recording:
    said = f"Specimen '{shown(label)}' of several in one table: {np.count_nonzero(rows)} of {recording.rows} rows."
    return replace(recording, columns={q: column[rows] for q, column in recording.columns.items()},
                   specimen=(), part=shown(label), notes=(*recording.notes, said))


def _restarts(columns: Mapping[str, Array]) -> list[int]:
    """Rows at which a record begins again: its clock falls back, or where it has none its strain falls from high to
    about nothing from one row to the next; [] where any part would have too few rows."""
    time, size = columns.get("time"), _size(columns)
    if size is None or size.max() <= 0 or size.size < 2 * _FEWEST:
        return []
    falls = (size[:-1] > _HIGH * size.max()) & (size[1:] < _LOW * size.max())
    if time is not None:
        falls = (np.diff(time) < 0) & (size[1:] < _LOW * size.max())
    elif "strain" not in columns and "stretch" not in columns:
        return []
    starts = (np.flatnonzero(falls) + 1).tolist()
    ends = [0, *starts, size.size]
    return starts if min(np.diff(ends)) >= _FEWEST else []


def _size(columns: Mapping[str, Array]) -> Array | None:
    """How far the specimen is strained in each row."""
    for quantity, rest in (("strain", 0.0), ("stretch", 1.0), ("displacement", None), ("volume_ratio", 1.0)):
        if quantity in columns:
            column = columns[quantity]
            return np.abs(column - (column[0] if rest is None else rest))
    return None
