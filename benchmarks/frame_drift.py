"""What drifts of the instrument between the untouched and the touched frame cost, with and without counting them.

Usage: python benchmarks/frame_drift.py CARD SWEEP. SWEEP is of examples/design.toml with CARD and some 1,000 scenes;
models of the methods forward and ridge are trained on it (seed 0). Synthetic: touches of the same kind by the
simulator (seed 29, so none of the sweep's), the untouched frame the mean of 20, white noise 80 dB below its RMS. Drifts
are drawn for each touched frame: "gain of one channel" (a random one, 0.1 % up or down), "contacts" (each 1 %),
"both", "all gains" (each 0.1 %, one standard deviation). A drifted frame is that of the touched disc's impedance
matrix, its channels read against the mean of the electrodes with their gains, and with changed contacts solved anew on
the untouched disc, whose change is added; neither takes the derivatives that the method does. drift: whether the method
counts gain 0.001 and contact 0.01. Columns: root mean square errors of x, y, F (xy_over: that of the place over the one
without drift by the same method and option off), part of the 90 % intervals that hold, part of the frames that are
flagged, and part in which the drifted channel is named. Writes results/frame_drift.csv.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import quick, shown, written

import eitsim
import surrogate
from eitsim.electrics.forward.untouched import conductance_of, untouched_impedance
from eitsim.scene.drive import protocol
from eitsim.scene.electrodes import contact_impedances
from surrogate.data.samples import read_samples
from touchcal.arrays import Array

TOUCHES, RESTS, NOISE_DB = quick(200, 12), 20, 80.0
GAIN, CONTACT = 1e-3, 1e-2
CASES = ("none", "gain of one channel", "contacts", "both", "all gains")
SCENE = eitsim.Scene()


@dataclass(frozen=True, eq=False)
class Bench:
    """Touches of the simulator."""

    truth: Array  # (n, 4) x, y, d, F in mm and N
    impedance: Array  # (n, N, N) of the touched disc, Ohm
    rest: Array  # (N, N) untouched, Ohm
    sheet_S: float


def touched(card: str) -> Bench:
    """Touches within 42 mm of the middle, of the sweep's diameters and forces."""
    rng = np.random.default_rng(29)
    radius, angle = 42 * np.sqrt(rng.random(TOUCHES)), 2 * np.pi * rng.random(TOUCHES)
    truth = np.column_stack([radius * np.cos(angle), radius * np.sin(angle),
                             rng.choice([10, 12, 14, 16, 18], TOUCHES), rng.uniform(0.1, 2.0, TOUCHES)])
    found = []
    for x, y, d, force in truth:
        punch = eitsim.Punch(x / 1e3, y / 1e3, d / 1e3, force)
        readings = eitsim.simulate(replace(SCENE, punches=(punch,)), card, reuse=True).readings
        assert readings is not None
        found.append(readings)
    sheet = conductance_of(SCENE, found[0].baseline_V.ravel())
    return Bench(truth, np.array([one.impedance_Ohm for one in found]),
                 untouched_impedance(SCENE.body, SCENE.electrodes, sheet), sheet)


def read(impedance: Array, gain: Array) -> Array:
    """(readings,) V of electrodes against their mean, channels of these gains (N,)."""
    asked = protocol(SCENE.drive, len(gain))
    potential = asked.currents_A @ impedance.T
    potential = potential - potential.mean(axis=1, keepdims=True)
    return np.einsum("pre,pe->pr", asked.weights, gain * potential).ravel()


def drifted(bench: Bench, case: str) -> tuple[Array, Array]:
    """(n, readings) touched frames, V, and the channel (n,) whose gain changed, -1 where not one alone did."""
    rng, count = np.random.default_rng(CASES.index(case)), SCENE.electrodes.count
    frames, channels = [], np.full(TOUCHES, -1)
    for k, impedance in enumerate(bench.impedance):
        gain = np.ones(count)
        if case in ("gain of one channel", "both"):
            channels[k] = rng.integers(count)
            gain[channels[k]] += GAIN * rng.choice([-1, 1])
        if case == "all gains":
            gain += GAIN * rng.standard_normal(count)
        if case in ("contacts", "both"):
            z = contact_impedances(SCENE.electrodes) * (1 + CONTACT * rng.standard_normal(count))
            other = replace(SCENE.electrodes, contact_impedance_Ohm_m=tuple(z.tolist()))
            impedance = impedance + untouched_impedance(SCENE.body, other, bench.sheet_S) - bench.rest
        frames.append(read(impedance, gain))
    return np.array(frames), channels


def scored(model: surrogate.Model, bench: Bench, frames: Array, channels: Array, *, counted: bool) -> dict[str, float]:
    """Errors, coverage and flags of frames with noise."""
    rng, rest = np.random.default_rng(11), read(bench.rest, np.ones(SCENE.electrodes.count))
    noise_V = np.sqrt(np.mean(rest**2)) * 10 ** (-NOISE_DB / 20)
    volts = frames + noise_V * rng.standard_normal(frames.shape)
    untouched = rest + noise_V * rng.standard_normal((RESTS, len(rest)))
    drift = {"gain_drift": GAIN, "contact_drift": CONTACT, "scene": SCENE} if counted else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table = model.predict(volts, untouched, **drift)
    truth = bench.truth[:, [0, 1, 3]] * [1e-3, 1e-3, 1]
    value, low, high = (table[[f"{name}{end}_{unit}" for name, unit in (("x0", "m"), ("y0", "m"), ("F", "N"))]]
                        .to_numpy() for end in ("", "_lo90", "_hi90"))
    x, y, force = np.sqrt(np.nanmean((value - truth) ** 2, axis=0)) * [1e3, 1e3, 1]
    inside = np.mean((low <= truth) & (truth <= high), axis=0)
    named = [f"channel {k} " in flag for k, flag in zip(channels, table["flag"], strict=True) if k >= 0]
    return {"x_mm": x, "y_mm": y, "F_N": force, "x_in_90": inside[0], "y_in_90": inside[1], "F_in_90": inside[2],
            "half_F_N": float(np.median(high[:, 2] - low[:, 2])) / 2, "flagged": float((table["flag"] != "").mean()),
            "named": float(np.mean(named)) if named else np.nan, "read": float(np.isfinite(value[:, 0]).mean())}


def rows(card: str, sweep: Path) -> Iterator[dict[str, object]]:
    """One row a method, drift and option."""
    bench, samples = touched(card), read_samples(sweep)
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
    written(list(rows(sys.argv[1], Path(sys.argv[2]))), "frame_drift")
