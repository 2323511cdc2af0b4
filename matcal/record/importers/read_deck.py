"""A deck of Abaqus, Ansys or LS-DYNA as a material card, so that published constants need no typing."""

import hashlib
from collections.abc import Callable
from datetime import UTC, datetime
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from matcal.card import MaterialCard
from matcal.readers.decoding import decode, lines_of, read_bytes
from matcal.record.exporters.base import UNITS, Units
from matcal.record.importers.material_parts import DeckMaterial, DeckProblem
from touchcal.errors import InputFileError

PROGRAMS = ("abaqus", "ansys", "lsdyna")
_SOFTEST_PA = 100.0  # initial shear modulus below which stresses are taken for MPa or GPa where no unit is stated


def import_deck(deck: Path | str, program: str | None = None, units: str | None = None,
                material: str | None = None) -> MaterialCard:
    """The law of a material of a deck, its relaxation, shift and softening, as a card.

    Parameters
    ----------
    deck
        File of Abaqus or CalculiX (.inp), Ansys Mechanical APDL or LS-DYNA (.k), or a part of one.
    program
        "abaqus" (CalculiX too), "ansys" or "lsdyna"; None: by its keywords.
    units
        Units of the deck: "SI", "mm-t-s" (MPa) or "mm-kg-ms" (GPa); None: SI, refused where mu_0 is below 100 Pa.
    material
        Name or number of the material; needed where several of the deck have a law.

    Returns
    -------
    MaterialCard
        Without intervals; what was assumed and left out is in `provenance["decisions"]`.

    Raises
    ------
    InputFileError
        Naming the line that cannot be read, or the law that the card does not have.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import matcal
    >>> deck = Path(tempfile.mkdtemp()) / "silicone.inp"
    >>> _ = deck.write_text("*Material, name=silicone\\n*Hyperelastic, neo hooke\\n0.02, 0.\\n")
    >>> matcal.import_deck(deck, units="mm-t-s").law.mu_0_Pa
    40000.0
    """
    path = Path(deck)
    data = read_bytes(path)
    text = "\n".join(lines_of(decode(data, path, lambda _: True)[0]))
    if program is not None and program not in PROGRAMS:
        raise ValueError(f"program '{program}' is unknown; known: {', '.join(PROGRAMS)}.")
    if units is not None and units not in UNITS:
        raise ValueError(f"units '{units}' are unknown; known: {', '.join(UNITS)}.")
    reader = _reader(path, text, program)
    try:
        name, read = _chosen(reader.materials(text), material)
        found = read(UNITS[units or "SI"])
    except DeckProblem as problem:
        raise InputFileError(path, str(problem), line=problem.line) from None
    if units is None and found.law.mu_0_Pa < _SOFTEST_PA:
        raise InputFileError(path, f"in Pa mu_0 is {found.law.mu_0_Pa:.4g}, softer than any gel. State the deck's "
                                   f"units with `units`: {', '.join(UNITS)}.")
    program = reader.__name__.rpartition(".")[2].removesuffix("_deck")
    said = (f"Read from a deck of {program}, material '{name}', in units {units or 'SI, as none were given'}; the deck "
            "has no intervals.", *found.notes)
    return MaterialCard(name or path.stem, found.law, found.prony, shift=found.shift, softening=found.softening,
                        provenance={"files": [{"name": path.name, "sha256": hashlib.sha256(data).hexdigest()}],
                                    "versions": {"touchcal": version("touchcal")}, "synthetic": False,
                                    "date": datetime.now(UTC).isoformat(timespec="seconds"),
                                    "decisions": list(said), "decisions_of": {"deck": len(said)}})


def _reader(path: Path, text: str, program: str | None):
    for name in PROGRAMS if program is None else (program,):
        module = import_module(f"matcal.record.importers.{name}_deck")
        if module.recognised(text):
            return module
    raise InputFileError(path, f"no law of {'Abaqus, Ansys or LS-DYNA' if program is None else program} is in it: "
                               "expected *HYPERELASTIC or *HYPERFOAM, TB,HYPER, or *MAT_... of a rubber or foam. Give "
                               "the file in which the material stands.")


def _chosen(found, material: str | None) -> tuple[str, Callable[[Units], DeckMaterial]]:
    known = {name.lower(): name for name in found}
    if not found:
        raise DeckProblem(None, "none of its materials has a law of the card.")
    if material is None and len(found) > 1:
        raise DeckProblem(None, f"several materials have a law: {', '.join(found)}. Choose one by `material`.")
    if material is not None and material.lower() not in known:
        raise DeckProblem(None, f"material '{material}' is none of those with a law: {', '.join(found)}.")
    name = known[material.lower()] if material is not None else next(iter(found))
    return name, found[name]
