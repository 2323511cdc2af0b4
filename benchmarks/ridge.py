"""How often the 90 % intervals of F hold touches whose d and F lie on a ridge: tops of the amplitude, ends of ranges.

    python benchmarks/ridge.py CARD MODEL [MODEL ...]

MODEL is of method forward, trained on a sweep of examples/design.toml with CARD and with the skin driven by STRAIN,
under which the amplitude has a top. Synthetic: 21 touches that were chosen ("chosen"), and as many that are drawn
("drawn": a top, a heavy and a light end in turn, of any punch, by the amplitude and range of the first model), by the
simulator, with white noise at 100, 80 and 60 dB below the baseline; and the chosen ones by its finer meshes ("chosen,
finer"), since intervals count the simulator's own error. Each is read DRAWS times. held: part of the frames whose
interval holds F; least_unflagged: that of the worst touch which is flagged in under half of its frames. Writes
results/ridge.csv.
"""

import sys
from collections.abc import Iterator

import numpy as np
import pandas as pd
from conditions import quick, shown, written

import eitsim
from surrogate.forward_map.amplitude import amplitude
from surrogate.forward_map.forward_map import ForwardMap
from surrogate.learners.forward import TouchInversion
from surrogate.model.model import load_of_sweep
from surrogate.model.predict import predict, prepare
from touchcal.arrays import Array

STRAIN = "normal"
# (d, F), mm and N: the touch of the review, then others at places drawn within REACH_MM.
KINDS = ((10, .3), (10, .6), (10, 1.0), (10, 1.9), (10, .12), (12, .6), (12, .9), (12, 1.9), (12, .11), (14, .9),
         (14, 1.4), (14, 1.95), (14, .15), (16, 1.2), (16, 1.9), (16, .12), (18, 1.5), (18, 1.95), (18, .12), (10, 1.3))
REACH_MM, DRAWS, LEVELS_DB = 44.0, quick(48, 4), (100.0, 80.0, 60.0)
# Part of the range of F that is an end of it, and how far from a top, relative, touches are drawn.
END, ABOUT = 0.05, 0.2


def places(count: int, rng: np.random.Generator) -> Array:
    """(count, 2) places evenly within REACH_MM, mm."""
    radius, angle = np.array([[REACH_MM * np.sqrt(rng.random()), 2 * np.pi * rng.random()] for _ in range(count)]).T
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def chosen() -> Array:
    """(21, 4) touches (x, y, d, F), mm and N."""
    others = np.column_stack([places(len(KINDS), np.random.default_rng(20)), KINDS])
    return np.vstack([[-33.0, 25.0, 10.0, 1.6], others])


def drawn(forward: ForwardMap, low: float, high: float) -> Array:
    """(21, 4) touches of forces between two; the tops are those of the map's amplitude, or the heaviest force."""
    rng, curves = np.random.default_rng(7), amplitude(forward)["diameters"]
    of_kind = (lambda top: min((high if top is None else top) * rng.uniform(1 - ABOUT, 1 + ABOUT), high),
               lambda _: rng.uniform(high - END * (high - low), high),
               lambda _: rng.uniform(low, low + END * (high - low)))
    punches = [(curve["d_mm"], of_kind[k % len(of_kind)](curve["peak_N"]))
               for k, curve in enumerate(rng.choice(curves, len(KINDS) + 1))]
    return np.column_stack([places(len(punches), rng), punches])


def signals(touches: Array, card: str, *, finer: bool = False) -> Array:
    """(n, readings) signals, V."""
    scenes = [eitsim.Scene(punches=(eitsim.Punch(x / 1e3, y / 1e3, d / 1e3, force),), skin=eitsim.Skin(strain=STRAIN))
              for x, y, d, force in touches]
    found = [eitsim.simulate(one, card, exact=finer, reuse=not finer).readings for one in scenes]
    return np.array([one.signal_V.ravel() for one in found if one is not None])


def rows(folder: str, sets: dict[str, tuple[Array, Array]]) -> Iterator[dict[str, object]]:
    """One row a level and set of touches and signals."""
    model = load_of_sweep(folder)
    k, scenes = model.names.index("F"), model.record["dataset"]["rows"]
    for level in LEVELS_DB:
        noise = float(np.sqrt(np.mean(model.baseline_V**2))) * 10 ** (-level / 20)
        predictor = prepare(model, model.baseline_V, noise)
        for name, (touches, signal) in sets.items():
            volts = model.baseline_V + np.repeat(signal, DRAWS, axis=0)
            found = predict(predictor, volts + noise * np.random.default_rng(0).normal(size=volts.shape))
            error = found.value[:, k] - np.repeat(touches[:, 3], DRAWS)
            held = ((error <= found.below[:, k]) & (-error <= found.above[:, k])).reshape(-1, DRAWS).mean(axis=1)
            flagged = np.array([bool(flag) for flag in found.flag]).reshape(-1, DRAWS).mean(axis=1)
            yield {"scenes": scenes, "touches": name, "noise_dB": level, "frames": len(error), "held": held.mean(),
                   "least_unflagged": held[flagged < 0.5].min(), "flagged": flagged.mean(),
                   "rmse_N": np.sqrt(np.mean(error**2)), "half_width_median_N": np.median(found.half_width[:, k])}


def main(card: str, folders: list[str]) -> None:
    """Measure every model and write."""
    first = load_of_sweep(folders[0])
    if not isinstance(first.learner, TouchInversion):
        sys.exit(f"ridge.py: {folders[0]} is not of method forward.")
    low, high = (float(end[first.names.index("F")]) for end in (first.trained.lowest, first.trained.highest))
    ours, others = chosen(), drawn(first.learner.forward, low, high)
    sets = {"chosen": (ours, signals(ours, card)), "drawn": (others, signals(others, card)),
            "chosen, finer": (ours, signals(ours, card, finer=True))}
    shown(written(pd.DataFrame([row for folder in folders for row in rows(folder, sets)]), "ridge"))


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2:])
