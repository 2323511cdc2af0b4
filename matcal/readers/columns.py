"""From a grid and its header to a recording: which column is which quantity, in SI, and what was decided about it."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from matcal.readers.cells import Grid, shown
from matcal.readers.column_options import Selection
from matcal.readers.column_words import HOLDS_MORE, SECOND_CHOICE
from matcal.readers.complete_rows import complete
from matcal.readers.dynamic_words import absolute_temperature, is_angular, is_period, is_phase
from matcal.readers.impedance_columns import is_magnitude, is_real_part, resistance_of
from matcal.readers.plausibility import check_credible
from matcal.readers.recording import QUANTITIES, Recording
from matcal.readers.shear_angle import is_tensorial, names_angle
from matcal.readers.specimens import labels_of
from matcal.readers.unit_table import readings
from matcal.readers.units import (
    COMMON,
    dynamic_in,
    factor_for,
    is_common,
    measured,
    measures,
    modulus_by_unit,
    quantity_in,
    si_factor,
    unused_in,
    weighs,
)
from matcal.readers.vocabulary import (
    dynamic_quantity,
    is_dynamic,
    is_symbol,
    preference,
    quantity_of,
    relative_of,
    relaxing_of,
    size_of,
    true_quantity,
)
from touchcal.arrays import Array
from touchcal.errors import InputFileError

_LOOKED = 100  # rows that show how numbers are written
_SAME = 1e-3  # two columns of one quantity that differ by no more than this share of their range are one
_ANOTHER = 2.0  # ratio of two measures of one thing from which on they are of two things, as along and across
_OTHER_UNIT = 4.0  # ratio of the ranges of two columns of one quantity from which on they have two units
_INVERSE = {"a conductance": "resistance", "a resistivity": "conductivity"}
# what a displacement and a force are of
_REDUCED = {"strain": "displacement", "stretch": "displacement", "stress": "force"}
_TOGETHER = 0.95  # correlation from which on two columns run in the same way
_SHIFTED = {"time", "displacement", "force", "strain", "stretch", "stress"}  # quantities whose zero is found
_MEASURED = {"strain", "stretch", "stress", "displacement", "force", "resistance"}
_POISSON = re.compile(r"poisson|querkontraktion|^(nu|ν|ν_?12)$|泊松|ポアソン")
_MOVES = 0.005  # share by which a size changes in a test that moves across its load
_FEW = 3  # rows, below which one number in all of them says nothing
_DAYS = (36500.0, 55000.0)  # days since 1900 of the years 2000 to 2050, as spreadsheets number dates
_LOGARITHM = re.compile(r"(log|lg|ln)[ _]?(10)?[\s_(\[{]", re.IGNORECASE)
_ORDERED = re.compile(r"\bset|soll|command|demand|target|peak|\bmax|\bmin|limit|consigne|specif")
_UNITS = {"Pa": "MPa", "m": "mm", "N": "N", "s": "s", "A": "A", "V": "V", "ohm": "ohm", "S/m": "S/m", "Hz": "Hz",
          "K": "C", "1/Pa": "1/MPa"}
_PAIRS = (("stretch", "stress"), ("strain", "stress"), ("displacement", "force"), ("time", "current"),
          ("strain", "resistance"), ("stretch", "resistance"), ("displacement", "resistance"))


@dataclass(frozen=True)
class Header:
    """What stands above the numbers."""

    cells: Sequence[tuple[str, str | None]]  # name and unit (None where none is given) of each column
    line: int  # line that names the columns, or that of their units
    rows: range  # rows of the grid that hold the numbers


@dataclass(frozen=True)
class _Column:
    index: int
    name: str
    unit: str | None
    chosen: bool = False  # whether the unit is the user's word

    @property
    def inverse(self) -> str | None:
        """The quantity whose inverse a column holds by its unit: resistance of a conductance, conductivity of a
        resistivity, frequency of a period."""
        if is_period(self.name) and si_factor(self.unit or "", "time") is not None:
            return "frequency"
        return _INVERSE.get(measured(self.unit or "") or "")


def read_columns(grid: Grid, header: Header, vendor: str, selection: Selection | None = None, *,
                 metadata: Mapping[str, str] | None = None, sizes: Mapping[str, float] | None = None,
                 notes: Sequence[str] = ()) -> Recording:
    """The recording of a grid; InputFileError where columns cannot be distinguished, a unit is missing or of something
    else, a cell is no finite number, or values cannot be what their name says."""
    said, warned = list(notes), list[str]()
    header = _widened(grid, header, said)
    if selection is not None and selection.columns:
        columns = _selected(grid, header, selection)
        said.append("columns as given: " + ", ".join(f"{q} = '{c.name}' (column {c.index + 1})"
                                                     for q, c in columns.items()) + ".")
        header = _shortened(grid, header, columns, said)
    else:
        columns = _recognised(grid, header, said, warned)
    grid, rows = complete(grid, header.rows, {column.index: column.name for column in columns.values()}, said)
    header = Header(header.cells, header.line, rows)
    labelled, labels = labels_of(grid, [name for name, _ in header.cells], header.rows)
    if labels:
        said.append(f"column '{shown(labelled)}' says which of {len(set(labels))} specimens each row belongs to.")
    for quantity in {"strain", "stretch", "stress"} & set(columns):
        if true_quantity(columns[quantity].name):
            raise _true(grid, header, quantity, columns[quantity].name)
    values, units = {}, {}
    for quantity, column in columns.items():
        units[quantity] = column.unit or ""
        values[quantity] = _in_si(grid, header, quantity, column)
        said += _about(grid, quantity, column)
    _absolute(columns, values, said)
    if "resistance" in columns and "loss_tangent" in columns:
        values["resistance"], decided, minded = resistance_of(values["resistance"], values.pop("loss_tangent"),
                                                              shown(columns["resistance"].name))
        del columns["loss_tangent"], units["loss_tangent"]
        said.append(decided)
        warned += [minded] if minded else []
    _add_changes(columns, values, said)
    names = {quantity: column.name for quantity, column in columns.items()}
    check_credible(grid, header.line, values, names, units, said, warned, flag_for(grid, header),
                   _exchanged(grid, columns), _in_percent(grid, columns),
                   chosen=selection is not None and bool(selection.columns))
    return Recording(paths=(grid.path,), vendor=vendor, columns=values, names=names, units=units,
                     first_line=grid.lines[header.rows.start], metadata=metadata or {}, properties=sizes or {},
                     notes=tuple(said), cautions=tuple(warned), specimen=labels)


def _widened(grid: Grid, header: Header, said: list[str]) -> Header:
    """The header with a nameless cell for each column of numbers past the names; InputFileError where a row of text has
    more numbers than the others."""
    sizes = [len(grid.rows[n]) for n in header.rows]
    usual = Counter(sizes).most_common(1)[0][0] if sizes else 0
    marked = any(mark in cell for n in header.rows[:_LOOKED] for cell in grid.rows[n] for mark in ".,")
    if usual == 2 * sum(quantity_of(name) is not None for name, _ in header.cells) > 2 and not marked:
        raise InputFileError(grid.path, f"{usual} cells in a row below {len(header.cells)} names: the comma is both "
                                        "decimal mark and separator. Export with semicolons or tabs between the "
                                        "numbers, or with decimal points.", line=grid.lines[header.rows.start])
    width = max(len(header.cells), *sizes[:1], usual)
    if further := [n for n in header.rows if grid.numeric(grid.rows[n][width:])]:
        if not grid.sheet:
            raise InputFileError(grid.path, f"{len(grid.rows[further[0]])} cells in a table of {width} columns. "
                                            "Correct or delete the row.", line=grid.lines[further[0]])
        said.append(f"numbers to the right of the {width} columns, in {len(further)} rows, were left out.")
    return Header([*header.cells, *[("", None)] * (width - len(header.cells))], header.line, header.rows)


def _about(grid: Grid, quantity: str, column: _Column) -> list[str]:
    if quantity == "time" and column.index in grid.clocks:
        return [f"column '{shown(column.name)}' is a clock: seconds from its first row."]
    if column.inverse == quantity:
        what = "a period" if quantity == "frequency" else measured(column.unit or "")
        return [f"column '{shown(column.name)}' is {what}: {quantity} is its inverse."]
    if quantity == "force" and column.unit and weighs(column.unit):
        return [f"column '{shown(column.name)}' is in {column.unit}, a mass: the force is its weight, at 9.80665 N/kg."]
    return []


def _add_changes(columns: Mapping[str, _Column], values: dict[str, Array], said: list[str]) -> None:
    """A change relative to the initial value as the ratio to it, in place."""
    column = columns.get("relative_resistance")
    found = relative_of(column.name) if column is not None else None
    if column is not None and found is not None and found[1]:
        values["relative_resistance"] = 1 + values["relative_resistance"]
        said.append(f"column '{shown(column.name)}' is a relative change: ratio = 1 + change.")


def _absolute(columns: Mapping[str, _Column], values: dict[str, Array], said: list[str]) -> None:
    """Temperatures in K, phases as loss tangents, and frequencies without radians, in place."""
    if (column := columns.get("temperature")) is not None:
        values["temperature"] = absolute_temperature(values["temperature"], column.unit or "C")
        said += [] if column.unit else [f"column '{shown(column.name)}' has no unit: read as degrees Celsius."]
    if (column := columns.get("loss_tangent")) is not None and is_phase(column.name):
        values["loss_tangent"] = np.tan(values["loss_tangent"])
        said.append(f"column '{shown(column.name)}' is the phase: loss tangent = tan(phase).")
    if (column := columns.get("frequency")) is not None and not column.unit:
        said.append(f"column '{shown(column.name)}' has no unit: read in {_of_frequency(column)}.")


def _of_frequency(column: _Column) -> str:
    """The unit of a frequency whose column has none, or one over time: radians where its name counts them."""
    return "rad/s" if is_angular(column.name) else "Hz"


def _true(grid: Grid, header: Header, quantity: str, name: str) -> InputFileError:
    """Why a column of true strain or stress cannot be taken."""
    fix = ("force over the area at rest (by software that takes the volume as kept: nominal = true/(1 + nominal "
           "strain)); of a volumetric test choose it as pressure" if quantity == "stress" else
           "change of length over the length at rest (nominal = exp(true) - 1)")
    return InputFileError(grid.path, f"column '{shown(name)}' is named as a true (logarithmic or Cauchy) quantity, and "
                                     f"{quantity} here is nominal. Give the nominal one: {fix}. {_listed(header)}",
                          line=header.line)


def _in_percent(grid: Grid, columns: Mapping[str, _Column]) -> str:
    """`--columns "..."` of the columns that were taken, with the strain in per cent."""
    items = [f"{quantity}={column.index + 1}{':%' if quantity in ('strain', 'stretch') else ''}"
             f"{f':{column.unit}' if column.chosen and quantity not in ('strain', 'stretch') else ''}"
             for quantity, column in columns.items()]
    return _flag(grid, items)


def _exchanged(grid: Grid, columns: Mapping[str, _Column]) -> str:
    """`--columns "..."` of the columns that were taken, with those of strain and load exchanged, each quantity with the
    unit that it had."""
    index = {quantity: column.index for quantity, column in columns.items()}
    way = next((q for q in ("strain", "stretch", "displacement") if q in index), None)
    load = next((q for q in ("stress", "force", "resistance") if q in index), None)
    if way and load:
        index[way], index[load] = index[load], index[way]
    units = {q: column.unit or ("-" if q in ("strain", "stretch") else "") for q, column in columns.items()}
    return _flag(grid, [f"{q}={n + 1}{':' * bool(units[q])}{units[q]}" for q, n in index.items()])


def _selected(grid: Grid, header: Header, selection: Selection) -> dict[str, _Column]:
    out: dict[str, _Column] = {}
    for quantity, (requested, unit) in selection.columns.items():
        index = _index(grid, header, requested)
        if before := next((q for q, column in out.items() if column.index == index), None):
            raise InputFileError(
                grid.path, f"`columns` '{selection.text}': column {index + 1} '{shown(header.cells[index][0])}' is "
                f"given as {before} and as {quantity}. Choose another for one of them. {_listed(header)}",
                line=header.line)
        name, own = header.cells[index]
        if unit is None and own is None and not QUANTITIES[quantity] and quantity != "strain":
            own = "-"
        out[quantity] = _Column(index, name or f"column {index + 1}", unit if unit is not None else own,
                                unit is not None)
    return out


def _index(grid: Grid, header: Header, requested: str) -> int:
    names = [name.casefold() for name, _ in header.cells]
    if names.count(requested.casefold()) == 1:
        return names.index(requested.casefold())
    if requested.isdecimal() and 1 <= int(requested) <= len(names):
        return int(requested) - 1
    problem = "is the name of several columns" if requested.casefold() in names else "is no column"
    raise InputFileError(grid.path, f"`columns`: '{requested}' {problem}. {_listed(header)}", line=header.line)


def _listed(header: Header) -> str:
    cells = [f"{n} '{shown(name)}'" if name else f"{n} (no name)" for n, (name, _) in enumerate(header.cells, 1)]
    return f"Columns: {', '.join(cells[:24])}{' ...' if len(cells) > 24 else ''}."


def _shortened(grid: Grid, header: Header, columns: Mapping[str, _Column], said: list[str]) -> Header:
    """The header without the last rows, where the chosen columns are shorter than others next to them."""
    end = header.rows.stop
    while end > header.rows.start and not any(grid.cell(end - 1, c.index) for c in columns.values()):
        end -= 1
    if end < header.rows.stop:
        said.append(f"the last {header.rows.stop - end} rows have none of the chosen columns and were left out.")
    if end == header.rows.start:
        raise InputFileError(grid.path, "the chosen columns are empty.", line=header.line)
    return Header(header.cells, header.line, range(header.rows.start, end))


def _recognised(grid: Grid, header: Header, said: list[str], warned: list[str]) -> dict[str, _Column]:
    """Quantity -> column, by name; of several of one quantity the preferred, where they say the same."""
    found: dict[str, list[_Column]] = {}
    dynamic = is_dynamic(tuple(name for name, _ in header.cells))
    quantities = [dynamic_in(name, unit) if dynamic else quantity_in(name, unit) for name, unit in header.cells]
    for n, (name, unit) in enumerate(header.cells):
        if (quantity := quantities[n] or _ratio(name, {q for q in quantities if q})) is not None:
            found.setdefault(quantity, []).append(_Column(n, name, unit))
    # a conductance or a resistivity, or the period of a dynamic test, where nothing else says as much
    for column in (_Column(n, *cell) for n, cell in enumerate(header.cells) if quantities[n] is None):
        if column.inverse and dynamic == (column.inverse == "frequency") \
                and not {"current", column.inverse} & set(found):
            found[column.inverse] = [column]
    if not dynamic and not {"resistance", "conductivity", "current", "relative_resistance"} & set(found):
        found |= _impedance(grid, header, found)
    if len(found.get("strain", ())) > 1:  # shear components next to the strain along the load
        found["strain"] = [c for c in found["strain"] if not is_tensorial(c.name)] or found["strain"]
    # the table of a relaxation, without its strain
    if "time" in found and not {"stress", "force"} & set(found) and not dynamic:
        for column in (_Column(n, *cell) for n, cell in enumerate(header.cells) if quantities[n] is None):
            quantity = modulus_by_unit(column.name, column.unit) or relaxing_of(column.name)
            if quantity is not None and column.inverse is None:
                found.setdefault(quantity, []).append(column)
    true = [(quantity, name) for name, _ in header.cells if (quantity := true_quantity(name)) is not None]
    if true and not ({"strain", "stress"} <= set(found) or {"displacement", "force"} <= set(found)):
        raise _true(grid, header, *true[0])
    logs = [f"'{shown(name)}'" for name, _ in header.cells if _LOGARITHM.match(name.strip())]
    if logs and (len(found) < 2 or (dynamic and "frequency" not in found)):
        raise InputFileError(grid.path, f"column {logs[0]} is a logarithm: give the number itself (10^x, or e^x of "
                                        f"ln), with its unit. {_listed(header)}", line=header.line)
    if len(found) < 2:
        raise InputFileError(grid.path, f"fewer than two columns are known by name. {_listed(header)} Name them strain "
                                        "and stress, or displacement and force (and time), or strain and resistance, "
                                        "or time and modulus, or frequency, storage modulus and loss modulus, with a "
                                        "line of units below, or say which is which: "
                                        f"{flag_for(grid, header)}", line=header.line)
    out = {quantity: _one_of(grid, header, quantity, columns, said, warned) for quantity, columns in found.items()}
    labelled, _ = labels_of(grid, [name for name, _ in header.cells], header.rows)
    taken = {column.index for columns in found.values() for column in columns}
    left = [_Column(n, name, unit) for n, (name, unit) in enumerate(header.cells)
            if name not in ("", labelled) and n not in taken]
    rest = [(column.name, column.unit) for column in left]
    unused = {f"'{shown(name)}'": word for name, unit in rest if (word := _unused(name, unit)) is not None}
    others = [name for name in (f"'{shown(name)}'" for name, _ in rest) if name not in unused]
    warned += _left_alike(grid, header, out, left) + _left_across(grid, header, out, left)
    said += [f"column {name} left out: {word}, which is not used with these columns."
             for name, word in list(unused.items())[:12]]
    if others:
        said.append(f"column {others[0]} left out: not a known quantity." if len(others) == 1 else
                    f"columns {', '.join(others[:12])}{' ...' if len(others) > 12 else ''} left out: not known "
                    "quantities.")
    return out


def _impedance(grid: Grid, header: Header, known: Mapping[str, list[_Column]]) -> dict[str, list[_Column]]:
    """The resistance in a table that has none by name: the real part of an impedance, or its magnitude with its phase
    as `loss_tangent`; InputFileError where a magnitude in a unit of resistance has none and no load was measured."""
    columns = [_Column(n, *cell) for n, cell in enumerate(header.cells)]
    ohmic = [c for c in columns if si_factor(c.unit or "", "resistance") is not None]
    phases = [c for c in columns if is_phase(c.name)]
    if real := [c for c in ohmic if is_real_part(c.name)]:
        return {"resistance": real[:1]}
    if (magnitudes := [c for c in ohmic if is_magnitude(c.name)]) and not phases:
        if {"stress", "force", "pressure"} & set(known):
            return {}
        measures_of = {**{q: c for q, c in known.items() if q in ("strain", "stretch", "displacement")},
                       "resistance": magnitudes}
        items = [f"{quantity}={one[0].index + 1}" for quantity, one in measures_of.items()]
        raise InputFileError(grid.path, f"column '{shown(magnitudes[0].name)}' is the magnitude of an impedance, of "
                                        "which no resistance follows without its phase: add it as a column, phase "
                                        "(deg), or the real part Z'. Where the phase is below 5 deg the magnitude is "
                                        f"the resistance to 0.4 %: {_flag(grid, items)}",
                             line=header.line)
    return {"resistance": magnitudes[:1], "loss_tangent": phases[:1]} if magnitudes else {}


def _left_alike(grid: Grid, header: Header, used: Mapping[str, _Column], left: Sequence[_Column]) -> list[str]:
    """Cautions of columns left out that run like one in use, of the same unit or of a name that holds its quantity."""
    out: dict[str, list[str]] = {}
    for column in left:
        may = {*_words_within(column.name), *measures(column.unit or "")}
        may |= {_REDUCED[q] for q in may & set(_REDUCED) if q not in used}
        for quantity in sorted(may & set(used) & _MEASURED):
            if true_quantity(column.name) is None and not _ORDERED.search(column.name.lower()) \
                    and _runs_like(grid, header, quantity, used[quantity], column):
                out.setdefault(quantity, []).append(f"'{shown(column.name)}'")
    return [f"Column '{shown(used[quantity].name)}' of {grid.path.name} is used as {quantity}, and not "
            f"{', '.join(names[:6])}, which runs in the same way with other numbers: if that is the better measure, or "
            "another specimen, choose it with --columns." for quantity, names in out.items()]


def _left_across(grid: Grid, header: Header, used: Mapping[str, _Column], left: Sequence[_Column]) -> list[str]:
    """Cautions of columns left out that say how a specimen moves across its load, where nothing in use does."""
    if "lateral" in used or "lateral_stretch" in used or not {"stress", "force"} & set(used):
        return []
    out = []
    for column in left:
        if _POISSON.search(column.name.lower()):
            out.append(f"Column '{shown(column.name)}' of {grid.path.name} is not used: give its value with --poisson, "
                       "or the lateral strain.")
        elif size_of(column.name) in ("diameter", "width", "depth") and _varies(grid, header, column):
            out.append(f"Column '{shown(column.name)}' of {grid.path.name} is not used: if it was measured during the "
                       "test, give the lateral strain, its change over its first value, as a column lateral strain.")
    return out


def _varies(grid: Grid, header: Header, column: _Column) -> bool:
    try:
        values = grid.numbers(header.rows, column.index, column.name)
    except InputFileError:
        return False
    return float(np.ptp(values)) > _MOVES * abs(float(values[0]))


def _runs_like(grid: Grid, header: Header, quantity: str, used: _Column, other: _Column) -> bool:
    """Whether another column rises and falls with one in use, over a similar range, and is not it again."""
    try:
        a = _in_si(grid, header, quantity, used)
        reduced = _REDUCED.get(quantity) is None and any(
            _REDUCED.get(word) == quantity for word in _words_within(other.name))
        b = grid.numbers(header.rows, other.index, other.name) if reduced else _in_si(grid, header, quantity, other)
    except InputFileError:
        return False
    if reduced:
        return bool(np.ptp(a) and np.ptp(b)) and abs(float(np.corrcoef(a, b)[0, 1])) > _TOGETHER
    one, two = float(np.ptp(a)), float(np.ptp(b))
    if not one or not 1 / _OTHER_UNIT < two / one < _OTHER_UNIT:
        return False
    same = min(float(np.ptp(b - a)), float(np.ptp(b + a))) <= _SAME * one
    return not same and abs(float(np.corrcoef(a, b)[0, 1])) > _TOGETHER


def _ratio(name: str, known: set[str]) -> str | None:
    """The quantity of a column of ratios to an initial value, where a test uses it: R/R0, L/L0 where nothing else is a
    strain, and V/V0 next to a pressure or a stress where nothing else says that V is a voltage."""
    found = relative_of(name)
    if found is None:
        return None
    if found[0] in ("r", "resistance") or quantity_of(found[0]) == "resistance":
        return "relative_resistance"
    if found[0] in ("l", "h", "length", "height") and not {"strain", "stretch", "displacement"} & known:
        return "strain" if found[1] else "stretch"
    volumetric = {"pressure", "stress"} & known and known <= {"pressure", "stress", "time", "cycle", "deviation"}
    return "volume_ratio" if found[0] in ("v", "vol", "volume") and not found[1] and volumetric else None


def _unused(name: str, unit: str | None) -> str | None:
    if (found := relative_of(name)) is None:
        return unused_in(name, unit)
    return f"a {(quantity_of(found[0]) or found[0]).replace('_', ' ')} relative to its initial value"


def _one_of(grid: Grid, header: Header, quantity: str, columns: list[_Column], said: list[str],
            warned: list[str]) -> _Column:
    first, *others = sorted(columns, key=lambda column: preference(quantity, column.name))
    for other in others:
        how = _relation(grid, header, quantity, first, other)
        if how is None and (minded := _measured_apart(grid, header, quantity, first, other)) is not None:
            warned.append(minded)
            continue
        if how is None:
            raise InputFileError(
                grid.path, f"columns '{shown(first.name)}' ({first.index + 1}) and '{shown(other.name)}' "
                f"({other.index + 1}) are both {quantity} and differ. Say which to use: {flag_for(grid, header)}",
                line=header.line)
        said.append(f"two columns of {quantity}: '{shown(first.name)}' is used, '{shown(other.name)}' left out "
                    f"({how}).")
    return first


def _relation(grid: Grid, header: Header, quantity: str, first: _Column, other: _Column) -> str | None:
    """How another column follows from the first: the same, shifted, or with the sign turned; None where it does not.
    Two clocks need not agree: the preferred one counts."""
    a, b = (_in_si(grid, header, quantity, column) for column in (first, other))
    span = _SAME * float(np.ptp(a))
    for sign, word in ((1.0, "the same"), (-1.0, "the same with its sign turned")):
        shift = b - sign * a
        if np.ptp(shift) <= span and (quantity in _SHIFTED or abs(shift[0]) <= span):
            moved = f"{word}, shifted by {shift[0]:.6g} {QUANTITIES[quantity]}".strip()
            return word if abs(shift[0]) <= span else moved
    if quantity == "time" or preference(quantity, other.name) > preference(quantity, first.name):
        return SECOND_CHOICE.get(quantity)
    return None


def _measured_apart(grid: Grid, header: Header, quantity: str, first: _Column, other: _Column) -> str | None:
    """What is to be minded where the first choice was measured on the specimen alone and another column was not; None
    where their names do not say so, or they differ as two units or two directions do."""
    if quantity not in HOLDS_MORE or preference(quantity, other.name) <= preference(quantity, first.name):
        return None
    a, b = (_in_si(grid, header, quantity, column) for column in (first, other))
    one, two = float(np.abs(a).max()), float(np.abs(b).max())
    if not 1 / _ANOTHER < one / max(two, 1e-300) < _ANOTHER or float((a - a[0]) @ (b - b[0])) <= 0:
        return None
    unit = f" {QUANTITIES[quantity]}" if QUANTITIES[quantity] else ""
    return (f"Two columns of {grid.path.name} are {quantity}: '{shown(first.name)}' is used, as measured on the "
            f"specimen, and not '{shown(other.name)}', which holds {HOLDS_MORE[quantity]}: they reach {one:.3g} and "
            f"{two:.3g}{unit}.")


def _in_si(grid: Grid, header: Header, quantity: str, column: _Column) -> Array:
    values = grid.numbers(header.rows, column.index, column.name)
    if column.inverse == quantity:
        if not values.all():
            line = grid.lines[header.rows[int(np.argmin(np.abs(values)))]]
            raise InputFileError(grid.path, f"column '{shown(column.name)}' is 0, of which no {quantity} follows. "
                                            "Delete the row.", line=line)
        unit = column.unit or ""
        scale = si_factor(unit, "time") if quantity == "frequency" else None
        return np.asarray(1 / (values * (readings(unit)[0][0] if scale is None else scale)))
    scale = _factor(grid, header, quantity, column)
    with np.errstate(over="ignore"):
        values = values * scale
    if not np.all(np.isfinite(values)):
        row = header.rows[int(np.argmin(np.isfinite(values)))]
        raise InputFileError(grid.path, f"column '{shown(column.name)}': '{shown(grid.cell(row, column.index))}' is "
                                        "too large for a measurement.", line=grid.lines[row])
    return values


def _is_angle(quantity: str, name: str) -> bool:
    """Whether a column of plain numbers is an angle by its name, so that its unit is asked for."""
    return is_phase(name) if quantity == "loss_tangent" else quantity == "strain" and names_angle(name)


def _factor(grid: Grid, header: Header, quantity: str, column: _Column) -> float:
    unit = column.unit or {"temperature": "C", "frequency": _of_frequency(column)}.get(quantity, "")
    if quantity == "frequency" and is_angular(column.name) and "hz" not in unit.lower():
        unit = "rad/s"
    clock = quantity == "time" and column.index in grid.clocks
    value = 1.0 if clock else factor_for(column.name, unit, quantity)
    angle = _is_angle(quantity, column.name)
    unclear = not unit and (angle or (quantity == "strain" and not column.chosen and is_symbol(column.name)
                                      and len(column.name.strip()) > 1))
    if value is not None and not unclear:
        return value
    name = shown(column.name)
    if unit and (column.chosen or not is_common(unit)):
        other = next(iter(measures(unit)), None) or measured(unit)
        why = f"which measures {other}, not {quantity}" if other else "which is not known"
        raise InputFileError(grid.path, f"column '{name}' has the unit '{shown(unit)}'"
                                        f"{' by `columns`' if column.chosen else ''}, {why}. Units of {quantity}: "
                                        f"{', '.join(COMMON[QUANTITIES[quantity]])}. Write one of them in the file, or "
                                        f"give it with `columns`, for example {flag_for(grid, header)}",
                             line=header.line)
    if others := measures(unit) if unit else []:
        problem = (f"has the unit '{shown(unit)}', which is no unit of {quantity} but of {others[0]}: names and units, "
                   "or columns, look exchanged. If the numbers are right, say which column is which: "
                   f"{flag_for(grid, header)}")
        raise InputFileError(grid.path, f"column '{name}' {problem}", line=header.line)
    if quantity == "time" and not unit and _DAYS[0] < float(np.median(grid.numbers(header.rows, column.index, name))) \
            < _DAYS[1] and re.search(r"dat|stamp|stempel|zeitpunkt", column.name.lower()):
        flag = flag_for(grid, header)
        days = re.sub(rf"time={column.index + 1}:s", f"time={column.index + 1}:d", flag)
        raise InputFileError(grid.path, f"column '{name}' has no unit, and its numbers are those of a spreadsheet's "
                                        f"dates, days since 1900. Give them as days: {days}", line=header.line)
    if not unit and (value := _in_every_row(grid, header, column)) is not None:
        raise InputFileError(grid.path, f"column '{name}' is {value:g} in every row and has no unit, as that of a "
                                        "channel without a sensor. Choose another column, or, if it is right, add its "
                                        f"unit: {flag_for(grid, header)}", line=header.line)
    problem = f"has the unit '{shown(unit)}', which is no unit of {quantity}" if unit else "has no unit"
    example = {"Pa": "kPa", "m": "mm", "A": "mA", "": "deg" if angle else "-"}.get(QUANTITIES[quantity],
                                                                                   QUANTITIES[quantity])
    raise InputFileError(grid.path, f"column '{name}' {problem}. Put a row of units below the names (for example "
                                    f"{'deg' if angle else '-'},kPa), write '{name} ({example})', or give `columns` "
                                    "with the unit, for example "
                                    f"{flag_for(grid, header)}", line=header.line)


def _in_every_row(grid: Grid, header: Header, column: _Column) -> float | None:
    """The number that a column holds in every row; None where it holds several, or has too few rows to say."""
    if len(header.rows) < _FEW:
        return None
    numbers = grid.numbers(header.rows, column.index, column.name)
    return float(numbers[0]) if np.ptp(numbers) == 0 else None


def check_clock(recording: Recording) -> Recording:
    """The recording, if its time does not run backwards; InputFileError with the first such step otherwise."""
    time = recording.columns.get("time")
    if time is not None and np.any(back := np.diff(time) < 0):
        if np.all(np.diff(time) <= 0):
            raise InputFileError(recording.paths[0], "the time runs backwards in every row. Sort the rows by time.")
        at = int(np.argmax(back))
        raise InputFileError(
            recording.paths[0], f"the time runs backwards, from {time[at]:.9g} s to {time[at + 1]:.9g} s in sample "
            f"{at + 2}. Export each run to a file of its own.")
    return recording


def flag_for(grid: Grid, header: Header) -> str:
    """`--columns "..."` with quantities that the names suggest, else a guess from the numbers, as one sentence."""
    guess = (_from_abaqus(grid) or _from_dynamic(header) or _from_names(header) or _from_units(header)
             or _from_numbers(grid, header))
    items = [f"{quantity}={n + 1}{_unit(header, quantity, n)}" for quantity, n in guess.items()]
    return _flag(grid, items or ["strain=NUMBER", "stress=NUMBER:kPa"])


def _flag(grid: Grid, items: Sequence[str]) -> str:
    where = grid.path.name if not re.search(r"[,=\"]", grid.path.name) else ""
    return f"--columns \"{where}{'=' if where else ''}{','.join(items)}\" (columns by number or name)."


def _unit(header: Header, quantity: str, column: int) -> str:
    own = header.cells[column][1] if column < len(header.cells) else None
    if own is not None and si_factor(own, quantity) is not None and own.strip():
        return ""
    if not QUANTITIES[quantity]:
        return ":deg" if column < len(header.cells) and _is_angle(quantity, header.cells[column][0]) else ""
    units = [unit for _, unit in header.cells if unit and si_factor(unit, quantity) is not None]
    return f":{units[0] if units else _UNITS[QUANTITIES[quantity]]}"


def _from_abaqus(grid: Grid) -> dict[str, int]:
    """The columns of Abaqus's test data, by its keyword reference: stress before strain, pressure before J."""
    words = " ".join(cell for row in grid.rows[:_LOOKED] if row[0].startswith("*") for cell in row).upper()
    if found := re.search(r"\*(UNIAXIAL|BIAXIAL|PLANAR|SIMPLE SHEAR|VOLUMETRIC) TEST DATA", words):
        return {"pressure": 0, "volume_ratio": 1} if found[1] == "VOLUMETRIC" else {"stress": 0, "strain": 1} | (
            {} if found[1] == "SIMPLE SHEAR" or max(map(len, grid.rows[-3:])) < 3 else {"lateral": 2})
    return {}


def _from_dynamic(header: Header) -> dict[str, int]:
    """The columns of a dynamic test, by name."""
    names = [name for name, _ in header.cells]
    found = {quantity: n for n, name in enumerate(names) if (quantity := dynamic_quantity(name)) is not None}
    return found if is_dynamic(tuple(names)) else {}


def _from_names(header: Header) -> dict[str, int]:
    """The first columns, side by side, whose last words name two quantities that belong together, and their scatter."""
    words = [None if true_quantity(name) else _last_words(name) for name, _ in header.cells]
    for pair in _PAIRS:
        for n, quantity in enumerate(words):
            if quantity == pair[0]:
                near = [m for m in (n + 1, n - 1, n + 2) if 0 <= m < len(words) and words[m] == pair[1]]
                if near:
                    scatter = near[0] + 1 if near[0] + 1 < len(words) and words[near[0] + 1] == "deviation" else None
                    time = {"time": words.index("time")} if "time" in words and "time" not in pair else {}
                    return {pair[0]: n, pair[1]: near[0]} | time | ({} if scatter is None else {"deviation": scatter})
    return {}


def _last_words(name: str) -> str | None:
    """The quantity that a name, or its end, stands for."""
    words = re.split(r"[\s_\-.:]+|(?<=[a-z])(?=[A-Z])", re.sub(r"\s*[(\[][^()\[\]]*[)\]]\s*$", "", name))
    return next((found for k in range(min(len(words), 8)) if (found := quantity_of(" ".join(words[k:])))), None)


def _words_within(name: str) -> set[str]:
    """The quantities that a name, its end, or one of its words stands for."""
    found = {_last_words(name), *(quantity_of(word) for word in re.split(r"[\s_\-.:()\[\]]+", name) if len(word) > 2)}
    return {quantity for quantity in found if quantity is not None}


def _from_units(header: Header) -> dict[str, int]:
    """Columns by what their units measure, where these distinguish two quantities that belong together."""
    found: dict[str, int] = {}
    for n, (_, unit) in enumerate(header.cells):
        for quantity in measures(unit) if unit else []:
            if quantity in ("displacement", "force", "stress", "time", "current"):
                found.setdefault(quantity, n)
    pair = {"displacement", "force"}
    return {q: n for q, n in found.items() if q in pair or q == "time"} if pair <= set(found) else {}


def _from_numbers(grid: Grid, header: Header) -> dict[str, int]:
    """Of the first two columns whose names are of nothing else, the one that begins near 1 as the stretch, or else the
    first as the strain; the other as stress. A guess that shows how the option is written; only the user knows."""
    open_ = [n for n, (name, unit) in enumerate(header.cells)
             if _last_words(name) in (None, "strain", "stretch", "stress") and not true_quantity(name)
             and relative_of(name) is None and unused_in(name, unit) is None
             and (not unit or not (others := measures(unit)) or "stress" in others)][:2]
    if len(open_) < 2:
        return {}
    begins = [grid.number(grid.cell(header.rows.start, n)) if header.rows else None for n in open_]
    stretch = next((k for k, value in enumerate(begins) if value is not None and 0.9 <= value <= 1.1), None)
    if stretch is None:
        return {"strain": open_[0], "stress": open_[1]}
    return dict(sorted({"stretch": open_[stretch], "stress": open_[1 - stretch]}.items(), key=lambda item: item[1]))
