"""Where a report's numbers come from: hashes of its inputs, versions, commit, machine."""

import hashlib
import os
import platform
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

DISTRIBUTION = "touchcal"


@dataclass(frozen=True)
class Source:
    """One file that a report was made from."""

    name: str  # name without folders
    sha256: str  # of its bytes, 64 hexadecimal digits


def source(path: Path) -> Source:
    """Name and hash of a file."""
    return Source(path.name, hashlib.sha256(path.read_bytes()).hexdigest())


def combined(name: str, sources: Sequence[Source]) -> Source:
    """One hash for many files: of their lines "hash  name", sorted, as `sha256sum` prints them."""
    lines = "".join(sorted(f"{s.sha256}  {s.name}\n" for s in sources))
    return Source(name, hashlib.sha256(lines.encode()).hexdigest())


def commit() -> str | None:
    """Commit that this package stands at, "-dirty" where files differ from it; None outside its own checkout."""
    here = Path(__file__).parents[1]
    try:
        tracked = subprocess.run(["git", "ls-files", "--error-unmatch", "__init__.py"], cwd=here, capture_output=True)
        if tracked.returncode:
            return None
        named = subprocess.run(["git", "describe", "--always", "--dirty", "--exclude=*", "--abbrev=10"], cwd=here,
                               capture_output=True, text=True)
    except OSError:
        return None
    return named.stdout.strip() or None


def machine() -> str:
    """Processor model and number of cores, without the machine's name."""
    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        lines = cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines()
        facts = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
        model = facts.get("model name", model)
    cores = os.cpu_count() or 1
    return f"{model}, {cores} core{'s' if cores > 1 else ''}"


def seed_words(seed: Any) -> str:
    """A seed for the footer, or that none is on record."""
    return "no seed recorded" if seed is None else f"seed {seed}"


def card_words(card: Mapping[str, Any]) -> str:
    """Name of a result's card, and that synthetic data made it where they did."""
    return f"“{card['name']}”" + (" fitted to synthetic data" if card.get("synthetic") else "")


def footer(sources: Sequence[Source], seed: str) -> dict[str, Any]:
    """What stands at the foot of every page; `seed` in words."""
    made_at = commit()
    return {"inputs": [asdict(one) for one in sources], "software": f"{DISTRIBUTION} {version(DISTRIBUTION)}",
            "commit": f"commit {made_at}" if made_at else "installed package, commit not recorded", "seed": seed,
            "machine": f"report made on {machine()}"}


def origin(result: Mapping[str, Any]) -> dict[str, Any]:
    """Prose on the card and the versions that a result or a manifest names."""
    found = {}
    if card := result.get("card"):
        found["card"] = f"Card “{card['name']}”, sha256 of its material parts {card['sha256']}."
    if versions := result.get("versions"):
        found["versions"] = f"Computed with {version_lines(versions)}."
    return found


def version_lines(versions: Mapping[str, Any]) -> str:
    """Versions as one line of text: "numpy 2.1, scipy 1.15"."""
    return ", ".join(f"{name} {value}" for name, value in versions.items())
