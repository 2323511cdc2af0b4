"""Surrogates of a forearm: errors of place and force on test rows, and coverage of 90 % intervals, over several splits.

The forearm of examples/forearm.toml, 500 scenes of a flat punch of 14 mm anywhere on it, 0.25 to 2 N (uniform in the
logarithm). Methods are trained on 70 %, calibrated on 15 % and scored on the rest, under noise 80 dB below the RMS of
the untouched readings; signals count as exact. Distances of places are in space. coverage: part of the 90 % intervals
of x, y, z and F that hold the value, mean_ over the four and least_ of them. Writes results/curved_surrogate.csv.

    python benchmarks/curved_surrogate.py CARD [FOLDER]

CARD is a card that `matcal` wrote; FOLDER keeps the sweep, and one that is there is not swept again.
"""

import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from conditions import quick, shown, written

import eitsim
from eitsim.sweeps.design.design import design_from
from matcal.card import as_card
from surrogate.data.samples import SweepSamples, read_samples, split, take
from surrogate.model.train import train
from surrogate.model.trained import estimate, interval_scale
from surrogate.statistics.conformal import COVERAGE, normal

FOREARM = Path(__file__).parents[1] / "examples/forearm.toml"
SCENES, SPLITS, BELOW_DB = quick(500, 40), quick(4, 1), 80.0
NAMES = ("x0", "y0", "z0", "F")


def rows(samples: SweepSamples) -> Iterator[dict[str, Any]]:
    noise_V = float(np.sqrt(np.mean(samples.baseline_V**2))) * 10 ** (-BELOW_DB / 20)
    for method in ("gp", "ridge"):
        for seed in range(SPLITS):
            model = train(samples, method, ",".join(NAMES), seed, exact_signals=True)
            test = take(samples, split(samples.group, seed) == "test")
            noise = noise_V * np.random.default_rng(seed).normal(size=test.signal_V.shape)
            found, scale = estimate(model, test.signal_V + noise, noise_V), interval_scale(model, noise_V)
            below, above = found.ends(scale.of(found.sd, found.near_edge), normal(COVERAGE))
            error = found.value - test.targets(model.names)
            place = np.linalg.norm(error[:, [model.names.index(name) for name in NAMES[:3]]], axis=1)
            force = np.abs(error[:, model.names.index("F")] / test.targets(["F"])[:, 0])
            held = ((error <= below) & (-error <= above)).mean(axis=0)
            yield {"method": method, "split": seed, "rows": len(samples), "scored": len(test),
                   "place_median_mm": np.median(place), "place_rms_mm": np.sqrt(np.mean(place**2)),
                   "force_median": np.median(force), "force_rms": np.sqrt(np.mean(force**2)),
                   "mean_coverage": held.mean(), "least_coverage": held.min(), "fit_s": model.fit_s}


def main(card: str, folder: str | None = None) -> None:
    raw = tomllib.loads(FOREARM.read_text(encoding="utf-8"))
    punch = {"diameter_mm": 14, "force_N": {"dist": "loguniform", "lo": 0.25, "hi": 2.0}}
    design = design_from({"scenes": SCENES, "seed": 1, **raw, "punch": punch})
    with tempfile.TemporaryDirectory() as made:
        out = Path(folder or made)
        if not (out / "design.json").exists():
            eitsim.sweep(design, as_card(card), out)
        shown(written(list(rows(read_samples(out))), "curved_surrogate"))


if __name__ == "__main__":
    main(*sys.argv[1:])
