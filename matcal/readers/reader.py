"""The seam of every reader: what it looks at (`Source`), and what it offers (`Reader`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from matcal.readers.cells import Grid, text_grid
from matcal.readers.column_options import Selection
from matcal.readers.recording import Recording


@dataclass(frozen=True)
class Source:
    """A file that is open: its text, or the sheet of a workbook."""

    path: Path
    # the whole text; "" for a sheet
    text: str
    # the cells of a sheet; None for text, see `grid`
    sheet: Grid | None = None
    # what was decided in opening it, one sentence each
    notes: tuple[str, ...] = ()

    @cached_property
    def grid(self) -> Grid:
        """The cells of the sheet, or of the text, its separator found from the text; InputFileError where it has none.
        """
        return text_grid(self.text, self.path) if self.sheet is None else self.sheet


@dataclass(frozen=True)
class Reader:
    """One layout of files; `matcal.readers.vendors.READERS` names them all."""

    # the word for it, as in `Recording.vendor`
    name: str
    # what a user calls it
    title: str
    # whether a file has this layout, from what it holds
    recognises: Callable[[Source], bool]
    # its columns in SI, as the selection says; InputFileError where it cannot be used
    read: Callable[[Source, Selection | None], Recording]
    # whether its files have acquisition blocks, of which a selection may choose one
    has_blocks: bool = False
