"""
Drift of a real hydrogel
========================

How fast does an untouched frame grow old?

The recording is **real** (Hardman et al., HydrogelEIT: 350 presses, an untouched frame just before each) and may not be
shipped with this project. It is read where it lies next to the checkout, in ``../shared/real/hydrogel``; where it does
not, this page says so and shows no picture.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import eitsim

file = Path("../../../../shared/real/hydrogel/frames.csv")
if file.exists():
    recording = eitsim.read_recording(file, kind="magnitude")
    untouched = recording.touch == ""
    after = np.flatnonzero(untouched[:-1] & ~untouched[1:])
    rest, press = recording.readings[after], recording.readings[after + 1]
    signal = np.linalg.norm(press - rest, axis=1)
    ages = np.unique(np.geomspace(1, len(rest) // 2, 20).astype(int))
    changes = [np.quantile(np.linalg.norm(rest[age:] - rest[:-age], axis=1) / signal[age:], (0.25, 0.5, 0.75))
               for age in ages]

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    left.plot(100 * np.linalg.norm(rest - rest[0], axis=1) / np.linalg.norm(rest[0]))
    left.set(xlabel="press", ylabel="untouched frame less the first one (%)")
    low, middle, high = np.transpose(changes)
    right.loglog(ages, middle, "o-")
    right.fill_between(ages, low, high, alpha=0.3)
    right.axhline(1, color="0.6", lw=0.8)
    right.set(xlabel="age of the untouched frame (presses)", ylabel="its drift over the signal of a press")
else:
    print("The recording is absent: nothing is shown.")
