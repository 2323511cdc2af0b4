"""Every method of `surrogate train` on one data set: error against training time, and against the number of scenes.

    python benchmarks/surrogates.py SWEEP [METHOD ...]

SWEEP is a folder of `eitsim sweep`, the paper's being examples/paper.toml: 4,000 touches over the whole disc, of which
70 % train and 15 % test. results/surrogates_time.csv: RMSE of the test rows without noise, for networks at growing
bounds on their steps. results/surrogates_scenes.csv: the first scenes of the set train, the last 600 are the unseen
ones that every count is scored on. Times are CPU s of one process. All methods, or those named; rows of methods that
were measured before are kept.
"""

from __future__ import annotations

import importlib.metadata
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import RESULTS, conditions

from surrogate.evaluate import evaluate
from surrogate.model import METHODS, Model
from surrogate.samples import Samples, read_samples, take
from surrogate.train import train

SEED = 1
SCENES, UNSEEN = (100, 250, 500, 1000, 2000, 2800), 600
STEPS = {"trainbr": (25, 50, 100, 200, 300), "network": (25, 50, 100, 200, 300)}
# Steps where the number of scenes is varied.
FEW_STEPS = {"trainbr": 50, "network": 100}


def against_time(samples: Samples, method: str) -> Iterator[dict[str, object]]:
    """Rows of one method, one an output and bound on the steps."""
    for steps in STEPS.get(method, (None,)):
        model = train(samples, method, seed=SEED, epochs=steps)
        yield from scored(model, samples, "test", steps)


def against_scenes(samples: Samples, method: str) -> Iterator[dict[str, object]]:
    """Rows of one method, one an output and number of scenes."""
    seen, unseen = (take(samples, rows) for rows in np.split(np.arange(len(samples)), [len(samples) - UNSEEN]))
    for count in SCENES:
        model = train(take(seen, np.arange(count)), method, seed=SEED, epochs=FEW_STEPS.get(method))
        yield from scored(model, unseen, "all", FEW_STEPS.get(method))


def scored(model: Model, samples: Samples, part: str, steps: int | None) -> Iterator[dict[str, object]]:
    """One row an output."""
    scores = evaluate(model, samples).scores
    for name, parts in scores["outputs"].items():
        s = parts[part]
        yield {"method": model.method, "output": name, "unit": s["unit"], "scenes": model.record["dataset"]["rows"],
               "training_rows": model.record["dataset"]["split"]["train"], "steps": steps, "fit_cpu_s": model.fit_s,
               "predict_cpu_ms": scores["predict_ms"], "rmse": s["rmse"], "r2": s["r2"],
               "coverage_90": s["coverage_90"], "scored_rows": s["n"],
               "dataset_sha256": scores["dataset"]["sha256"][:12]}


def written(path: Path, rows: Sequence[dict[str, object]]) -> None:
    """Write rows; those of other methods that the file has are kept."""
    told = conditions()
    told["versions"] += f" torch {importlib.metadata.version('torch')}"
    fresh = pd.DataFrame(rows).assign(**told)
    if path.exists():
        old = pd.read_csv(path)
        fresh = pd.concat([old[~old["method"].isin(fresh["method"].unique())], fresh])
    fresh.to_csv(path, index=False, float_format="%.6g")


def main(folder: str, methods: Sequence[str]) -> None:
    """Measure, one method after the other, each written when it is done."""
    samples = read_samples(folder)
    for method in methods:
        for name, measured in (("time", against_time), ("scenes", against_scenes)):
            rows = list(measured(samples, method))
            written(RESULTS / f"surrogates_{name}.csv", rows)
            for row in rows:
                if row["output"] in ("x0", "d", "F"):
                    print(name, *(row[key] for key in ("method", "scenes", "steps", "output", "rmse", "fit_cpu_s")))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        print("surrogates: nothing measured; give the folder of a sweep: benchmarks/surrogates.py SWEEP [METHOD ...]")
    else:
        main(sys.argv[1], sys.argv[2:] or METHODS)
