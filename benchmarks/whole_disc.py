"""Errors and intervals of `forward` over the whole disc of the default sensor, by the gap between punch and rim.

    python benchmarks/whole_disc.py SWEEP SOFT

SWEEP is a folder of `eitsim sweep examples/paper.toml`, 4,000 scenes, SOFT one of the same touches with `soft = true`
in its `[electrodes]`. 70 % of the touches train, 15 % calibrate the intervals, and the rest, unseen, are scored without
noise, as `surrogate train --seed` splits them; the unseen rows of SPLITS seeds are scored as one set. share: the zone's
part of the sum of squares over all scored rows. simulator_error: "stated" counts the error that the simulator states of
its signals, near the rim most of it a bound of what rigid electrodes would change; "stated, soft electrodes" is that of
SOFT; "none" takes signals for exact, as those scored are (`surrogate train --exact-signals`). Times are CPU s of one
process, of the first split. Writes results/whole_disc.csv.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
from conditions import quick, shown, written

from surrogate.data.samples import SweepSamples, read_samples, split, take
from surrogate.model.evaluate import evaluate
from surrogate.model.train import train

SPLITS, OUTPUTS = quick((1, 2, 3), (1,)), ("x0", "y0", "d", "F", "delta_max")
ZONES_MM = (-np.inf, 1.0, 4.0, 8.0, 20.0, 40.0, np.inf)  # ends of the zones of the gap
MOST = quick(None, 400)  # scenes that are taken


def scored(samples: SweepSamples, seed: int) -> tuple[pd.DataFrame, dict[str, float]]:
    """Unseen touches of a split, a row an output, with the gap between punch and rim; and what training took."""
    model = train(samples, "forward", OUTPUTS, seed)
    unseen = take(samples, split(samples.group, seed) == "test")
    found = evaluate(model, unseen)
    gap = dict(zip(unseen.scene.tolist(), model.ring.radius_mm - np.hypot(*unseen.target[:, :2].T)
                   - unseen.target[:, 2] / 2, strict=True))
    return found.predictions.assign(gap_mm=found.predictions["scene"].map(gap)), {
        "training_rows": model.record["dataset"]["split"]["train"], "fit_cpu_s": model.fit_s,
        "predict_cpu_ms": found.scores["predict_ms"]}


def rows(samples: SweepSamples, error: str) -> Iterator[dict[str, object]]:
    """One row a zone and output, all zones first."""
    each = [scored(samples, seed) for seed in SPLITS]
    for name, table in pd.concat([one for one, _ in each]).groupby("output", sort=False):
        off = table["value"].to_numpy(float) - table["target"].to_numpy(float)
        held = (off <= table["below_90"].to_numpy(float)) & (-off <= table["above_90"].to_numpy(float))
        at = table["gap_mm"].to_numpy(float)
        for low, high in ((-np.inf, np.inf), *pairwise(ZONES_MM)):
            zone = (at >= low) & (at < high)
            if zone.any():
                yield {"simulator_error": error, "output": name, "unit": table["unit"].iloc[0],
                       "gap_from_mm": low, "gap_to_mm": high, "rows": int(zone.sum()), "splits": len(SPLITS),
                       "rmse": np.sqrt(np.mean(off[zone] ** 2)), "median": np.median(np.abs(off[zone])),
                       "share": np.sum(off[zone] ** 2) / np.sum(off**2), "coverage_90": held[zone].mean(),
                       **each[0][1]}


def first(folder: str) -> SweepSamples:
    """The first MOST samples of a sweep."""
    whole = read_samples(folder)
    return take(whole, np.arange(len(whole))[:MOST])


def main(folder: str, soft: str) -> None:
    """Measure and write."""
    stated = first(folder)
    exact = replace(stated, signal_sd=np.zeros(len(stated)))
    shown(written([*rows(stated, "stated"), *rows(first(soft), "stated, soft electrodes"), *rows(exact, "none")],
                  "whole_disc"))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
