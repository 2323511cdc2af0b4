"""The seam of every reader: what it looks at (`Source`), and what it offers (`Reader`)."""

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
    text: str  # the whole text; "" for a sheet
    sheet: Grid | None = None  # the cells of a sheet; None for text, see `grid`
    notes: tuple[str, ...] = ()  # what was decided in opening it, one sentence each

    @cached_property
    def grid(self) -> Grid:
        """The cells of the sheet, or of the text, its separator found from the text; InputFileError where it has none.
        """
        return text_grid(self.text, self.path) if self.sheet is None else self.sheet


@dataclass(frozen=True)
class Reader:
    """One layout of files; `matcal.readers.vendors.readers` names them all."""

    name: str  # the word for it, as in `Recording.vendor`
    title: str  # what a user calls it
    recognises: Callable[[Source], bool]  # whether a file has this layout, from what it holds
    # its columns in SI, as the selection says; InputFileError where it cannot be used
    read: Callable[[Source, Selection | None], Recording]
    has_blocks: bool = False  # whether its files have acquisition blocks, of which a selection may choose one
