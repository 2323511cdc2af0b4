"""What drifts of the instrument between the untouched and the touched frame cost, with and without counting them.

Usage: python benchmarks/frame_drift.py SWEEP. SWEEP is of examples/design.toml and some 1,000 scenes; models of the
methods forward and ridge are trained on it (seed 0) and read its test rows. Synthetic: touches by the simulator, the
untouched frame the mean of 20, white noise 80 dB below its RMS. Drifts are drawn for each touched frame: "gain of one
channel" (a random one, 0.1 % up or down), "contacts" (each 1 %, of STATES drawn states of the ring), "both", "all
gains" (each 0.1 %, one standard deviation). Channels read the potentials of the complete electrode model against the
mean of the electrodes, and changed contacts are solved anew; both on the untouched disc, and neither takes the
derivatives that the method does. counted: whether the method counts gain 0.001 and contact 0.01. Columns: root mean
square errors of x, y, F (xy_over: that of the place over the one without drift by the same method, nothing counted),
part of the 90 % intervals that hold, median half width of those of F, parts of the frames that are flagged, and in
which the channel that drifted is named. Writes results/frame_drift.csv.
"""

import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import quick, shown, written

import surrogate
from eitsim.electrics.forward.untouched import conductance_of, sensor_of, untouched_impedance, untouched_readings
from eitsim.scene.drive import protocol
from eitsim.scene.electrodes import contact_impedances
from eitsim.scene.scene import Scene
from eitsim.sweeps.dataset.parquet import read_manifest
from surrogate.data.samples import SweepSamples, read_samples, split, take
from touchcal.arrays import Array

TOUCHES, RESTS, NOISE_DB, STATES = quick(150, 12), 20, 80.0, quick(20, 2)
GAIN, CONTACT = 1e-3, 1e-2
CASES = ("none", "gain of one channel", "contacts", "both", "all gains")


@dataclass(frozen=True, eq=False)
class Bench:
    """Touches of a sweep that its models have not seen."""

    scene: Scene  # of the sensor
    truth: Array  # (n, 3) x, y, F in m and N
    signal_V: Array  # (n, readings)
    rest_V: Array  # (readings,) untouched
    impedance_Ohm: Array  # (N, N) untouched
    contacts_V: Array  # (STATES, readings) what changed contacts add


def bench_of(sweep: Path) -> tuple[Bench, SweepSamples]:
    """The test rows of a sweep, and the sweep."""
    samples, scene = read_samples(sweep), sensor_of(read_manifest(sweep)["design"]["tables"])
    test = take(samples, np.flatnonzero(split(samples.group, 0) == "test")[:TOUCHES])
    rest, rng = samples.baseline_V.mean(axis=0), np.random.default_rng(29)
    sheet = conductance_of(scene, rest)
    contacts = []
    for _ in range(STATES):
        z = contact_impedances(scene.electrodes) * (1 + CONTACT * rng.standard_normal(scene.electrodes.count))
        electrodes = replace(scene.electrodes, contact_impedance_Ohm_m=tuple(z.tolist()))
        contacts.append(untouched_readings(replace(scene, electrodes=electrodes), sheet) - rest)
    truth = test.targets(("x0", "y0", "F")) * [1e-3, 1e-3, 1]
    impedance = untouched_impedance(scene.body, scene.electrodes, sheet)
    return Bench(scene, truth, test.signal_V, rest, impedance, np.array(contacts)), samples


def read(bench: Bench, gain: Array) -> Array:
    """(readings,) V of the untouched disc, electrodes against their mean by channels of gains (N,)."""
    asked = protocol(bench.scene.drive, len(gain))
    potential = asked.currents_A @ bench.impedance_Ohm.T
    potential = potential - potential.mean(axis=1, keepdims=True)
    return np.einsum("pre,pe->pr", asked.weights, gain * potential).ravel()


def drifted(bench: Bench, case: str) -> tuple[Array, Array]:
    """(n, readings) touched frames, V, and the channel (n,) whose gain changed, -1 where not one alone did."""
    rng, count = np.random.default_rng(CASES.index(case)), bench.scene.electrodes.count
    frames, channels = bench.rest_V + bench.signal_V, np.full(len(bench.truth), -1)
    for k in range(len(frames)):
        gain = np.ones(count)
        if case in ("gain of one channel", "both"):
            channels[k] = rng.integers(count)
            gain[channels[k]] += GAIN * rng.choice([-1, 1])
        if case == "all gains":
            gain += GAIN * rng.standard_normal(count)
        frames[k] += read(bench, gain) - read(bench, np.ones(count))
        if case in ("contacts", "both"):
            frames[k] += bench.contacts_V[rng.integers(STATES)]
    return frames, channels


def scored(model: surrogate.SweepModel, bench: Bench, frames: Array, channels: Array, *,
           counted: bool) -> dict[str, float]:
    """Errors, coverage and flags of frames with noise."""
    rng, rest = np.random.default_rng(11), bench.rest_V
    noise_V = np.sqrt(np.mean(rest**2)) * 10 ** (-NOISE_DB / 20)
    volts = frames + noise_V * rng.standard_normal(frames.shape)
    untouched = rest + noise_V * rng.standard_normal((RESTS, len(rest)))
    drift = {"gain_drift": GAIN, "contact_drift": CONTACT, "scene": bench.scene} if counted else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table = model.predict(volts, untouched, **drift)
    value, low, high = (table[[f"{name}{end}_{unit}" for name, unit in (("x0", "m"), ("y0", "m"), ("F", "N"))]]
                        .to_numpy() for end in ("", "_lo90", "_hi90"))
    x, y, force = np.sqrt(np.nanmean((value - bench.truth) ** 2, axis=0)) * [1e3, 1e3, 1]
    inside = np.mean((low <= bench.truth) & (bench.truth <= high), axis=0)
    named = [f"channel {k} " in flag for k, flag in zip(channels, table["flag"], strict=True) if k >= 0]
    return {"x_mm": x, "y_mm": y, "F_N": force, "x_in_90": inside[0], "y_in_90": inside[1], "F_in_90": inside[2],
            "half_F_N": float(np.median(high[:, 2] - low[:, 2])) / 2, "flagged": float((table["flag"] != "").mean()),
            "named": float(np.mean(named)) if named else np.nan, "read": float(np.isfinite(value[:, 0]).mean())}


def rows(sweep: Path) -> Iterator[dict[str, object]]:
    """One row a method, drift and option."""
    bench, samples = bench_of(sweep)
    for method in ("forward", "ridge"):
        model = surrogate.train(samples, method=method, outputs="x0,y0,d,F", seed=0)
        without = np.nan
        for case in CASES:
            frames, channels = drifted(bench, case)
            for counted in (False, True) if method == "forward" else (False,):
                found = scored(model, bench, frames, channels, counted=counted)
                place = float(np.hypot(found["x_mm"], found["y_mm"]))
                without = place if case == "none" and not counted else without
                row = {"method": method, "drift": case, "counted": counted} | found | {"xy_over": place / without}
                shown(pd.DataFrame([row]))
                yield row


if __name__ == "__main__":
    written(list(rows(Path(sys.argv[1]))), "frame_drift")
