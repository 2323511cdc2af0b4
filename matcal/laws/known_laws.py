"""Every law that there is, by its name: a new law is one file and its line here, or an entry point `touchcal.laws` of
an installed package."""

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from matcal.laws.law import Law, Ranges
from touchcal.entry_points import added

LAWS = {"hyperfoam": "matcal.laws.hyperfoam:Hyperfoam",
        "neo_hooke": "matcal.laws.neo_hooke:NeoHooke",
        "mooney_rivlin": "matcal.laws.rubbers.mooney_rivlin:MooneyRivlin",
        "mooney_rivlin_5": "matcal.laws.rubbers.mooney_rivlin_5:MooneyRivlin5",
        "yeoh": "matcal.laws.rubbers.yeoh:Yeoh",
        "ogden": "matcal.laws.rubbers.ogden:Ogden",
        "gent": "matcal.laws.rubbers.gent:Gent",
        "arruda_boyce": "matcal.laws.rubbers.arruda_boyce:ArrudaBoyce",
        "extended_tube": "matcal.laws.rubbers.extended_tube:ExtendedTube"}


def law_type(name: str) -> type[Law]:
    """The law of a name, its module imported now; ValueError lists the known."""
    if name in LAWS:
        module, _, found = LAWS[name].partition(":")
        return getattr(import_module(module), found)
    if name not in added("laws"):
        raise ValueError(f"law '{name}' is unknown; known: {', '.join([*LAWS, *added('laws')])}.")
    return added("laws")[name]


def law_of(name: str, values: Sequence[Sequence[float]], moduli: str = "longterm",
           strain_range: Ranges | None = None) -> Law:
    """The law of a name from plain numbers, as those of `matcal.laws.law.values_of`."""
    kind: Any = law_type(name)
    return kind(*(value if p.each_term else value[0] for p, value in zip(kind.parameters, values, strict=True)),
                moduli, strain_range or {})
