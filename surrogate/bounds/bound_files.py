"""Files of `surrogate limit` in a model's folder: the least errors that any reading of its data set can reach under
noise, and standard deviations over the disc."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from touchcal.errors import InputFileError

LIMITS, MAP = "limits.csv", "limit_map.csv"
COLUMNS = ("dataset", "noise_db", "material", "output", "limit")
MAP_COLUMNS = ("noise_db", "material", "x_mm", "y_mm", "d_mm", "F_N", "sd_x0_mm", "sd_y0_mm", "sd_d_mm", "sd_F_N")
# what `surrogate limit` calls the material, and what the least errors are called for it
MATERIALS = {"known": "least possible, material known", "posterior": "least possible, material uncertain"}


def read_limits(model_dir: Path) -> pd.DataFrame | None:
    """What `surrogate limit --data DIR --out MODEL_DIR/limits.csv` wrote, one row a level, material and output; None
    where it is not there, InputFileError where it lacks a column."""
    return _read(model_dir / LIMITS, COLUMNS, f"--data DIR --out {LIMITS}")


def read_map(model_dir: Path) -> pd.DataFrame | None:
    """What `surrogate limit --scene FILE --map --out MODEL_DIR/limit_map.csv` wrote, one row a level, material and
    place, as read_limits."""
    return _read(model_dir / MAP, MAP_COLUMNS, f"--scene FILE --map --out {MAP}")


def _read(path: Path, columns: Sequence[str], options: str) -> pd.DataFrame | None:
    if not path.is_file():
        return None
    table = pd.read_csv(path)
    if missing := [name for name in columns if name not in table.columns]:
        raise InputFileError(path, f"column {missing[0]} is missing; write it with `surrogate limit CARD {options}`.")
    return table


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
    return {**scores, "noise": [level | {"limits": at_level(own, level["db_below_baseline"])}
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
