"""A mesh from any file that meshio reads, or the reason why not."""

from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import meshio


def read_mesh(path: Path) -> "meshio.Mesh":
    """The mesh of a file; ValueError with the reason where meshio does not read it, whose readers let any error
    through, print what they exit for, and take the first bytes of a text for a number of triangles. OSError where the
    file cannot be opened."""
    import meshio

    if path.suffix.lower() == ".ply" and b"end_header" not in path.read_bytes():
        raise ValueError("the header has no end")  # which meshio would look for without end
    said = StringIO()
    try:
        with np.errstate(over="ignore"), redirect_stdout(said), redirect_stderr(said):
            return meshio.read(path)
    except OSError:
        raise
    except (Exception, SystemExit) as error:
        reason = said.getvalue() if isinstance(error, SystemExit) else f"{type(error).__name__}: {error}"
        raise ValueError(" ".join(reason.split()) + _advice(path)) from None


def _advice(path: Path) -> str:
    """What to do about a file of Gmsh whose format is not read; empty for others."""
    lines = path.read_bytes()[:200].split(b"\n") if path.suffix.lower() == ".msh" else []
    if len(lines) < 2 or lines[0].strip() != b"$MeshFormat":
        return ""
    return (f"; its format is {lines[1].split()[0].decode(errors='replace') if lines[1].split() else 'not stated'}, of "
            "which this content is not read: save it as version 2.2 (gmsh -save -format msh22)")
