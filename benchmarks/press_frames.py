"""How much several frames of a press say of which places are pressed, when these share a part of their noise.

Usage: python benchmarks/press_frames.py. Writes results/press_frames.csv, means over SEEDS pairs of synthetic
recordings of 150 presses of FRAMES frames against one untouched frame: the first recording's presses of one or two
places teach, all of the second are tested. `shared` is the part of the variance of the noise that is the same in all
frames of a press, as drift and hysteresis are; `read` is "means", frames of a press having one name, or "frames", each
frame being a press of its own.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import quick, shown, written

import surrogate
from eitsim.sensors.recording import Recording
from eitsim.sensors.touch_sets import TouchSets
from touchcal.arrays import Array

SEEDS, SHARED, FRAMES, PRESSES, READINGS = quick(6, 1), (0.0, 0.5, 0.9, 1.0), 4, 150, 24
NOISE, DRIFT = 1.6, 0.05  # standard deviation a frame, and of a step of the random walk, over that of patterns


def made(seed: int, shared: float) -> tuple[Recording, TouchSets]:
    """A recording of random sets of four places, whose patterns are the same for all seeds, and the sets."""
    fixed, rng = np.random.default_rng(7), np.random.default_rng(seed)
    pattern, common = fixed.standard_normal((4, READINGS)), fixed.standard_normal((2, READINGS))
    down = rng.random((PRESSES, 4)) < 0.5
    down[~down.any(axis=1), 0] = True

    def noise(count: int) -> Array:
        return NOISE * (rng.standard_normal((count, READINGS)) + rng.standard_normal((count, 2)) @ common)

    press = np.repeat(np.arange(PRESSES), FRAMES + 1)
    touched = np.arange(len(press)) % (FRAMES + 1) > 0
    frames = np.cumsum(DRIFT * rng.standard_normal((len(press), READINGS)), axis=0)
    one = np.where(touched, press, PRESSES + press)  # untouched frames share nothing with those of the press
    frames += np.sqrt(1 - shared) * noise(len(press)) + np.sqrt(shared) * noise(2 * PRESSES)[one]
    frames[touched] += (down @ pattern)[press[touched]]
    touch = np.where(touched, press.astype(np.str_), "")
    return (Recording(frames, np.arange(len(press)), None, touch, "voltage", Path("made")),
            TouchSets(np.arange(PRESSES).astype(np.str_), ("A", "B", "C", "D"), down))


def by_frame(recording: Recording, sets: TouchSets) -> tuple[Recording, TouchSets]:
    """The same with a name for each frame."""
    pressed = recording.touch != ""
    name = np.where(pressed, np.arange(len(pressed)).astype(np.str_), "")
    return replace(recording, touch=name), replace(sets, touch=name[pressed], down=np.repeat(sets.down, FRAMES, axis=0))


def few(sets: TouchSets) -> TouchSets:
    """Those of one place or two."""
    rows = sets.down.sum(axis=1) <= 2
    return replace(sets, touch=sets.touch[rows], down=sets.down[rows])


def main() -> None:
    rows = []
    for shared in SHARED:
        for read, way in (("frames", by_frame), ("means", lambda *both: both)):
            scores = []
            for seed in range(SEEDS):
                recording, sets = way(*made(seed, shared))
                scores.append(surrogate.learn_sets(recording, few(sets)).score(*way(*made(seed + 50, shared))))
            rows.append({"shared": shared, "read": read, "recordings": SEEDS} | {
                name: np.mean([getattr(one, name) for one in scores])
                for name in ("all_right", "count_right", "count_probability")})
    table = pd.DataFrame(rows)
    shown(table)
    written(table, "press_frames")


if __name__ == "__main__":
    main()
