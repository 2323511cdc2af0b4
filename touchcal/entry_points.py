"""Parts that installed packages add: readers, exporters, formats, profiles, laws, learners, without a fork.

Upper packages of this project add to lower ones in the same way."""

import warnings
from functools import cache
from importlib.metadata import entry_points
from typing import Any

# what may be added, each the group `touchcal.WORD` of entry points
KINDS = ("readers", "exporters", "formats", "profiles", "laws", "conduction", "learners", "quantities")


@cache
def added(kind: str) -> dict[str, Any]:
    """Name -> object of every entry point `touchcal.KIND` of the installed packages, in the order of their names; one
    that cannot be imported is left out with a warning that names it. To be called when a part is used: while a package
    is imported, the module of a part is not whole yet."""
    found = {}
    for point in sorted(entry_points(group=f"touchcal.{kind}"), key=lambda point: point.name):
        try:
            found[point.name] = point.load()
        except Exception as error:  # whatever a foreign module does when it is imported
            warnings.warn(f"'{point.name}' of touchcal.{kind} is left out: {point.value} cannot be imported ({error}). "
                          "Correct or uninstall its package.", stacklevel=2)
    return found
