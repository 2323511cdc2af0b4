"""Whether intervals hold on what a surrogate was not trained on: unseen cards, another card, another mesh, under noise.

    python benchmarks/transfer.py POSTERIOR ONE_CARD [MESH] [--fidelity SWEEP] [--models MODEL ...]

POSTERIOR is a sweep with [material] draws, ONE_CARD one of the same design with one card, MESH one with that card whose
touches are solved on a finer mesh; --fidelity gives one of a lower accuracy. Forward models are trained on rows
of three quarters of the posterior's cards, with the cards ("carried") and with the same rows as if they had one ("left
out"), and on ONE_CARD ("one card"). They are scored on rows of the other quarter of the cards, on rows of ONE_CARD that
they have not seen, and on MESH; "one card, calibrated" has its intervals from half of MESH and is scored on the other
half, SPLITS times. Noise is white, in dB below the RMS of the baseline voltages, and told to the model. Writes
results/transfer.csv.
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import RESULTS, quick, shown, written
from numpy.typing import NDArray

from eitsim.sweeps.measurement.instrument import below
from surrogate.data import outputs
from surrogate.data.samples import SweepSamples, read_samples, take
from surrogate.learners.base import Estimate
from surrogate.model.sweep_model import SweepModel
from surrogate.model.train import train
from surrogate.model.trained import estimate, interval_scales
from surrogate.statistics.conformal import conformal_scale
from surrogate.statistics.metrics import COVERAGES, rms, score

MODELS = ("one card", "carried", "left out")
SEED, HELD_OUT, SPLITS = 1, 0.25, 20
# Rows that each model is made from, and rows of each set that score it.
ROWS, SCORED = quick(1600, 200), quick(200, 60)
LEVELS_DB = quick((np.inf, 80.0, 60.0, 40.0), (np.inf, 80.0))
Row = dict[str, object]


def some(samples: SweepSamples, rows: NDArray[np.bool_], count: int) -> SweepSamples:
    """Rows spread evenly over those chosen."""
    chosen = np.flatnonzero(rows)
    return take(samples, chosen[np.linspace(0, len(chosen) - 1, min(count, len(chosen))).round().astype(int)])


def by_card(samples: SweepSamples) -> tuple[SweepSamples, SweepSamples]:
    """Rows of some cards that train, and rows of the others."""
    cards = np.random.default_rng(SEED).permutation(np.unique(samples.card))
    held = np.isin(samples.card, cards[:round(HELD_OUT * len(cards))])
    return some(samples, ~held, ROWS), some(samples, held, SCORED)


def read(model: SweepModel, samples: SweepSamples, noise_V: float) -> Estimate:
    """What a model makes of rows under noise."""
    noise = noise_V * np.random.default_rng(SEED).normal(size=samples.signal_V.shape)
    return estimate(model, samples.signal_V + noise, noise_V)


def scored(name: str, case: str, level: float, samples: SweepSamples, found: Estimate,
           scales: NDArray[np.float64]) -> Iterator[Row]:
    """One row an output, with intervals of scales (coverages, rows or 1, outputs)."""
    for k, output in enumerate(outputs.ALL):
        s = score(samples.target[:, k], found.value[:, k], found.below[:, k] * scales[..., k],
                  found.above[:, k] * scales[..., k], output.unit)
        yield {"model": name, "set": case, "noise_dB": level, "output": output.name, "unit": s.unit, "rmse": s.rmse,
               "median_error": float(np.median(np.abs(found.value[:, k] - samples.target[:, k]))),
               "coverage_50": s.coverage_50, "coverage_90": s.coverage_90, "coverage_95": s.coverage_95,
               "scored_rows": s.n} | parts(found, k)


def parts(found: Estimate, k: int) -> Row:
    """RMS of the parts of the standard deviation before calibration."""
    assert found.parts is not None
    return {"sd_noise": rms(found.parts.noise[:, k]), "sd_material": rms(found.parts.material[:, k]),
            "sd_model": rms(found.parts.model(found.sd)[:, k]), "sd": rms(found.sd[:, k])}


def of(name: str, model: SweepModel, sets: Mapping[str, SweepSamples]) -> Iterator[Row]:
    """All sets and levels of one model."""
    volts = rms(model.baseline_V)
    for level in LEVELS_DB if name == "carried" else LEVELS_DB[:1]:
        noise_V = 0.0 if np.isinf(level) else below(level, volts)
        scales = interval_scales(model, noise_V, COVERAGES)
        for case, samples in sets.items():
            found = read(model, samples, noise_V)
            factors = np.stack([one.of(found.sd, found.near_edge) for one in scales])
            yield from scored(name, case, level, samples, found, factors)


def calibrated(model: SweepModel, mesh: SweepSamples) -> Iterator[Row]:
    """Half of another mesh's rows calibrate, the other half are scored; means over the splits."""
    found, rng = read(model, mesh, 0.0), np.random.default_rng(SEED)
    error, covered = found.value - mesh.target, []
    side = np.where(error > 0, found.below, found.above)
    for _ in range(SPLITS):
        used, held_back = np.array_split(rng.permutation(len(mesh)), 2)
        branched = model.learner.branched(model.names)
        scales = np.array([conformal_scale(error[used], side[used], len(used), c, branched) for c in COVERAGES])
        covered.append(np.mean(np.abs(error[held_back]) <= side[held_back] * scales[:, None], axis=1))
    held = np.mean(covered, axis=0)
    for k, row in enumerate(scored("one card, calibrated", "mesh, other half", np.inf, mesh, found,
                                   np.ones((len(COVERAGES), 1, len(outputs.ALL))))):
        yield row | {f"coverage_{round(100 * c)}": held[i, k] for i, c in enumerate(COVERAGES)} | {
            "scored_rows": len(mesh) // 2}


def with_others(rows: list[Row]) -> pd.DataFrame:
    """Rows, and those of other models that the table has already."""
    fresh, path = pd.DataFrame(rows), RESULTS / "transfer.csv"
    if not path.exists():
        return fresh
    old = pd.read_csv(path)
    return pd.concat([pd.DataFrame(old[~old["model"].isin(fresh["model"].tolist())]), fresh], ignore_index=True)


def main() -> None:
    """Measure, and write after each model; rows of models that were measured before are kept."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("posterior", type=Path, nargs="?")
    options.add_argument("one_card", type=Path, nargs="?")
    options.add_argument("mesh", type=Path, nargs="?")
    options.add_argument("--fidelity", type=Path)
    options.add_argument("--models", nargs="+", choices=MODELS, default=MODELS)
    given = options.parse_args()
    if given.one_card is None:
        print("transfer: nothing measured; give two sweeps: benchmarks/transfer.py POSTERIOR ONE_CARD [MESH]")
        return
    mesh = read_samples(given.mesh) if given.mesh else None
    seen, unseen = by_card(read_samples(given.posterior))
    own = read_samples(given.one_card)
    last = np.arange(len(own)) >= len(own) - 2 * SCORED
    sets = {"unseen cards": unseen, "one card": some(own, last, SCORED)}
    sets |= {"mesh": mesh} if mesh else {}
    sets |= {"fidelity": read_samples(given.fidelity)} if given.fidelity else {}
    trained = dict(zip(MODELS, (some(own, ~last, ROWS), seen, replace(seen, material=seen.material[:, :0])),
                       strict=True))
    for name in given.models:
        model = train(trained[name], "forward", seed=SEED)
        rows = list(of(name, model, sets))
        if mesh and name == "one card":
            rows += calibrated(model, mesh)
        shown(written(with_others(rows), "transfer"))


if __name__ == "__main__":
    main()
