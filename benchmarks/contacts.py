"""Is a press found at once? Hundreds of simulated presses through a tracker, and the least rate that they show.

Run as `python benchmarks/contacts.py MODEL_DIR CARD SWEEP_DIR`; writes results/contacts.csv next to this file, and the
simulated touches into SWEEP_DIR, where a later run finds them. Presses are those of `tracker.py`, held short: punches
of the trained diameters within 25 mm, whose force grows from 0.02 N to 0.4 to 1.8 N in 4 to 14 frames at 50 a second.
Every frame is the simulator's own, a sweep of a table of scenes; noise is white, 80 dB unless a row says otherwise,
and `drift` as in `tracker.py`. `gains and contacts` lets the gain of each channel walk by 0.1 % in a minute and each
contact by 1 % (standard deviations, first order, of the untouched frame). `... 0.02 N` and the like have light presses
of that force alone, held for HELD frames, at the places of the first LIGHT presses: signals of 0.02 N, scaled.

found_2: part of the presses before which no contact is said and that are found within two frames from the first of
0.1 N, or of the first of a light one; found_2_least: what that part is at least, at 95 % confidence (Clopper and
Pearson, one-sided); false: contacts in other untouched frames, a thousand.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import tracker
from conditions import quick, shown, written
from numpy.typing import NDArray
from scipy.stats import beta

import surrogate
from eitsim.electrics.forward.untouched import sensor_of
from eitsim.sweeps.dataset.parquet import read_manifest
from surrogate.data.frame_drift import frame_drift
from surrogate.model.tracking.tracked import SEVERAL_TOUCHES, TOUCH

PRESSES, REST, HELD = quick(300, 12), 15, 5
LIGHT, LIGHT_N = quick(100, 4), quick((0.01, 0.02, 0.03, 0.05), (0.02,))
GAIN, CONTACT, WALK_S = 1e-3, 1e-2, 60.0
CONFIDENCE = 0.95


def presses(count: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Presses (n,), -1 where nothing touches, and touches (n, 4), mm and N, of all frames."""
    rng = np.random.default_rng(seed)
    press, touch = [-1] * tracker.UNTOUCHED, [np.full((tracker.UNTOUCHED, 4), np.nan)]
    for number in range(count):
        one = tracker.path("hold", rng)
        ramp = int(np.argmax(one[:, 3] == one[:, 3].max()))
        short = np.concatenate([one[:ramp + HELD], one[len(one) - ramp:], np.full((REST, 4), np.nan)])
        press += [number] * (len(short) - REST) + [-1] * REST
        touch.append(short)
    return np.array(press, dtype=float), np.concatenate(touch)


def light(stream: tracker.Stream, force_N: float) -> tracker.Stream:
    """The first LIGHT presses of a stream, held at a light force."""
    first = np.array([np.argmax(stream.press == p) for p in range(LIGHT)])
    which = np.concatenate([np.full(tracker.UNTOUCHED, -1), *(np.r_[[k] * HELD, [-1] * REST] for k in first)])
    none = which < 0
    touch = np.where(none[:, None], np.nan, stream.touch[which] * [1, 1, 1, force_N / tracker.LEAST_N])
    signal = np.where(none[:, None], 0.0, stream.signal_V[which] * force_N / tracker.LEAST_N)
    return replace(stream, press=np.where(none, -1, stream.press[which]), touch=touch, signal_V=signal)


def instrument(model: surrogate.SweepModel, folder: Path, frames: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(frames, readings) walk of the untouched frame by gains and contacts, V."""
    sensor = sensor_of(read_manifest(folder / "sweep")["design"]["tables"])
    root = frame_drift(model.ring, model.baseline_V, GAIN, CONTACT, sensor).root / np.sqrt(WALK_S * tracker.RATE_HZ)
    return np.cumsum(rng.normal(size=(frames, root.shape[1])), axis=0) @ root.T


def scored(name: str, model: surrogate.SweepModel, stream: tracker.Stream, volts: NDArray[np.float64],
           least_N: float = tracker.FOUND_N) -> dict[str, object]:
    """How many presses of a stream are found within two frames from the first of some force."""
    said, spent = tracker.followed(model, stream, volts)
    touches = np.array([one.state in (TOUCH, SEVERAL_TOUCHES) for one in said])
    strong = stream.touch[:, 3] >= least_N
    first = [int(np.argmax(stream.press == p)) for p in range(int(stream.press.max()) + 1)]
    each = [not touches[begun - 1] and touches[np.flatnonzero((stream.press == p) & strong)[:2]].any()
            for p, begun in enumerate(first)]
    found, rest = sum(map(bool, each)), stream.press < 0
    lifted = np.flatnonzero(rest[1:] & ~rest[:-1]) + 1
    rest[np.concatenate([lifted, lifted + 1])] = False
    return {"stream": name, "frames": len(touches), "presses": len(each), "found_2": found / len(each),
            "found_2_least": float(beta.ppf(1 - CONFIDENCE, found, len(each) - found + 1)),
            "false": 1e3 * float(np.mean(touches[rest])), "cpu_ms": float(spent.mean()),
            "cpu_95_ms": float(np.quantile(spent, 0.95)),
            "p95_delay_ms": float(np.quantile(tracker.delays(spent), 0.95))}


def main() -> None:
    if len(sys.argv) != 4:
        raise SystemExit("contacts.py: give a forward model, its card, and a folder for the simulated touches.")
    model, rng = surrogate.load(Path(sys.argv[1])), np.random.default_rng(0)
    press, touch = presses(PRESSES, 1)
    stream = tracker.solved(["hold"] * len(press), press, touch, sys.argv[2], Path(sys.argv[3]))
    rows = [scored(f"{level:g} dB", model, stream, tracker.with_noise(model, stream.signal_V, rng, level))
            for level in (80.0, 70.0)]
    drifts = {"drift": lambda frames: tracker.drift(model, frames, rng),
              "gains and contacts": lambda frames: instrument(model, Path(sys.argv[3]), frames, rng)}
    for name, walk in drifts.items():
        volts = tracker.with_noise(model, stream.signal_V + walk(len(stream.press)), rng)
        rows.append(scored(name, model, stream, volts))
    for name, walk in {f"{tracker.NOISE_DB:g} dB": None, **drifts}.items():
        for force_N in LIGHT_N:
            soft = light(stream, force_N)
            added = walk(len(soft.press)) if walk else 0.0
            rows.append(scored(f"{name}, {force_N:g} N", model, soft,
                               tracker.with_noise(model, soft.signal_V + added, rng), 0.0))
    shown(written(rows, "contacts"))


if __name__ == "__main__":
    main()
