"""What every benchmark shares: under what conditions it ran, its quick mode, and how its table is written.

QUICK=1 in the environment asks for the few cases that show that a benchmark runs and what it tells; their tables go to
results/quick, apart from the full ones.
"""

import datetime
import importlib.metadata
import os
import platform
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import pandas as pd

from touchcal.code_version import script_hash

QUICK = os.environ.get("QUICK", "") == "1"
RESULTS = Path(__file__).parent / "results" / ("quick" if QUICK else "")
# columns that every row of a table carries
CONDITIONS = ("machine", "threads", "versions", "date", "code")
T = TypeVar("T")


def quick(whole: T, few: T) -> T:
    """What a full run takes, or the few that a quick one does."""
    return few if QUICK else whole


def conditions() -> dict[str, str]:
    """What CONDITIONS hold of this run; `code` is that of the benchmark which runs, "unknown" where none does."""
    running = Path(sys.argv[0]).resolve()
    code = script_hash(running) if running.suffix == ".py" else "unknown"
    names = ("touchcal", "numpy", "scipy", "numba")
    return {"machine": f"{processor()}, {os.cpu_count()} cores", "threads": os.environ.get("OMP_NUM_THREADS", "all"),
            "versions": " ".join(f"{name} {importlib.metadata.version(name)}" for name in names),
            "date": datetime.date.today().isoformat(), "code": code}


def processor() -> str:
    """The processor's name where the system tells it, else its architecture."""
    information = Path("/proc/cpuinfo")
    lines = information.read_text().splitlines() if information.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def written(rows: pd.DataFrame | Iterable[Mapping[str, Any]], name: str, digits: int = 4) -> pd.DataFrame:
    """Write results/<name>.csv with the conditions in every row that has none yet; the whole table, as written."""
    table = rows.copy() if isinstance(rows, pd.DataFrame) else pd.DataFrame(list(rows))
    for column, told in conditions().items():
        table[column] = table[column].fillna(told) if column in table else told
    RESULTS.mkdir(parents=True, exist_ok=True)
    table.to_csv(RESULTS / f"{name}.csv", index=False, float_format=f"%.{digits}g")
    return table


def earlier(name: str) -> pd.DataFrame:
    """Rows of results/<name>.csv of an earlier run, "unknown" for the conditions that they do not tell; none where it
    is not there."""
    path = RESULTS / f"{name}.csv"
    table = pd.read_csv(path, dtype=dict.fromkeys(CONDITIONS, str)) if path.exists() else pd.DataFrame()
    return table.assign(**{one: table[one].fillna("unknown") if one in table else "unknown" for one in CONDITIONS})


def shown(table: pd.DataFrame, digits: int = 3) -> None:
    """Print a table without its conditions."""
    plain = table.drop(columns=[name for name in CONDITIONS if name in table])
    print(plain.to_string(index=False, float_format=lambda v: f"{v:.{digits}g}"), flush=True)
