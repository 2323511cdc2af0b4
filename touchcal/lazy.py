"""Public names of a package that are imported when they are first used, so that importing the package stays light."""

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def attach(package_name: str, exports: Mapping[str, str]) -> tuple[
        Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` (PEP 562) of a package, from its public names and the modules that define
    them.

    The same names stand under `if TYPE_CHECKING:` in the package, for checkers of types and for hashes of code.

    >>> find, names, public = attach("touchcal", {"Stopped": "touchcal.signals"})
    >>> public
    ['Stopped']
    >>> find("Stopped").__module__
    'touchcal.signals'
    """
    def find(name: str) -> Any:
        if name not in exports:
            raise AttributeError(f"module {package_name!r} has no attribute {name!r}; it exports "
                                 f"{', '.join(sorted(exports))}")
        found = getattr(importlib.import_module(exports[name]), name)
        setattr(sys.modules[package_name], name, found)
        return found

    return find, lambda: sorted(exports), sorted(exports)
