"""limits.csv beside a model: the least errors that any reading of its data set can reach, under noise."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from matcal.errors import TestFileError

LIMITS = "limits.csv"
COLUMNS = ("dataset", "noise_db", "material", "output", "limit")
# what `surrogate limit` calls the material, and what the least errors are called for it
MATERIALS = {"known": "least possible, material known", "posterior": "least possible, material uncertain"}


def read_limits(model_dir: Path) -> pd.DataFrame | None:
    """What `surrogate limit --data DIR --out MODEL_DIR/limits.csv` wrote, one row a level, material and output; None
    where it is not there, TestFileError where it lacks a column."""
    path = model_dir / LIMITS
    if not path.is_file():
        return None
    limits = pd.read_csv(path)
    if missing := [name for name in COLUMNS if name not in limits.columns]:
        raise TestFileError(path, f"column {missing[0]} is missing; write it with `surrogate limit CARD --data DIR "
                                  f"--out {LIMITS}`.")
    return limits


def of_dataset(limits: pd.DataFrame | None, scores: Mapping[str, Any]) -> pd.DataFrame | None:
    """The limits, where they are of the data set of these scores."""
    if limits is None or set(limits["dataset"]) != {scores["dataset"]["sha256"]}:
        return None
    return limits


def floor(limits: pd.DataFrame | None, output: str, material: str) -> dict[float, float]:
    """Least error of one output at each level, dB to a tenth; empty where it is not known."""
    if limits is None:
        return {}
    chosen = limits.loc[(limits["output"] == output) & (limits["material"] == material)]
    return dict(zip(chosen["noise_db"].round(1).tolist(), chosen["limit"].tolist(), strict=True))


def with_limits(scores: Mapping[str, Any], limits: pd.DataFrame | None) -> dict[str, Any]:
    """Scores as `evaluate` gives them, each noise level with the least errors of its data set where they are known."""
    own = of_dataset(limits, scores)
    return {**scores, "noise": [{**level, "limits": at_level(own, level["db_below_baseline"])}
                                for level in scores["noise"]]}


def at_level(limits: pd.DataFrame | None, level_dB: float) -> dict[str, dict[str, float]]:
    """Least errors at a level in dB below the baseline: material -> output -> error; empty where none is known."""
    found = {}
    for material in MATERIALS:
        outputs = [] if limits is None else limits["output"].unique().tolist()
        least = {name: floor(limits, name, material).get(round(level_dB, 1)) for name in outputs}
        if known := {name: value for name, value in least.items() if value is not None}:
            found[material] = known
    return found
