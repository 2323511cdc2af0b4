"""
Read your own sensor
====================

No simulation is needed where presses were recorded: a recording and its labels are enough.

The recording here is **synthetic**: 150 presses on a simulated skin, each reading with a gain of its own that nobody
knows, an untouched frame before each press, and noise.
"""

# %%
# A recording
# -----------
# A recording is a CSV of frames in time order: a column ``touch`` (empty: untouched), then one column a reading. Labels
# are a CSV of ``touch, x_mm, y_mm``.

import os
import subprocess
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))
temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name)
data = eitsim.sweep("../../examples/design.toml", card, out=folder / "sweep", scenes=150)
table = data.ok
readings = [name for name in table.columns if name.startswith("v_")]
rng = np.random.default_rng(3)
baseline = eitsim.simulate(eitsim.Scene(), card).readings.baseline_V.ravel()
gain = 1 + 0.03 * rng.standard_normal(len(readings))
frames = []
for number, touched in enumerate(table[readings].to_numpy()):
    drift = 1 + 1e-3 * np.sin(number / 30)
    for name, volts in (("", baseline), (f"p{number}", touched)):
        noise = 2e-5 * np.abs(baseline).mean() * rng.standard_normal(len(readings))
        frames.append([name, *(volts * gain * drift + noise)])
pd.DataFrame(frames, columns=["touch", *(f"v_{k:03d}" for k in range(len(readings)))]).to_csv(folder / "frames.csv",
                                                                                          index=False)
labels = table[["x_mm", "y_mm"]].reset_index(drop=True)
labels.insert(0, "touch", [f"p{k}" for k in range(len(table))])
labels.to_csv(folder / "touches.csv", index=False)
(folder / "sensor.toml").write_text('[readings]\nkind = "voltage"\n')

# %%
# What do the readings say of themselves?
# ---------------------------------------
# Before anything is learnt, ``eitsim sensor inspect`` names order, sign, faults, noise and drift, or asks.


def run(*command: object) -> None:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True, cwd=folder,
                          env={**os.environ, "COLUMNS": "76"})
    print(done.stdout)


run("eitsim", "sensor", "inspect", "frames.csv")

# %%
# Train
# -----
# Scores are those of readers that did not see the tested presses: some at random, and the last in time.

run("surrogate", "learn", "frames.csv", "--labels", "touches.csv", "--sensor", "sensor.toml", "--out", "reader")

# %%
# Read
# ----

run("surrogate", "predict", "reader", "frames.csv", "--out", "predictions.csv")
found = pd.read_csv(folder / "predictions.csv")
figure, axis = plt.subplots(figsize=(5, 5), layout="constrained")
axis.plot(labels["x_mm"], labels["y_mm"], "o", mfc="none", ms=8, label="pressed")
axis.errorbar(found["x0_mm"], found["y0_mm"], (found["y0_hi90_mm"] - found["y0_mm"]),
              (found["x0_hi90_mm"] - found["x0_mm"]), fmt=".", lw=0.8, label="read, with 90 % intervals")
axis.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", title="presses that the reader was trained on")
figure.legend(loc="outside lower center", ncols=2)
temporary.cleanup()

# %%
# These presses trained the reader, so that the picture flatters it: the errors to expect are those of the table above.
# Files of boards and their order: :doc:`/how-to/recordings`. What a reader is made of:
# :doc:`/how-to/learn-from-presses`.
