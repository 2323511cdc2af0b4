"""MTS 793 `specimen.dat`: line 1 says delimiter and decimal mark, then blocks, each with names and units again.

Line 1 is `MTS793|program|language|version|delimiter (0 blank, 1 comma, 2 tab)|decimal mark|...`. A block begins with a
title such as `Data Acquisition ... Time: 308.3 s 1/28/2015` in the language of line 1, after which some programs write
a few `key value` lines; an operator's block holds only these. Blocks are known by this shape, not by their words.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from matcal.readers.cells import Grid, Style, shown, text_grid
from matcal.readers.column_options import Selection
from matcal.readers.columns import Header, read_columns
from matcal.readers.reader import Reader, Source
from matcal.readers.recording import Recording
from matcal.readers.specimen_metadata import metadata_of, sizes_of
from matcal.readers.units import si_factor
from matcal.readers.vocabulary import quantity_of
from touchcal.errors import InputFileError

MARK = "MTS793|"
_DELIMITERS = {"0": " ", "1": ",", "2": "\t"}
_HEAD = 20  # rows below a title within which the names of its columns are looked for


@dataclass(frozen=True)
class _Block:
    names: int  # row of the grid that holds its names; that of its units follows
    rows: range  # rows of its numbers


def _is_793(source: Source) -> bool:
    return source.text.startswith(MARK)


def _read_793(source: Source, selection: Selection | None = None) -> Recording:
    """All acquisition blocks with the same columns as one recording with a column `block`, 1, 2, ... InputFileError
    where line 1 does not say how numbers are written, no block holds numbers, or time runs backwards."""
    path, (first, _, rest) = source.path, source.text.partition("\n")
    grid = text_grid("\n" + rest, path, *_layout(first.strip(), path))
    blocks, others = _blocks(grid)
    if not blocks:
        raise _no_block(grid)
    sizes, said = sizes_of(grid, others)
    filled = [(k, block) for k, block in enumerate(blocks, 1) if block.rows]
    if selection is not None and selection.block is not None:
        filled = _chosen(grid, filled, selection.block)
    if not filled:
        raise InputFileError(path, f"its {len(blocks)} blocks hold no numbers. Export the test again.")
    if selection is not None and selection.columns:
        filled = _with_one_header(grid, filled, said)
    else:
        filled = _with_known_columns(grid, filled, said)
    read = [(k, _read(grid, block, selection)) for k, block in filled]
    kept, notes = _alike(read, blocks)
    if selection is not None and selection.block is not None:
        notes = [f"block {selection.block} of {len(blocks)} read, as given."]
    joined = _joined(kept, [*said, *notes])
    metadata = {"Format": first.strip()} | metadata_of(grid.rows[n] for n in others) \
        | {"Blocks": f"{len(blocks)}, {len(kept)} used"}
    return replace(joined, metadata=metadata, properties=sizes)


def _layout(first: str, path: Path) -> tuple[str, Style | None]:
    fields = first.split("|")
    delimiter, decimal = (*fields, "", "", "", "", "", "")[4:6]
    if delimiter.isalpha() and decimal in (".", ","):
        return "", Style(decimal)  # a letter in place of the delimiter's number: it follows from the numbers
    if delimiter not in _DELIMITERS or decimal not in (".", ","):
        raise InputFileError(path, "line 1 should give delimiter and decimal mark, as in MTS793|MPT|ENU|1|2|.|/|:|1, "
                                   f"but is '{shown(first, 60)}'.", line=1)
    return _DELIMITERS[delimiter], Style(decimal)


def _blocks(grid: Grid) -> tuple[list[_Block], list[int]]:
    """The acquisition blocks, and the rows that belong to none."""
    titles = _titles(grid)
    found, taken = [], set(titles)
    for start, stop in pairwise([*titles, len(grid.rows)]):
        names = next((n for n in range(start + 1, min(stop - 1, start + _HEAD)) if _is_table(grid, n, stop)), None)
        if names is not None:
            found.append(_Block(names, range(names + 2, stop)))
            taken |= set(range(names, stop))
    return found, [n for n in range(len(grid.rows)) if n not in taken]


def _titles(grid: Grid) -> list[int]:
    return [n for n, row in enumerate(grid.rows) if _is_title(grid, row)]


def _no_block(grid: Grid) -> InputFileError:
    requested = ("A block begins with a title that ends in a clock, such as 'Data Acquisition: Timed Time: 10.0 Sec "
                 "1/28/15', and below it come names, units and numbers, parted as line 1 says")
    titles = _titles(grid)
    if not titles:
        return InputFileError(grid.path, "an MTS 793 file without a block of acquired numbers: no line is a title. "
                              f"{requested}. Export the test again.", line=grid.lines[-1] if grid.lines else 1)
    heads = ", ".join(f"{grid.lines[n]}" for n in titles[:8])
    return InputFileError(grid.path, f"an MTS 793 file without a block of acquired numbers: titles stand in line "
                                     f"{heads}, but no names with units and numbers follow any of them. {requested}. "
                                     "Export the test again.", line=grid.lines[titles[0]])


def _chosen(grid: Grid, filled: list[tuple[int, _Block]], requested: int) -> list[tuple[int, _Block]]:
    kept = [(k, block) for k, block in filled if k == requested]
    if not kept:
        there = ", ".join(f"{k} ({len(block.rows)} rows)" for k, block in filled)
        raise InputFileError(grid.path, f"`columns` asks for block {requested}; blocks with numbers: "
                                        f"{there or 'none'}.")
    return kept


def _is_title(grid: Grid, row: Sequence[str]) -> bool:
    """A title, then a word with a colon, a number and its unit of time (and a date)."""
    cells = [cell for cell in row if cell]
    at = next((k for k, cell in enumerate(cells) if cell.endswith(":") and k > 0), None)
    return at is not None and at + 2 < len(cells) and grid.number(cells[at + 1]) is not None \
        and si_factor(cells[at + 2], "time") is not None


def _is_table(grid: Grid, names: int, stop: int) -> bool:
    """Names, units, and numbers (or nothing) below; an operator's block has words and values instead."""
    if grid.numeric(grid.rows[names + 1]) or len(grid.rows[names]) < 2 + grid.numeric(grid.rows[names]):
        return False  # some names may be numbers: serial numbers of sensors
    if sum(quantity_of(cell) is not None for cell in grid.rows[names]) > 1:
        return True
    row = [cell for cell in grid.rows[names + 2] if cell] if names + 2 < stop else []
    return len(row) > 1 and grid.numeric(row) == len(row)


def _read(grid: Grid, block: _Block, selection: Selection | None) -> Recording:
    names, units = grid.rows[block.names], grid.rows[block.names + 1]
    line = grid.lines[block.names + 1]
    if len(units) != len(names):
        raise InputFileError(grid.path, f"the line of units has {len(units)} cells, that of names {len(names)}.",
                             line=line)
    cells = [(name, unit.strip("()[]")) for name, unit in zip(names, units, strict=True)]
    return read_columns(grid, Header(cells, line, block.rows), "mts_793", selection)


def _with_known_columns(grid: Grid, blocks: list[tuple[int, _Block]], said: list[str]) -> list[tuple[int, _Block]]:
    """The blocks with two columns or more that are known by name, or all where none has them."""
    known = [(k, block) for k, block in blocks
             if len({q for name in grid.rows[block.names] if (q := quantity_of(name)) is not None}) > 1]
    said += [f"block {k} left out: fewer than two of its columns are known by name ("
             f"{', '.join(map(shown, grid.rows[block.names][:8]))})." for k, block in blocks
             if known and (k, block) not in known]
    return known or blocks


def _with_one_header(grid: Grid, blocks: list[tuple[int, _Block]], said: list[str]) -> list[tuple[int, _Block]]:
    """The blocks whose columns have the names of those with the most rows: chosen columns mean only these."""
    rows: dict[tuple[str, ...], int] = {}
    for _, block in blocks:
        names = tuple(grid.rows[block.names])
        rows[names] = rows.get(names, 0) + len(block.rows)
    best = list(max(rows, key=lambda names: rows[names]))
    said += [f"block {k} left out: its columns are {', '.join(map(shown, grid.rows[block.names][:8]))}."
             for k, block in blocks if grid.rows[block.names] != best]
    return [(k, block) for k, block in blocks if grid.rows[block.names] == best]


def _alike(read: list[tuple[int, Recording]], blocks: list[_Block]) -> tuple[list[tuple[int, Recording]], list[str]]:
    """The blocks with the columns that most rows have, and notes on the others."""
    rows: dict[frozenset[str], int] = {}
    for _, part in read:
        rows[frozenset(part.columns)] = rows.get(frozenset(part.columns), 0) + part.rows
    best = max(rows, key=lambda columns: rows[columns])
    kept = [(k, part) for k, part in read if frozenset(part.columns) == best]
    notes = [f"{len(blocks)} acquisition blocks, {len(kept)} put together as one recording."]
    notes += [f"block {k} ({part.rows} rows of {', '.join(part.columns)}) left out: its columns are not those of the "
              "others." for k, part in read if frozenset(part.columns) != best]
    notes += [f"block {k} holds nothing." for k, block in enumerate(blocks, 1) if not block.rows]
    return kept, notes


def _joined(parts: list[tuple[int, Recording]], notes: list[str]) -> Recording:
    for (k, before), (m, after) in pairwise(parts):
        if "time" in before.columns and after.columns["time"][0] < before.columns["time"][-1]:
            raise InputFileError(
                after.paths[0], f"block {m} starts at {after.columns['time'][0]:g} s, before block {k} ends at "
                f"{before.columns['time'][-1]:g} s: they have no common clock. Choose one, for example `columns` "
                f'"{after.paths[0].name}=block={k}", or put each into a file of its own.', line=after.first_line)
    first = parts[0][1]
    columns = {q: np.concatenate([part.columns[q] for _, part in parts]) for q in first.columns}
    columns["block"] = np.concatenate([np.full(part.rows, float(k)) for k, part in parts])
    said = list(dict.fromkeys(note for _, part in parts for note in part.notes))
    return replace(first, columns=columns, notes=(*notes, *said),
                   names={**first.names, "block": "block"}, units={**first.units, "block": ""})


READER = Reader("mts_793", "MTS 793 specimen.dat", _is_793, _read_793, has_blocks=True)
