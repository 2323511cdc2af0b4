"""What a result was made from: the card's content hash and the versions of the code."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
from pathlib import Path
from typing import Any

from matcal.card import MaterialCard, as_json


def card_identity(card: MaterialCard, path: Path) -> dict[str, Any]:
    """Name, file and content hash (of the material's parts) of a card, and whether synthetic data made it."""
    parts = {key: value for key, value in as_json(card).items() if key in ("hyperfoam", "prony", "conductivity")}
    text = json.dumps(parts, sort_keys=True)
    return {"name": card.name, "file": path.name, "sha256": hashlib.sha256(text.encode()).hexdigest(),
            "synthetic": bool(card.provenance.get("synthetic", False))}


def file_identity(path: Path, folder: Path) -> dict[str, str]:
    """Path of a file as seen from a folder, and the hash of its content."""
    return {"name": os.path.relpath(path, folder), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}


def versions() -> dict[str, str]:
    """Versions of this package and of the libraries that its numbers rest on."""
    return {name: importlib.metadata.version(name) for name in ("touchcal", "numpy", "scipy", "scikit-fem")}
