"""Surrogates under noise and shift: how much worse they read, and whether their intervals still hold.

    python benchmarks/surrogate_noise.py SWEEP [OTHER] [--methods METHOD ...]

Models are trained on SWEEP and scored on its unseen rows: white noise that the model is told of, so many dB below the
RMS of the baseline voltages, and shifts that it is not told of: another gain, one electrode pair's channel that reads
nothing, readings of opposite sign, and OTHER, a sweep of the same sensor with other cards. rmse_ratio is the RMSE over
that without noise and shift. Writes results/surrogate_noise.csv.
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from conditions import quick, shown, written

from surrogate.data.samples import SweepSamples, read_samples, take
from surrogate.model.evaluate import UNSEEN, evaluate, parts_of
from surrogate.model.sweep_model import SweepModel
from surrogate.model.train import train

SEED, ROWS, OTHERS = 1, quick(4000, 200), quick(600, 60)
LEVELS_DB = (120.0, 100.0, 90.0, 80.0, 70.0, 60.0, 50.0, 40.0)
METHODS = ("ridge", "forward")
CHANNEL = 100


def shifted(samples: SweepSamples) -> dict[str, SweepSamples]:
    """The same touches, read otherwise than in training."""
    dead = samples.signal_V.copy()
    dead[:, CHANNEL] = 0.0
    return {"gain 1 % high": replace(samples, signal_V=1.01 * samples.signal_V),
            "gain 10 % high": replace(samples, signal_V=1.1 * samples.signal_V),
            "one channel reads nothing": replace(samples, signal_V=dead),
            "sign reversed": replace(samples, signal_V=-samples.signal_V)}


def scored(kind: str, case: str, level: float, outputs: Mapping[str, Mapping[str, Any]],
           clean: Mapping[str, float]) -> Iterator[dict[str, object]]:
    """One row an output, of the rows that the model has not seen."""
    for name, parts in outputs.items():
        s = next(parts[part] for part in UNSEEN if part in parts)
        yield {"kind": kind, "case": case, "noise_dB": level, "output": name, "unit": s["unit"], "rmse": s["rmse"],
               "rmse_ratio": s["rmse"] / clean.get(name, s["rmse"]), "r2": s["r2"], "coverage_90": s["coverage_90"],
               "scored_rows": s["n"]}


def of(model: SweepModel, samples: SweepSamples, other: SweepSamples | None) -> Iterator[dict[str, object]]:
    """All cases of one model."""
    plain = evaluate(model, samples, LEVELS_DB).scores
    first = list(scored("noise", "none", np.inf, plain["outputs"], {}))
    clean = {str(row["output"]): float(str(row["rmse"])) for row in first}
    yield from first
    for at in plain["noise"]:
        yield from scored("noise", f"{at['noise_db']:g} dB", at["noise_db"], at["outputs"], clean)
    sets = shifted(samples) | ({} if other is None else {"cards of a posterior": other})
    for case, changed in sets.items():
        yield from scored("shift", case, np.inf, evaluate(model, changed).scores["outputs"], clean)


def main() -> None:
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("sweep", type=Path)
    options.add_argument("other", type=Path, nargs="?")
    options.add_argument("--methods", nargs="+", default=METHODS)
    given = options.parse_args()
    samples, other = (folder and read_samples(folder) for folder in (given.sweep, given.other))
    samples, rows = take(samples, np.arange(min(ROWS, len(samples)))), []
    if other is not None:
        other = take(other, np.arange(min(OTHERS, len(other))))
    for method in given.methods:
        model = train(samples, method, seed=SEED)
        unseen = take(samples, parts_of(model, samples) == "test")
        rows += [{"method": method, **row} for row in of(model, unseen, other)]
        table = written(rows, "surrogate_noise")
    shown(table)


if __name__ == "__main__":
    main()
