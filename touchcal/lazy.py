"""Imports that wait for their first use: public names of a package, and packages that only an extra of the installation
brings."""

import ast
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

# package as it is imported -> its name, and its extra in pyproject.toml
PACKAGES = {
    "numba": ("numba", "fast"), "pyarrow": ("pyarrow", "data"), "h5py": ("h5py", "data"),
    "arviz": ("arviz", "posterior"), "matplotlib": ("matplotlib", "reports"), "typst": ("typst", "reports"),
    "torch": ("PyTorch", "networks"), "pyvista": ("pyvista", "draw"), "pythoncdt": ("pythoncdt", "outlines"),
    "ezdxf": ("ezdxf", "outlines"), "svgelements": ("svgelements", "outlines"),
    "distributed": ("distributed", "cluster"), "serial": ("pyserial", "serial"), "uvicorn": ("uvicorn", "live"),
    "starlette": ("starlette", "live"), "websockets": ("websockets", "live"), "nptdms": ("npTDMS", "labview"),
    "xlrd": ("xlrd", "excel")}


def attach(package_name: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` (PEP 562) of a package, from the imports that stand under
    `if TYPE_CHECKING:` in its `file`: each public name is written once.

    >>> import eitsim
    >>> find, names, public = attach("eitsim", eitsim.__file__)
    >>> find("Disc").__module__
    'eitsim.scene.edges.disc'
    """
    exports = {alias.asname or alias.name: (imported.module or "", alias.name)
               for block in ast.parse(Path(file).read_text(encoding="utf-8")).body if isinstance(block, ast.If)
               for imported in block.body if isinstance(imported, ast.ImportFrom) for alias in imported.names}

    def find(name: str) -> Any:
        if name not in exports:
            raise AttributeError(f"module {package_name!r} has no attribute {name!r}; it exports "
                                 f"{', '.join(sorted(exports))}")
        try:
            module, origin = exports[name]
            found = getattr(importlib.import_module(module), origin)
        except ModuleNotFoundError as error:
            raise missing(error) from None
        setattr(sys.modules[package_name], name, found)
        return found

    return find, lambda: sorted(exports), sorted(exports)


def install(package: str) -> str:
    """What to run for a package that is missing."""
    return f"run pip install '.[{PACKAGES[package][1]}]' in the project's folder."


def needed(package: str, what: str) -> ModuleType:
    """A package of an extra; ValueError with what needs it (in the plural) and what to run where it is missing."""
    try:
        return importlib.import_module(package)
    except ImportError:
        raise ValueError(f"{what} need {PACKAGES[package][0]}, which is not installed; {install(package)}") from None


def installed(package: str) -> bool:
    """Whether a package can be imported."""
    try:
        importlib.import_module(package)
    except ImportError:
        return False
    return True


def missing(error: ModuleNotFoundError) -> Exception:
    """What to raise for a module that was not there: a sentence with what to run if it is of an extra."""
    package = (error.name or "").partition(".")[0]
    if package not in PACKAGES:
        return error
    return ValueError(f"this needs {PACKAGES[package][0]}, which is not installed; {install(package)}")
