"""How often the 90 % intervals of F hold touches whose d and F lie on a ridge: tops of the amplitude, ends of ranges.

Usage: python benchmarks/ridge.py MODEL CARD [DRAWS]. Synthetic: 21 touches by the simulator, white noise at 100, 80 and
60 dB below the baseline. Prints, for each level, the share held, that of the worst touch not flagged, and the RMSE.
"""

from __future__ import annotations

import sys

import numpy as np

import eitsim
import surrogate
from surrogate.model.predict import predict, prepare

# (x, y, d, F), mm and N: the touch of the review, then others at places drawn within 44 mm.
KINDS = ((10, .3), (10, .6), (10, 1.0), (10, 1.9), (10, .12), (12, .6), (12, .9), (12, 1.9), (12, .11), (14, .9),
         (14, 1.4), (14, 1.95), (14, .15), (16, 1.2), (16, 1.9), (16, .12), (18, 1.5), (18, 1.95), (18, .12), (10, 1.3))


def touches() -> np.ndarray:
    """(21, 4) touches."""
    rng = np.random.default_rng(20)
    radius, angle = np.array([[44 * np.sqrt(rng.random()), 2 * np.pi * rng.random()] for _ in KINDS]).T
    return np.vstack([[-33.0, 25.0, 10.0, 1.6],
                      np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.array(KINDS)])])


def main(folder: str, card: str, draws: int = 48) -> None:
    """Print the table of a model."""
    model, touch = surrogate.load(folder), touches()
    punches = [eitsim.Punch(x / 1e3, y / 1e3, d / 1e3, force) for x, y, d, force in touch]
    signal = np.array([eitsim.simulate(eitsim.Scene(punches=(one,)), card, reuse=True).readings.signal_V.ravel()
                       for one in punches])
    k, truth = model.names.index("F"), np.repeat(touch[:, 3], draws)
    for level in (100, 80, 60):
        noise = float(np.sqrt(np.mean(model.baseline_V**2))) * 10 ** (-level / 20)
        drawn = np.random.default_rng(0).normal(size=(len(truth), signal.shape[1]))
        volts = model.baseline_V + np.repeat(signal, draws, axis=0) + noise * drawn
        found = predict(prepare(model, model.baseline_V, noise), volts)
        error = found.value[:, k] - truth
        held = ((error <= found.below[:, k]) & (-error <= found.above[:, k])).reshape(-1, draws).mean(axis=1)
        flagged = np.array([bool(flag) for flag in found.flag]).reshape(-1, draws).mean(axis=1)
        print(f"{level} dB: {held.mean():.3f} held; least of a touch flagged in under half of its frames "
              f"{held[flagged < 0.5].min():.2f}; RMSE {np.sqrt(np.mean(error**2)):.3f} N")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2], *map(int, sys.argv[3:]))
