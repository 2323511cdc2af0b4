"""Every method of `surrogate train` on one data set: error against training time, and against the number of scenes.

    python benchmarks/surrogates.py SWEEP [METHOD ...]

SWEEP is a folder of `eitsim sweep`, the paper's being examples/paper.toml: 4,000 touches over the whole disc, of which
70 % train and 15 % test. Three of the eight outputs are learned, OUTPUTS: the second coordinate of the place is as the
first, and the mechanical outputs follow from diameter and force. results/surrogates_time.csv: RMSE of the test rows
without noise, all and those within 80 mm, for networks along one training of at most 100 steps each, where the paper's
networks are not at their end (`surrogate train` takes 300). results/surrogates_scenes.csv: the first scenes of the set
train, the last 600 are the unseen ones that every count is scored on; networks take 40 steps. Times are CPU s of one
process; those of an output of a network are of its own training, other methods learn all outputs at once. All methods,
or those named; rows of methods that were measured before are kept. Some 15 CPU minutes with 4,000 scenes.
"""

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from conditions import RESULTS, conditions, quick, written

from surrogate.data import outputs
from surrogate.data.samples import SweepSamples, read_samples, split, take
from surrogate.learners.bayesian_network import bayesian_regularisation, layer
from surrogate.learners.bayesian_network.bayesian_regularisation import Options
from surrogate.learners.bayesian_network.min_max import min_max, scaled
from surrogate.learners.network import MOST, ROBUST
from surrogate.learners.registry import METHODS
from surrogate.learners.signal_features import features, fit_directions, sound_components
from surrogate.model.evaluate import evaluate
from surrogate.model.sweep_model import SweepModel
from surrogate.model.train import train
from surrogate.statistics.metrics import Array, rms

SEED = 1
SCENES = quick((100, 250, 500, 1000, 2000, 3397), (100, 250))
UNSEEN = quick(600, 100)
# Steps of networks at which their error is told, and those where the number of scenes is varied.
STEPS, FEW_STEPS = quick((5, 10, 20, 40, 60, 80, 100), (5, 10)), quick(40, 5)
OUTPUTS = quick(("x0", "d", "F"), ("x0",))
ITERATED = {"trainbr": Options(), "network": ROBUST}
INNER_MM = 80.0


def against_time(samples: SweepSamples, method: str) -> Iterator[dict[str, object]]:
    """Rows of one method, one an output and number of steps."""
    part = split(samples.group, SEED)
    seen, unseen = take(samples, part == "train"), take(samples, part == "test")
    if method not in ITERATED:
        yield from scored(train(samples, method, OUTPUTS, SEED), unseen, "test", None)
        return
    x, z = (inputs(method, seen.signal_V, s.signal_V) for s in (seen, unseen))
    for k, output in ((k, output) for k, output in enumerate(outputs.ALL) if output.name in OUTPUTS):
        for steps, cpu_s, found in along(x, z, seen.target[:, [k]], replace(ITERATED[method], epochs=max(STEPS))):
            error, inner = found - unseen.target[:, k], np.hypot(*unseen.target[:, :2].T) < INNER_MM
            yield {"method": method, "output": output.name, "unit": output.unit, "scenes": len(samples),
                   "training_rows": len(seen), "steps": steps, "fit_cpu_s": cpu_s, "rmse": rms(error),
                   "rmse_inner": rms(error[inner]), "r2": 1 - np.mean(error**2) / np.var(unseen.target[:, k]),
                   "scored_rows": len(unseen)}


def inputs(method: str, seen_V: Array, signal_V: Array) -> Array:
    """What the networks of a method make of signals, learned from those seen."""
    if method == "trainbr":
        return scaled(min_max(seen_V), signal_V)
    return features(fit_directions(seen_V, sound_components(seen_V, MOST)), signal_V)


def along(x: Array, z: Array, target: Array, options: Options) -> list[tuple[int, float, Array]]:
    """Steps, CPU s, and outputs of unseen inputs z, along the training of one network on x and target (n, 1)."""
    scaling, begun = min_max(target), time.process_time()
    shown: list[tuple[float, Array]] = []

    def watch(weights: Array) -> None:
        shown.append((time.process_time() - begun, weights))

    bayesian_regularisation.train(x, scaled(scaling, target)[:, 0].copy(), SEED, options, watch)
    kept = [(step, *shown[step - 1]) for step in STEPS if step <= len(shown)]
    middle, half = float(scaling.lowest[0] + scaling.half_span[0]), float(scaling.half_span[0])
    return [(step, cpu_s, layer.output(weights, z) * half + middle) for step, cpu_s, weights in kept]


def against_scenes(samples: SweepSamples, method: str) -> Iterator[dict[str, object]]:
    """Rows of one method, one an output and number of scenes."""
    seen, unseen = (take(samples, rows) for rows in np.split(np.arange(len(samples)), [len(samples) - UNSEEN]))
    epochs = FEW_STEPS if method in ITERATED else None
    for count in (min(count, len(seen)) for count in SCENES):
        model = train(take(seen, np.arange(count)), method, OUTPUTS, SEED, epochs=epochs)
        yield from scored(model, unseen, "all", epochs)


def scored(model: SweepModel, samples: SweepSamples, part: str, steps: int | None) -> Iterator[dict[str, object]]:
    """One row an output."""
    found = evaluate(model, samples)
    radius = dict(zip(samples.scene.tolist(), np.hypot(*samples.target[:, :2].T).tolist(), strict=True))
    for name, parts in found.scores["outputs"].items():
        s = parts[part]
        table = found.predictions
        rows = pd.DataFrame(table.loc[(table["output"] == name) & (table["part"] == part)])
        near = np.array([radius[scene] < INNER_MM for scene in rows["scene"].tolist()])
        error = rows["value"].to_numpy(float) - rows["target"].to_numpy(float)
        yield {"method": model.method, "output": name, "unit": s["unit"], "scenes": model.record["dataset"]["rows"],
               "training_rows": model.record["dataset"]["split"]["train"], "steps": steps, "fit_cpu_s": model.fit_s,
               "predict_cpu_ms": found.scores["predict_ms"], "rmse": s["rmse"],
               "rmse_inner": rms(error[near]), "r2": s["r2"],
               "coverage_90": s["coverage_90"], "scored_rows": s["n"],
               "dataset_sha256": model.record["dataset"]["sha256"][:12]}


def kept(rows: Sequence[dict[str, object]], name: str) -> None:
    """Write rows; those of other methods that the table has are kept."""
    told = conditions()
    fresh, path = pd.DataFrame(rows).assign(**told), RESULTS / f"{name}.csv"
    if path.exists():
        old = pd.read_csv(path)
        other = pd.DataFrame(old[~old["method"].isin(fresh["method"].tolist())])
        fresh = pd.concat([other.assign(**{name: "unknown" for name in told if name not in other}), fresh])
    written(fresh, name, digits=6)


def main(folder: str, methods: Sequence[str]) -> None:
    """Measure, one method after the other, each written when it is done."""
    samples = read_samples(folder)
    for method in methods:
        for name, measured in (("time", against_time), ("scenes", against_scenes)):
            rows = list(measured(samples, method))
            if rows:
                kept(rows, f"surrogates_{name}")
            for row in rows:
                print(name, *(row[key] for key in ("method", "scenes", "steps", "output", "rmse", "fit_cpu_s")),
                      flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        print("surrogates: nothing measured; give the folder of a sweep: benchmarks/surrogates.py SWEEP [METHOD ...]")
    else:
        main(sys.argv[1], sys.argv[2:] or METHODS)
