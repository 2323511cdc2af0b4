"""The paper's networks as they are, against the errors that the paper states: whole disc, and away from the rim.

    python benchmarks/faithful.py SWEEP

Trains trainbr for all eight outputs on 70 % of SWEEP, whose 208 readings, 20 hidden units and stopping are the paper's
own (`surrogate train --method trainbr`), once on all its rows and once on those within REACH_MM of the centre, and
scores both on their own unseen rows, without noise. `gamma` counts effective parameters of `parameters`; `collapses`
tells how many starts lost them. The paper's sweep takes some 40 CPU minutes. Writes results/faithful.csv.
"""

import argparse
from collections.abc import Iterator

import numpy as np
from conditions import quick, shown, written

from surrogate.data.samples import SweepSamples, read_samples, take
from surrogate.model.evaluate import UNSEEN, evaluate
from surrogate.model.train import train

SEED, EPOCHS, ROWS, WORKERS = 1, quick(300, 5), quick(4000, 200), 2
REACH_MM = {"within 80 mm": 80.0, "disc": np.inf}
# Root mean square errors that the paper states, in the unit of each output.
PAPER = {"x0": 0.58, "y0": 0.55, "d": 0.75, "F": 0.152, "sigma_max": 4.6, "sigma_ave": 0.65, "A_c": 8.1,
         "delta_max": 0.91}


def scored(samples: SweepSamples, region: str) -> Iterator[dict[str, object]]:
    """One row an output."""
    model = train(samples, "trainbr", tuple(PAPER), SEED, epochs=EPOCHS, workers=WORKERS)
    outputs = evaluate(model, samples, ()).scores["outputs"]
    for name, parts in outputs.items():
        told, unseen = model.record["training"][name], next(parts[part] for part in UNSEEN if part in parts)
        yield {"region": region, "output": name, "unit": unseen["unit"], "rmse": unseen["rmse"],
               "mae": unseen["mae"], "r2": unseen["r2"], "train_rmse": parts["train"]["rmse"],
               "paper_rmse": PAPER[name], "over_paper": unseen["rmse"] / PAPER[name], "epochs": told["epochs"],
               "stop": told["stop"], "gamma": told["gamma"], "parameters": told["parameters"],
               "collapses": told["collapses"], "rows": parts["train"]["n"], "scored_rows": unseen["n"],
               "fit_s": model.fit_s}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep", help="folder of `eitsim sweep` of the paper's design")
    samples = read_samples(parser.parse_args().sweep)
    samples = take(samples, np.arange(min(len(samples), ROWS)))
    distance = np.hypot(*samples.target[:, :2].T)
    rows: list[dict[str, object]] = []
    for region, reach in REACH_MM.items():
        rows += scored(take(samples, distance <= reach), region)
        shown(written(rows, "faithful"))


if __name__ == "__main__":
    main()
