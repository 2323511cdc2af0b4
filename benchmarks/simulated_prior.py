"""What a simulated sweep teaches next to few recorded presses, on a synthetic sensor: no skin measured.

Usage: python benchmarks/simulated_prior.py SWEEP, a folder that `eitsim sweep` wrote, as of examples/design.toml with
300 scenes. Half of its rows, at random, are the sweep of `--simulated`. The others are presses of the synthetic sensor:
each reading has a gain of its own (logarithm normal of standard deviation 0.3, either sign), noise of a standard
deviation of 0.05 of the mean size of a reading, and labels in coordinates in which the sensor is turned, mirrored and
moved. Both halves follow one physics and one card, so that a measured sensor gains less. Templates of direction, taught
by some presses and tested on the others of their half; `prior`: nothing, the sensitivity of a uniform disc, or the
sweep; `used`: part of the repeats in which held-out presses spoke for it. Writes results/simulated_prior.csv.
"""

import sys
import time
from itertools import product
from pathlib import Path

import numpy as np
from conditions import quick, shown, written

from eitsim.electrics.forward.untouched import sensor_of
from eitsim.sensors.sensor_file import Sensor
from eitsim.sweeps.dataset.parquet import open_dataset
from surrogate.data.samples import read_samples, take
from surrogate.recordings import templates
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.physics.disc_sensitivity import DiscSensitivity
from surrogate.recordings.physics.expectation import Expectation, Model
from surrogate.recordings.physics.simulated_patterns import simulated_patterns
from touchcal.arrays import Array

NAME = "simulated_prior"
LABELS, REPEATS = quick((10, 20, 40), (10,)), quick(6, 2)
GAIN, NOISE = 0.3, 0.05
TURN, MIDDLE_MM = 2.0, (30.0, -40.0)
PRIORS = ("nothing", "disc", "sweep")


def main(folder: Path) -> None:
    samples, scene = read_samples(folder), sensor_of(open_dataset(folder).design["tables"])
    sensor = Sensor(scene.body, scene.skin, scene.electrodes, scene.drive)
    taught, pressed = np.array_split(np.random.default_rng(0).permutation(len(samples)), 2)
    models: dict[str, Model] = {"disc": DiscSensitivity(sensor.protocol),
                                "sweep": simulated_patterns(take(samples, taught), sensor.protocol)}
    radius = samples.ring.radius_mm
    signal, place = synthetic_presses(samples.signal_V[pressed], samples.targets(["x0", "y0"])[pressed])
    rows = []
    for labels, name in product(LABELS, PRIORS):
        priors = [templates.nothing, *([Expectation(models[name], radius).learn] if name in models else [])]
        errors, used, begun = [], [], time.process_time()
        for repeat in range(REPEATS):
            chosen = np.random.default_rng(repeat).permutation(len(place))
            train, test = np.sort(chosen[:labels]), chosen[labels:]
            found = templates.fit(signal[train], place[train], time_blocks(labels), compress=False,
                                  priors=priors).templates
            errors.append(np.linalg.norm(found.read(signal[test])[0] - place[test], axis=1).mean())
            used.append(found.weights[1:].sum())
        rows.append({"labels": labels, "prior": name, "repeats": REPEATS, "used": np.mean(used),
                     "error_mm": np.mean(errors), "se_mm": np.std(errors, ddof=1) / np.sqrt(REPEATS),
                     "cpu_s": (time.process_time() - begun) / REPEATS})
    shown(written(rows, NAME))


def synthetic_presses(signal: Array, place: Array) -> tuple[Array, Array]:
    """Signals (n, m) of a sensor with gains and noise, and places (n, 2), mm, as it lies."""
    rng = np.random.default_rng(1)
    gains = np.exp(GAIN * rng.standard_normal(signal.shape[1])) * rng.choice([-1, 1], signal.shape[1])
    seen = signal * gains
    seen = seen + NOISE * np.abs(seen).mean() * rng.standard_normal(seen.shape)
    z = (place[:, 0] - 1j * place[:, 1]) * np.exp(1j * TURN)
    return seen, np.stack([z.real, z.imag], axis=1) + MIDDLE_MM


if __name__ == "__main__":
    main(Path(sys.argv[1]))
