"""Under what conditions a benchmark ran: machine, threads, versions, date; and in processes of their own."""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import platform
from pathlib import Path

RESULTS = Path(__file__).parent / "results"


def conditions() -> dict[str, str]:
    """Columns that every row of a table carries."""
    names = ("touchcal", "numpy", "scipy", "numba")
    return {"machine": f"{processor()}, {os.cpu_count()} cores", "threads": os.environ.get("OMP_NUM_THREADS", "all"),
            "versions": " ".join(f"{name} {importlib.metadata.version(name)}" for name in names),
            "date": datetime.date.today().isoformat()}


def processor() -> str:
    """The processor's name where the system tells it, else its architecture."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
