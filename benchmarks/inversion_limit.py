"""Errors of the inversion on unseen touches, any diameter allowed, over the least that white noise allows.

RMSE of x0, y0, d and F over the root mean Cramer-Rao variance of the same touches, with a Gaussian prior of the
training touches' variances. Derivatives are those of the learned forward map, so the floor is as right as these.
Run as `python benchmarks/inversion_limit.py MODEL_DIR DATA_SET`; writes results/inversion_limit.csv.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import RESULTS, conditions
from numpy.typing import NDArray

from eitsim.measurement import below
from surrogate import store
from surrogate.forward_map import ForwardMap
from surrogate.invert import invert
from surrogate.metrics import rms
from surrogate.samples import read_samples
from surrogate.split import PARTS
from surrogate.touch_inversion import TouchInversion

Array = NDArray[np.float64]
NAMES, LEVELS_DB, ROWS, REACH_MM = ("x0", "y0", "d", "F"), (80.0, 60.0), 150, 80.0


def rows(forward: ForwardMap, signal: Array, touch: Array, level_db: float, noise_V: float) -> list[dict[str, object]]:
    """Errors and floors at one noise level, over the whole disc and within REACH_MM."""
    noisy = signal + noise_V * np.random.default_rng(0).normal(size=signal.shape)
    found = invert(forward, noisy, noise_V)
    squared, variance = (found.touch - touch) ** 2, np.einsum("npp->np", found.peak.noise)
    within = np.hypot(touch[:, 0], touch[:, 1]) <= REACH_MM
    out = []
    for region, kept in (("disc", np.ones_like(within)), (f"within {REACH_MM:g} mm", within)):
        rmse, floor = np.sqrt(squared[kept].mean(axis=0)), np.sqrt(variance[kept].mean(axis=0))
        out += [{"noise_db": level_db, "region": region,
                 "rows": int(kept.sum()), "output": name, "rmse": rmse[k], "floor": floor[k],
                 "ratio": rmse[k] / floor[k] if floor[k] else np.nan} for k, name in enumerate(NAMES)]
    return out


def main() -> None:
    if len(sys.argv) != 3:
        raise SystemExit("inversion_limit.py: give a forward model and the data set that it was trained on.")
    model, samples = store.load(Path(sys.argv[1])), read_samples(sys.argv[2])
    if not isinstance(model.learner, TouchInversion):
        raise SystemExit(f"inversion_limit.py: {sys.argv[1]} is of method {model.method}; give one of method forward.")
    tests = model.rows.row_hash[model.rows.part == PARTS.index("test")]
    some = np.flatnonzero(np.isin(samples.row_hash, tests))[:ROWS]
    forward, volts = model.learner.forward, rms(samples.baseline_V)
    free = replace(forward, known_mm=np.zeros(0))
    found = [row for level in LEVELS_DB
             for row in rows(free, samples.signal_V[some], samples.target[some, :4], level, below(level, volts))]
    table = pd.DataFrame(found).assign(**conditions())
    table.to_csv(RESULTS / "inversion_limit.csv", index=False, float_format="%.4g")
    print(table.iloc[:, :7].to_string(index=False, float_format="%.3g"))


if __name__ == "__main__":
    main()
