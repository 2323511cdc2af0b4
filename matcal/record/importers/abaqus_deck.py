"""Abaqus and CalculiX: *HYPERFOAM, *HYPERELASTIC, *VISCOELASTIC, *TRS and *MULLINS EFFECT of each *MATERIAL.

Keywords and parameters in upper or lower case, with or without blanks; ** begins a comment; a keyword line that ends in
a comma goes on in the next; data lines hold values parted by commas, at most eight, of which left-out ones are 0.

Source: as `matcal.record.exporters.abaqus`; Abaqus Analysis User's Guide, "Input syntax rules" (1.2.1).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from matcal.laws.histories.damage import Damage
from matcal.laws.histories.time_temperature import GAS_J_PER_MOL_K, Arrhenius, Shift, Wlf
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
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

_PER_LINE = 8
_LAWS = ("HYPERFOAM", "HYPERELASTIC")
_READ = (*_LAWS, "VISCOELASTIC", "TRS", "MULLINSEFFECT")
_LEFT_OUT = ("DENSITY", "DAMPING", "EXPANSION", "ELASTIC", "PLASTIC", "PERMANENTSET", "HYSTERESIS", "CREEP", "DEPVAR",
             "CONDUCTIVITY", "SPECIFICHEAT", "ELECTRICALCONDUCTIVITY", "USERMATERIAL")
_MODULI = {"INSTANTANEOUS": "instantaneous", "LONGTERM": "longterm"}
_POLYNOMIALS = {1: ("10", "01"), 2: ("10", "01", "20", "11", "02")}


@dataclass(frozen=True)
class Keyword:
    """A keyword line with its data lines."""

    line: int
    name: str  # in capitals without blanks
    options: Mapping[str, str]  # in capitals without blanks and hyphens, "" where a parameter has no value
    data: tuple[tuple[int, tuple[float, ...]], ...]  # line, values


def recognised(text: str) -> bool:
    """Whether a line of the text is a keyword of this program."""
    return any(_plain(line.partition(",")[0]) in tuple(f"*{name}" for name in _LAWS) for line in text.splitlines())


def materials(text: str) -> Materials:
    """Every material with a law."""
    words, found = list(_keywords(text)), dict[str, list[Keyword]]()
    constants = next((w for w in words if w.name == "PHYSICALCONSTANTS"), None)
    name: str | None = ""
    for word in words:
        if word.name == "MATERIAL":
            name = word.options.get("NAME", "")
        elif word.name not in (*_READ, *_LEFT_OUT):
            name = None if name else name
        elif name is not None:
            found.setdefault(name, []).append(word)
    return {name: partial(_material, parts, constants) for name, parts in found.items()
            if any(part.name in _LAWS for part in parts)}


def _keywords(text: str) -> Iterator[Keyword]:
    """Keywords with their data; the data of those that are not read are not looked at."""
    head, at, data = "", 0, list[tuple[int, str]]()
    for number, raw in enumerate([*text.splitlines(), "*"], 1):
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*"):
            if head:
                yield _keyword(head, at, data)
            head, at, data = line, number, []
        elif head.rstrip().endswith(","):
            head += line
        else:
            data.append((number, line))


def _keyword(head: str, line: int, data: Sequence[tuple[int, str]]) -> Keyword:
    name, *options = head[1:].split(",")
    parted = [option.partition("=") for option in options if option.strip()]
    named = {_plain(key).replace("-", ""): value.strip().strip('"') for key, _, value in parted}
    read = _plain(name) in (*_READ, "PHYSICALCONSTANTS")
    return Keyword(line, _plain(name), named, tuple(
        (at, tuple(real(value, at) for value in values.rstrip(", ").split(","))) for at, values in data if read))


def _plain(text: str) -> str:
    return "".join(text.split()).upper()


def _material(parts: Sequence[Keyword], constants: Keyword | None, units: Units) -> DeckMaterial:
    by_name = {part.name: part for part in parts}
    if len(laws := [part for part in parts if part.name in _LAWS]) > 1:
        raise DeckProblem(laws[1].line, "the material has a second law. Keep one.")
    [part] = laws
    _no_test_data(part)
    law, notes = _foam(part, units) if part.name == "HYPERFOAM" else _rubber(part, units)
    word = part.options.get("MODULI", "LONG TERM")
    if _plain(word) not in _MODULI:
        raise DeckProblem(part.line, f"MODULI={word} is unknown; known: INSTANTANEOUS, LONG TERM.")
    law = replace(law, moduli=_MODULI[_plain(word)])
    prony, more = _relaxation(by_name["VISCOELASTIC"], law, units) if "VISCOELASTIC" in by_name else (None, ())
    left = [f"*{part.name}" for part in parts if part.name in _LEFT_OUT]
    return DeckMaterial(law, prony, _shift(by_name["TRS"], constants) if "TRS" in by_name else None,
                        _softening(by_name["MULLINSEFFECT"], units) if "MULLINSEFFECT" in by_name else None,
                        (*notes, *more, *((f"Left out: {', '.join(left)}.",) if left else ())))


def _no_test_data(part: Keyword) -> None:
    if "TESTDATAINPUT" in part.options or any(key.endswith("TESTDATA") for key in part.options):
        raise DeckProblem(part.line, f"*{part.name} holds test data and no constants. Give the data to `matcal fit`.")


def _constants(part: Keyword, count: int) -> list[float]:
    """The constants, as many as the law has, those left out 0; DeckProblem for those of several temperatures."""
    lines = -(-count // _PER_LINE)
    values = [v for _, row in part.data[:lines] for v in row]
    further = part.data[lines:]
    if not values:
        raise DeckProblem(part.line, f"*{part.name} has no constants.")
    if len(further) > (count % _PER_LINE == 0):
        raise DeckProblem(further[-1][0], f"*{part.name} has {count} constants, and this line goes on, as for a second "
                                          "temperature. Keep those of one.")
    return [*values, *[0.0] * count][:count]


def _terms(part: Keyword) -> int:
    n = real(part.options.get("N", "1"), part.line)
    if not (n == int(n) and 1 <= n <= 6):
        raise DeckProblem(part.line, f"N must be 1 to 6, got {n:g}.")
    return int(n)


def _foam(part: Keyword, units: Units) -> tuple[Law, tuple[str, ...]]:
    n = _terms(part)
    values = _constants(part, 3 * n)
    return hyperfoam(part.line, [v / units.stress for v in values[:2 * n:2]], values[1:2 * n:2], values[2 * n:]), ()


def _rubber(part: Keyword, units: Units) -> tuple[Law, tuple[str, ...]]:
    options, line, unit = part.options, part.line, units.stress
    if "ARRUDABOYCE" in options:
        mu, lock, d = _constants(part, 3)
        law = with_volume(line, made(line, ArrudaBoyce, mu / unit, lock), [d * unit])
        return law, volume_note(law, "*HYPERELASTIC, ARRUDA-BOYCE")
    if "OGDEN" in options:
        n = _terms(part)
        values = _constants(part, 3 * n)
        law = made(line, Ogden, [v / unit for v in values[:2 * n:2]], values[1:2 * n:2])
        return with_volume(line, law, [d * unit for d in values[2 * n:]]), ()
    names, n = _polynomial(part)
    values = _constants(part, len(names) + n)
    law = polynomial(line, {ij: v / unit for ij, v in zip(names, values, strict=False)})
    return with_volume(line, law, [d * unit for d in values[len(names):]]), ()


def _polynomial(part: Keyword) -> tuple[tuple[str, ...], int]:
    """Names of C_ij and the number of D_i; DeckProblem for laws that the card does not have."""
    options = part.options
    if "NEOHOOKE" in options:
        return ("10",), 1
    if "MOONEYRIVLIN" in options:
        return ("10", "01"), 1
    if "YEOH" in options:
        return ("10", "20", "30"), 3
    n = _terms(part)
    if "REDUCEDPOLYNOMIAL" in options:
        return tuple(f"{i}0" for i in range(1, n + 1)), n
    named = [key for key in options if key not in ("POLYNOMIAL", "N", "MODULI")]
    if n not in _POLYNOMIALS or named:
        what = f"POLYNOMIAL, N={n}" if not named else named[0]
        raise DeckProblem(part.line, f"*HYPERELASTIC, {what} is no law of the card. Known: neo Hooke, Mooney-Rivlin, "
                                     "Yeoh, Ogden, Arruda-Boyce, polynomial to N=2, reduced polynomial to N=3.")
    return _POLYNOMIALS[n], n


def _relaxation(part: Keyword, law: Law, units: Units) -> tuple[Prony | None, tuple[str, ...]]:
    word = part.options.get("TIME", "")
    if _plain(word) != "PRONY":
        raise DeckProblem(part.line, "*VISCOELASTIC is read with TIME=PRONY alone. Give test data of relaxation, creep "
                                     "or frequency to `matcal fit`.")
    rows = [(*row, 0.0, 0.0)[:3] for _, row in part.data]
    return prony_of(part.line, law, *([(row[k], row[2] / units.time) for row in rows] for k in (0, 1)))


def _shift(part: Keyword, constants: Keyword | None) -> Shift:
    kind = _plain(part.options.get("DEFINITION", "WLF"))
    zero, gas = None, GAS_J_PER_MOL_K
    if constants is not None:
        named = constants.options
        zero = real(named["ABSOLUTEZERO"], constants.line) if "ABSOLUTEZERO" in named else None
        gas = real(named["UNIVERSALGAS"], constants.line) if "UNIVERSALGAS" in named else gas
    values = [v for _, row in part.data for v in row]
    if kind == "WLF" and len(values) >= 3:
        return Wlf(values[1], values[2], kelvin(part.line, values[0], zero))
    if kind == "ARRHENIUS" and len(values) >= 2:
        return Arrhenius(values[0] * GAS_J_PER_MOL_K / gas, kelvin(part.line, values[1], zero))
    raise DeckProblem(part.line, f"*TRS, DEFINITION={kind} with {len(values)} values is no shift of the card. Known: "
                                 "WLF with theta_0, C_1, C_2; ARRHENIUS with E_0, theta_0.")


def _softening(part: Keyword, units: Units) -> Damage:
    _no_test_data(part)
    r, m, beta = _constants(part, 3)
    try:
        return Damage(r, m / units.stress, beta)
    except ValueError as error:
        raise DeckProblem(part.line, str(error)) from None


