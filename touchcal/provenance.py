"""What a result was made from: the card's content hash and the versions of the code."""

import hashlib
import importlib.metadata
import os
from pathlib import Path


def file_identity(path: Path, folder: Path) -> dict[str, str]:
    """Path of a file as seen from a folder, and the hash of its content."""
    return {"name": os.path.relpath(path, folder), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}


def versions() -> dict[str, str]:
    """Versions of this package and of the libraries that its numbers rest on."""
    return {name: importlib.metadata.version(name) for name in ("touchcal", "numpy", "scipy", "scikit-fem")}
