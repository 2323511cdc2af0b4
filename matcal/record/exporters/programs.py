"""The programs that cards are exported to: one word a program, or an entry point `touchcal.exporters` of an installed
package."""

from importlib import import_module

from matcal.record.exporters.base import Target
from touchcal.entry_points import added

_BUILT_IN = ("abaqus", "calculix", "febio", "lsdyna", "ansys", "openradioss")
_FORMER = {"radioss": "openradioss"}  # former words, still read


def targets() -> tuple[str, ...]:
    """Words of all programs."""
    return (*_BUILT_IN, *added("exporters"))


def target_of(name: str) -> Target:
    """The program of this word, its module imported now; ValueError lists the known."""
    if (name := _FORMER.get(name, name)) in _BUILT_IN:
        return import_module(f"matcal.record.exporters.{name}").TARGET
    if name not in targets():
        raise ValueError(f"target '{name}' is unknown; known: {', '.join(targets())}.")
    return added("exporters")[name]
