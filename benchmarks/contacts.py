"""Is a press found at once? Hundreds of simulated presses through a tracker, and the least rate that they show.

Run as `python benchmarks/contacts.py MODEL_DIR CARD SWEEP_DIR`; writes results/contacts.csv next to this file, and the
simulated touches into SWEEP_DIR, where a later run finds them. Presses are those of `tracker.py`, held short: punches
of the trained diameters within 25 mm, whose force grows from 0.02 N to 0.4 to 1.8 N in 4 to 14 frames at 50 a second.
Every frame is the simulator's own, a sweep of a table of scenes; noise is white and drift as in `tracker.py`.

found_2: part of the presses before which no contact is said and that are found within two frames from the first of
0.1 N; found_2_least: what that part is at least, at 95 % confidence (Clopper and Pearson, one-sided); false: contacts
in other untouched frames, a thousand.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import tracker
from conditions import quick, shown, written
from numpy.typing import NDArray
from scipy.stats import beta

import surrogate
from surrogate.model.tracking.tracked import SEVERAL_TOUCHES, TOUCH

PRESSES, REST, HELD = quick(300, 12), 15, 5
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


def scored(name: str, model: surrogate.Model, stream: tracker.Stream, volts: NDArray[np.float64]
           ) -> dict[str, object]:
    """How many presses of a stream are found."""
    said, spent = tracker.followed(model, stream, volts)
    touches = np.array([one.state in (TOUCH, SEVERAL_TOUCHES) for one in said])
    strong = stream.touch[:, 3] >= tracker.FOUND_N
    first = [int(np.argmax(stream.press == p)) for p in range(int(stream.press.max()) + 1)]
    each = [not touches[begun - 1] and touches[np.flatnonzero((stream.press == p) & strong)[:2]].any()
            for p, begun in enumerate(first)]
    found, rest = int(np.sum(each)), stream.press < 0
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
    walk = tracker.drift(model, len(stream.press), rng)
    rows.append(scored("drift", model, stream, tracker.with_noise(model, stream.signal_V + walk, rng)))
    shown(written(rows, "contacts"))


if __name__ == "__main__":
    main()
