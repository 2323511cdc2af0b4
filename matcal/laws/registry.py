"""Every law that there is, by its name: a new law is one file, and its line here."""

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from matcal.laws.law import Law, Ranges

LAWS = {"hyperfoam": "matcal.laws.hyperfoam:Hyperfoam",
        "neo_hooke": "matcal.laws.neo_hooke:NeoHooke"}


def law_type(name: str) -> type[Law]:
    """The law of a name; ValueError for an unknown one."""
    if name not in LAWS:
        raise ValueError(f"law '{name}' is unknown; known: {', '.join(LAWS)}.")
    module, _, found = LAWS[name].partition(":")
    return getattr(import_module(module), found)


def law_of(name: str, values: Sequence[Sequence[float]], moduli: str = "longterm",
           strain_range: Ranges | None = None) -> Law:
    """The law of a name from plain numbers, as those of `matcal.laws.law.values_of`."""
    kind: Any = law_type(name)
    return kind(*(value if p.each_term else value[0] for p, value in zip(kind.parameters, values, strict=True)),
                moduli, strain_range or {})
