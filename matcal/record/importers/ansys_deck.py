"""Ansys Mechanical APDL: TB,HYPER with TB,PRONY, TB,SHIFT and TB,CDM of each material number.

Commands in upper or lower case, several a line parted by $; ! begins a comment; TBDATA without a place goes on after
the last; names given by NAME=value or *SET may stand for numbers, in sums and products too.

Source: as `matcal.record.exporters.ansys`; Ansys Mechanical APDL Material Reference, "Hyperelasticity".
"""

import ast
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from matcal.laws.histories.damage import Damage
from matcal.laws.histories.time_temperature import Wlf
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.extended_tube import ExtendedTube
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.ogden import Ogden
from matcal.record.exporters.base import Units
from matcal.record.importers.material_parts import (
    DeckMaterial,
    DeckProblem,
    Materials,
    hyperfoam,
    kelvin,
    made,
    polynomial,
    prony_of,
    real,
    volume_note,
    with_volume,
)

_READ = ("HYPER", "PRONY", "SHIFT", "CDM")
_MOONEY = {2: ("10", "01"), 3: ("10", "01", "11"), 5: ("10", "01", "20", "11", "02")}
_SUMS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
         ast.Pow: operator.pow}


@dataclass
class Table:
    """A material table as it is filled."""

    line: int
    kind: str  # HYPER, PRONY, ...
    option: str
    size: str  # what stands as NPTS
    values: dict[int, float] = field(default_factory=dict)  # place from 1 -> value
    temperatures: int = 0

    @property
    def pairs(self) -> list[tuple[float, float]]:
        """Values two by two."""
        places = range(1, max(self.values, default=0), 2)
        return [(self.values.get(k, 0.0), self.values.get(k + 1, 0.0)) for k in places]


def recognised(text: str) -> bool:
    """Whether a command of the text fills a table of a law."""
    return any(words[0] == "TB" and words[1:2] and words[1].startswith("HYPE") for _, words in _commands(text))


def materials(text: str) -> Materials:
    """Every material number with a law."""
    found, names, left = dict[str, list[Table]](), dict[str, float](), dict[str, list[str]]()
    table: Table | None = None
    zero: float | None = None
    for line, words in _commands(text):
        key, rest = words[0], [*words[1:], *[""] * 6]
        if key == "*SET" or "=" in key:
            name, _, value = (f"{rest[0]}={rest[1]}" if key == "*SET" else ",".join(words)).partition("=")
            try:
                names[name.strip()] = _number(value, line, names)
            except DeckProblem:
                names.pop(name.strip(), None)  # used by nothing that is read, or refused there
        elif key == "TB":
            kind, material = rest[0][:4] if rest[0].startswith("HYPE") else rest[0], rest[1] or "1"
            table = Table(line, "HYPER" if kind == "HYPE" else kind, rest[4], rest[3])
            if table.kind in _READ:
                found.setdefault(material, []).append(table)
            else:
                left.setdefault(material, []).append(f"TB,{table.kind}")
                table = None
        elif key == "MP":
            left.setdefault(rest[1] or "1", []).append(f"MP,{rest[0]}")
        elif key == "TOFFST":
            zero = -_number(rest[0], line, names)
        elif key == "TBTEMP" and table is not None:
            table.temperatures += 1
        elif key == "TBDATA" and table is not None:
            place = int(_number(rest[0], line, names)) if rest[0] else max(table.values, default=0) + 1
            for k, word in enumerate(words[2:]):
                if word:
                    table.values[place + k] = _number(word, line, names)
    return {name: partial(_material, tables, zero, left.get(name, ())) for name, tables in found.items()
            if any(one.kind == "HYPER" for one in tables)}


def _commands(text: str) -> list[tuple[int, list[str]]]:
    """Line and words, in capitals, of every command."""
    return [(number, [word.strip().upper() for word in command.split(",")])
            for number, line in enumerate(text.splitlines(), 1)
            for command in line.partition("!")[0].split("$") if command.strip()]


def _number(text: str, line: int, names: Mapping[str, float]) -> float:
    """A number, or a sum or product of numbers and names."""
    def value(node: ast.expr) -> float:
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return float(node.value)
        if isinstance(node, ast.Name) and node.id in names:
            return names[node.id]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return -value(node.operand)
        if isinstance(node, ast.BinOp) and type(node.op) in _SUMS:
            return _SUMS[type(node.op)](value(node.left), value(node.right))
        raise DeckProblem(line, f"'{text}' is no number. Write the number itself in its place.")
    try:
        return real(text, line)
    except DeckProblem:
        try:
            return float(value(ast.parse(text.strip(), mode="eval").body))
        except (SyntaxError, ArithmeticError):
            raise DeckProblem(line, f"'{text}' is no number. Write the number itself in its place.") from None


def _material(tables: Sequence[Table], zero: float | None, left: Sequence[str], units: Units) -> DeckMaterial:
    for one in tables:
        if one.temperatures > 1:
            raise DeckProblem(one.line, f"TB,{one.kind} has values at {one.temperatures} temperatures. Keep those of "
                                        "one.")
        if not one.values:
            raise DeckProblem(one.line, f"TB,{one.kind} has no TBDATA.")
    laws = [one for one in tables if one.kind == "HYPER"]
    if len(laws) > 1:
        raise DeckProblem(laws[1].line, "the material has a second law. Keep one.")
    law, notes = _law(laws[0], units)
    series = {kind: [(a, t / units.time) for one in tables if one.kind == "PRONY" and one.option == kind
                     for a, t in one.pairs] for kind in ("SHEAR", "BULK")}
    where = next((one.line for one in tables if one.kind == "PRONY"), None)
    if where is not None and not any(series.values()):
        raise DeckProblem(where, "TB,PRONY is read with the options SHEAR and BULK alone.")
    prony, more = prony_of(where, law, series["SHEAR"], series["BULK"])
    law = replace(law, moduli="instantaneous") if prony else law
    shift = next((one for one in tables if one.kind == "SHIFT"), None)
    damage = next((one for one in tables if one.kind == "CDM"), None)
    return DeckMaterial(law, prony, _shift(shift, zero) if shift else None, _softening(damage, units) if damage else
                        None, (*notes, *more, *((f"Left out: {', '.join(left)}.",) if left else ())))


def _law(table: Table, units: Units) -> tuple[Law, tuple[str, ...]]:
    line, unit, option = table.line, units.stress, table.option or "MOONEY"
    values = [table.values.get(k, 0.0) for k in range(1, max(table.values) + 1)]

    def first(count: int) -> list[float]:
        return [*values, *[0.0] * count][:count]

    default = 2 if option in ("MOONEY", "MOON") else 1
    n = int(real(table.size, line)) or default
    if option == "FOAM":
        data = first(3 * n)
        mu = [m * a / 2 / unit for m, a in zip(data[:2 * n:2], data[1:2 * n:2], strict=True)]
        return hyperfoam(line, mu, data[1:2 * n:2], [b / (1 + 2 * b) for b in data[2 * n:]]), ()
    if option == "BLATZ":
        return made(line, Hyperfoam, [first(1)[0] / unit], [-2.0], [0.25]), ()
    if option in ("BOYCE", "GENT"):
        mu, lock, d = first(3)
        law = with_volume(line, made(line, ArrudaBoyce if option == "BOYCE" else Gent, mu / unit, lock), [d * unit])
        return law, volume_note(law, f"TB,HYPER,,,,{option}")
    if option == "ETUBE":
        g_c, delta, g_e, beta, d = first(5)
        return with_volume(line, made(line, ExtendedTube, g_c / unit, delta, g_e / unit, beta), [d * unit]), ()
    if option in ("OGDEN", "OGDE"):
        data = first(3 * n)
        mu, alpha = [m * a / 2 / unit for m, a in zip(data[:2 * n:2], data[1:2 * n:2], strict=True)], data[1:2 * n:2]
        return with_volume(line, made(line, Ogden, mu, alpha), [d * unit for d in data[2 * n:]]), ()
    names, spare = _polynomial(line, option, n)
    data = first(len(names) + spare)
    law = polynomial(line, {ij: v / unit for ij, v in zip(names, data, strict=False)})
    return with_volume(line, law, [d * unit for d in data[len(names):]]), ()


def _polynomial(line: int, option: str, n: int) -> tuple[tuple[str, ...], int]:
    """Names of C_ij and the number of d_i; DeckProblem for laws that the card does not have."""
    if option == "NEO":
        return ("10",), 1
    if option == "YEOH":
        return tuple(f"{i}0" for i in range(1, n + 1)), n
    if option in ("MOONEY", "MOON") and n in _MOONEY:
        return _MOONEY[n], 1
    if option == "POLY" and n in (1, 2):
        return _MOONEY[2 if n == 1 else 5], n
    raise DeckProblem(line, f"TB,HYPER,,,{n},{option} is no law of the card. Known: NEO, MOONEY with 2, 3 or 5 "
                            "constants, POLY to 2, YEOH to 3, OGDEN, GENT, BOYCE, ETUBE, FOAM, BLATZ.")


def _shift(table: Table, zero: float | None) -> Wlf:
    if table.option != "WLF" or len(table.values) < 3:
        raise DeckProblem(table.line, f"TB,SHIFT,,,,{table.option} is no shift of the card. Known: WLF with T_r, C_1, "
                                      "C_2.")
    reference, c1, c2 = (table.values.get(k, 0.0) for k in (1, 2, 3))
    return Wlf(c1, c2, kelvin(table.line, reference, zero))


def _softening(table: Table, units: Units) -> Damage:
    if table.option != "PSE2":
        raise DeckProblem(table.line, f"TB,CDM,,,,{table.option} is no softening of the card. Known: PSE2.")
    r, m, beta = (table.values.get(k, 0.0) for k in (1, 2, 3))
    try:
        return Damage(r, m / units.stress, beta)
    except ValueError as error:
        raise DeckProblem(table.line, str(error)) from None
