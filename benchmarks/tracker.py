"""A tracker on simulated streams: error, coverage, detection of contact, and CPU time a frame.

Run as `python benchmarks/tracker.py MODEL_DIR CARD SWEEP_DIR`; writes results/tracker.csv next to this file, and the
simulated presses into SWEEP_DIR, where a later run finds them. The frames are the
simulator's own at each place and force (a sweep of a table of scenes), so that the map that reads them, learned from
other touches, is not tested on itself. Presses hold, slide, roll off, or are lifted and pressed again elsewhere within
0.1 s, by punches of the trained diameters under 0.02 to 1.8 N within 40 mm, at 50 frames a second; noise is white,
80 dB below the untouched readings' RMS unless a row says otherwise, and known from the first 20 frames. `drift` adds a
random walk of the untouched frame along 3 directions, `dead channel` loses one reading in the second press, `pair`
adds the signals of two presses (superposition, not a simulation of two).

found_2: part of presses that are found within two frames from the first of 0.1 N; let_go_2: that are let go within
two; false: contacts in other untouched frames, a thousand; several: frames of 0.1 N and more that are said to be more
than one touch; p95_delay_ms: read-out delay at 50 frames a second by the CPU times in turn. Coverage is of frames that
have values, 90 % intervals.
"""

import csv
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from conditions import quick, shown, written
from numpy.typing import NDArray

import eitsim
import surrogate
from surrogate.model.tracking.tracked import SEVERAL_TOUCHES, TOUCH, Tracked
from surrogate.statistics.conformal import COVERAGE
from surrogate.statistics.metrics import rms
from touchcal.arrays import Array

RATE_HZ, EACH, LEAST_N, FOUND_N = 50.0, quick(6, 1), 0.02, 0.1
KINDS = ("hold", "slide", "roll off", "press again")
DIAMETERS_MM, WITHIN_MM = (10.0, 12.0, 14.0, 16.0, 18.0), 40.0
UNTOUCHED, BETWEEN = 40, 5  # untouched frames before each press, and where it is pressed again
NOISE_DB = 80.0
DRIFT_V, DRIFTS = 1e-4, 3  # of the untouched readings' RMS, a direction and root second


@dataclass(frozen=True, eq=False)
class Stream:
    """Frames in time order."""

    kind: list[str]
    press: Array  # (n,) number of the press; -1 where nothing touches
    touch: Array  # (n, 4) x, y, d, mm, F, N
    signal_V: Array  # (n, readings)


def path(kind: str, rng: np.random.Generator) -> Array:
    """(n, 4) touches of one press, mm and N."""
    d, most = rng.choice(DIAMETERS_MM), rng.uniform(0.4, 1.8)
    held = {"hold": 40, "slide": 50, "roll off": 20, "press again": 15}[kind]
    ramp = np.linspace(LEAST_N, most, rng.integers(4, 15))
    fall = ramp[::-1] if kind != "roll off" else np.linspace(most, LEAST_N, 40)
    force = np.concatenate([ramp, np.full(held, most), fall])
    angle, speed = rng.uniform(0, 2 * np.pi), {"slide": rng.uniform(20, 60), "roll off": 15.0}.get(kind, 0.0)
    turn = rng.uniform(0, 2 * np.pi)
    way = speed / RATE_HZ * np.maximum(np.arange(len(force)) - len(ramp), 0)
    start = rng.uniform(0, 12 if kind == "slide" else 25) * np.exp(1j * angle)
    z = start + way * np.exp(1j * turn)
    z *= np.minimum(1, WITHIN_MM / np.maximum(np.abs(z), 1e-9))
    return np.column_stack([z.real, z.imag, np.full(len(z), d), force])


def paths(seed: int) -> tuple[list[str], Array, Array]:
    """Kinds, presses and touches of all frames, NaN where nothing touches."""
    rng, kinds, press, touch = np.random.default_rng(seed), [], [], []
    for number, kind in enumerate(k for _ in range(EACH) for k in KINDS):
        for again in range(2 if kind == "press again" else 1):
            rest, one = BETWEEN if again else UNTOUCHED, path(kind, rng)
            kinds += [kind] * (rest + len(one))
            press += [-1] * rest + [2 * number + again] * len(one)
            touch += [np.full((rest, 4), np.nan), one]
    return [*kinds, *["hold"] * UNTOUCHED], np.array([*press, *[-1] * UNTOUCHED], float), np.concatenate(
        [*touch, np.full((UNTOUCHED, 4), np.nan)])


def simulated(card: str, folder: Path, seed: int) -> Stream:
    """The stream with the simulator's signals."""
    return solved(*paths(seed), card, folder)


def solved(kind: list[str], press: Array, touch: Array, card: str, folder: Path) -> Stream:
    """A stream with the simulator's signals; touches that the folder has already are not solved again, and equal ones
    are solved once."""
    touched = press >= 0
    different, which = np.unique(touch[touched], axis=0, return_inverse=True)
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "scenes.csv", "w", newline="") as file:
        csv.writer(file).writerows([("x_mm", "y_mm", "d_mm", "F_N"), *different.tolist()])
    table = eitsim.sweep(folder / "scenes.csv", card, folder / "sweep", reuse=True).table
    if set(table["outcome"]) != {"ok"}:
        raise SystemExit(f"tracker.py: a scene was not solved: {table['outcome'].value_counts().to_dict()}")
    signal = np.zeros((len(touch), sum(name.startswith("dv_") for name in table)))
    signal[touched] = table.sort_values("scene").filter(regex=r"^dv_\d+$").to_numpy()[which]
    return Stream(kind, press, touch, signal)


def followed(model: surrogate.SweepModel, stream: Stream, volts: Array) -> tuple[list[Tracked], Array]:
    """What a tracker says of frames (n, readings), and the CPU time of each, ms."""
    tracker, said, spent = surrogate.Tracker(model, rate_hz=RATE_HZ, say=lambda words: None), [], []
    for frame in volts:
        begun = time.process_time()
        said.append(tracker.update(frame))
        spent.append(1e3 * (time.process_time() - begun))
    return said, np.array(spent)


def delays(spent_ms: Array) -> Array:
    """(n,) time from each frame to its answer, ms, where frames come at RATE_HZ and are answered in turn."""
    out, free = np.empty(len(spent_ms)), 0.0
    for k, spent in enumerate(spent_ms):
        come = 1e3 * k / RATE_HZ
        free = max(free, come) + spent
        out[k] = free - come
    return out


def scored(name: str, stream: Stream, said: list[Tracked], spent: Array, rows: NDArray[np.bool_]) -> dict[str, object]:
    """Scores of some frames of a stream."""
    value, below, above = (np.array([getattr(one, name) for one in said]) * [1e3, 1e3, 1e3, 1.0]
                           for name in ("value", "below", "above"))
    touches = np.array([one.state in (TOUCH, SEVERAL_TOUCHES) for one in said])
    error = value - stream.touch
    read = rows & np.isfinite(error[:, 0])
    off = np.array([error[k, :2] @ np.linalg.solve(said[k].covariance[:2, :2] * 1e6, error[k, :2])
                    for k in np.flatnonzero(read)])
    held = (error[read] <= below[read]) & (-error[read] <= above[read])
    presses = [p for p in np.unique(stream.press[rows]) if p >= 0]
    found = [touches[np.flatnonzero((stream.press == p) & (stream.touch[:, 3] >= FOUND_N))[:2]].any() for p in presses]
    lifted = np.flatnonzero((stream.press[1:] < 0) & (stream.press[:-1] >= 0)) + 1
    rest = rows & (stream.press < 0)
    rest[np.concatenate([lifted, lifted + 1])] = False
    let_go = np.array([k for k in lifted if rows[k]])
    apart = np.hypot(*error[read, :2].T)
    strong = rows & (stream.touch[:, 3] >= FOUND_N)
    return {"stream": name, "frames": int(rows.sum()), "presses": len(presses),
            "read": float(np.mean(np.isfinite(error[strong, 0]))) if strong.any() else np.nan,
            "place_mm": float(np.median(apart)), "place_95_mm": float(np.quantile(apart, 0.95)),
            "d_rmse_mm": rms(error[read, 2]), "F_rmse_N": rms(error[read, 3]),
            "in_ellipse": float(np.mean(off <= -2 * np.log1p(-COVERAGE))), "x_in": float(held[:, 0].mean()),
            "d_in": float(held[:, 2].mean()), "F_in": float(held[:, 3].mean()), "found_2": float(np.mean(found)),
            "let_go_2": 1 - float(np.mean(touches[let_go + 1])),
            "false": 1e3 * float(np.mean(touches[rest])) if rest.any() else np.nan,
            "several": float(np.mean([said[k].state == SEVERAL_TOUCHES for k in np.flatnonzero(strong)])),
            "cpu_ms": float(spent[rows].mean()), "cpu_95_ms": float(np.quantile(spent[rows], 0.95)),
            "cpu_most_ms": float(spent[rows].max()), "p95_delay_ms": float(np.quantile(delays(spent)[rows], 0.95))}


def with_noise(model: surrogate.SweepModel, signal_V: Array, rng: np.random.Generator,
               level_dB: float = NOISE_DB) -> Array:
    """Frames (n, readings), V."""
    noise = np.sqrt(np.mean(model.baseline_V**2)) * 10 ** (-level_dB / 20)
    return model.baseline_V + signal_V + noise * rng.normal(size=signal_V.shape)


def drift(model: surrogate.SweepModel, frames: int, rng: np.random.Generator) -> Array:
    """(frames, readings) walk of the untouched frame, V."""
    size = DRIFT_V * np.sqrt(np.sum(model.baseline_V**2)) / np.sqrt(RATE_HZ)
    axes = np.linalg.qr(rng.normal(size=(len(model.baseline_V), DRIFTS)))[0]
    return np.cumsum(size * rng.normal(size=(frames, DRIFTS)), axis=0) @ axes.T


def pairs(stream: Stream, rng: np.random.Generator) -> Stream:
    """Held presses, each with the signal of another one's steady frame added."""
    steady = [np.flatnonzero(stream.press == p)[20] for p in np.unique(stream.press[stream.press >= 0])
              if stream.kind[np.flatnonzero(stream.press == p)[0]] in ("hold", "slide")]
    signal = stream.signal_V.copy()
    for p in np.unique(stream.press[stream.press >= 0]):
        rows = np.flatnonzero(stream.press == p)
        apart = [k for k in steady if np.hypot(*(stream.touch[k] - stream.touch[rows[0]])[:2]) > 30]
        if apart:
            signal[rows] += stream.signal_V[rng.choice(apart)]
    return replace(stream, signal_V=signal)


def main() -> None:
    if len(sys.argv) != 4:
        raise SystemExit("tracker.py: give a forward model, its card, and a folder for the simulated presses.")
    model, rng = surrogate.load(Path(sys.argv[1])), np.random.default_rng(0)
    stream = simulated(sys.argv[2], Path(sys.argv[3]), 1)
    n, every = len(stream.kind), np.ones(len(stream.kind), bool)
    rows = []
    said, spent = followed(model, stream, with_noise(model, stream.signal_V, rng))
    rows += [scored(kind, stream, said, spent, np.array([one == kind for one in stream.kind])) for kind in KINDS]
    rows.append(scored("all", stream, said, spent, every))
    for level in (100.0, 70.0):
        said, spent = followed(model, stream, with_noise(model, stream.signal_V, rng, level))
        rows.append(scored(f"{level:g} dB", stream, said, spent, every))
    said, spent = followed(model, stream, with_noise(model, stream.signal_V + drift(model, n, rng), rng))
    rows.append(scored("drift", stream, said, spent, every))
    lost = with_noise(model, stream.signal_V, rng)
    lost[np.flatnonzero(stream.press == 2)[5]:, 17] = np.nan
    said, spent = followed(model, stream, lost)
    rows.append(scored("dead channel", stream, said, spent, every))
    two = pairs(stream, rng)
    said, spent = followed(model, two, with_noise(model, two.signal_V, rng))
    rows.append(scored("pair", two, said, spent, every))
    shown(written(rows, "tracker"))


if __name__ == "__main__":
    main()
