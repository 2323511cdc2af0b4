"""Errors and intervals of `forward` over the whole disc of the default sensor, by the gap between punch and rim.

    python benchmarks/whole_disc.py SWEEP

SWEEP is a folder of `eitsim sweep examples/paper.toml`, 4,000 scenes. 70 % of its touches train, 15 % calibrate the
intervals, and the rest, unseen, are scored without noise, as `surrogate train --seed 1` splits them. share: the zone's
part of the sum of squares over all scored rows. simulator_error: "stated" counts the error that the simulator states of
its signals, most of it a bound of what it leaves out; "none" takes signals for exact, as those scored are, and shows
what that bound costs. Times are CPU s of one process. Writes results/whole_disc.csv.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from conditions import quick, shown, written

from surrogate.data.samples import Samples, read_samples, split, take
from surrogate.model.evaluate import evaluate
from surrogate.model.train import train

SEED, OUTPUTS = 1, ("x0", "y0", "d", "F", "delta_max")
ZONES_MM = (-np.inf, 1.0, 4.0, 8.0, 20.0, 40.0, np.inf)  # ends of the zones of the gap
MOST = quick(None, 400)  # scenes that are taken


def rows(samples: Samples, error: str) -> Iterator[dict[str, object]]:
    """One row a zone and output, all zones first."""
    model = train(samples, "forward", OUTPUTS, SEED)
    unseen = take(samples, split(samples.touch, SEED) == "test")
    found = evaluate(model, unseen)
    gap = dict(zip(unseen.scene.tolist(), model.ring.radius_mm - np.hypot(*unseen.target[:, :2].T)
                   - unseen.target[:, 2] / 2, strict=True))
    for name, table in found.predictions.groupby("output", sort=False):
        off = table["value"].to_numpy(float) - table["target"].to_numpy(float)
        held = (off <= table["below_90"].to_numpy(float)) & (-off <= table["above_90"].to_numpy(float))
        at = np.array([gap[scene] for scene in table["scene"].tolist()])
        for low, high in ((-np.inf, np.inf), *pairwise(ZONES_MM)):
            zone = (at >= low) & (at < high)
            if zone.any():
                yield {"simulator_error": error, "output": name, "unit": table["unit"].iloc[0],
                       "gap_from_mm": low, "gap_to_mm": high, "rows": int(zone.sum()),
                       "rmse": np.sqrt(np.mean(off[zone] ** 2)), "median": np.median(np.abs(off[zone])),
                       "share": np.sum(off[zone] ** 2) / np.sum(off**2), "coverage_90": held[zone].mean(),
                       "training_rows": model.record["dataset"]["split"]["train"], "fit_cpu_s": model.fit_s,
                       "predict_cpu_ms": found.scores["predict_ms"]}


def main(folder: str) -> None:
    """Measure and write."""
    whole = read_samples(folder)
    samples = take(whole, np.arange(len(whole))[:MOST])
    exact = replace(samples, signal_sd=np.zeros(len(samples)))
    shown(written([*rows(samples, "stated"), *rows(exact, "none")], "whole_disc"))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
