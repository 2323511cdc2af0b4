"""Hash of a package's own code."""

from __future__ import annotations

import functools
import hashlib

from eitsim.code_hash import ROOT


@functools.cache
def package_hash(package: str) -> str:
    """SHA-256 of a package's modules, their names included, as they are when this process first asks."""
    found = hashlib.sha256()
    for path in sorted((ROOT / package).rglob("*.py")):
        found.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    return found.hexdigest()
