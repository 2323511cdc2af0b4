"""
Read a touch live
=================

A tracker reads frames one by one: whether something touches, where, how hard, and how surely.

The frames here are **synthetic**: a punch that moves over a simulated skin, with noise.
"""

# %%
# A model
# -------
# A forward model of touches by two punches, learnt from a small sweep.

import subprocess
import tempfile
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.patches import Ellipse

import eitsim
import matcal
import surrogate

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))
temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name)
(folder / "design.toml").write_text("""
scenes = 200
seed = 1
[punch]
place = { within_mm = 45 }
diameter_mm = { choice = [12, 16] }
force_N = [0.1, 2.0]
""")
data = eitsim.sweep(folder / "design.toml", card, out=folder / "sweep")
model = surrogate.train(data, method="forward", seed=1)

# %%
# A touch that moves
# ------------------
# The 12 mm punch comes down, goes along an arc at some 50 mm/s and is lifted: frames at 50 a second, the simulator's
# own at each place and force, none of which trained the model.

rate_Hz, moving = 50.0, 60
angle = np.linspace(-0.6, 2.4, moving)
force_N = 1.2 * np.minimum(1, np.minimum(np.arange(1, moving + 1), np.arange(moving, 0, -1)) / 10)
pressed = pd.DataFrame({"x_mm": 30 * np.cos(angle) - 5, "y_mm": 30 * np.sin(angle) - 10, "d_mm": 12.0, "F_N": force_N})
pressed.to_csv(folder / "path.csv", index=False)
path = eitsim.sweep(folder / "path.csv", card, out=folder / "path").table.sort_values("scene")
touched_V = path.filter(regex=r"^v_\d+$").to_numpy()

rng = np.random.default_rng(0)
rest = np.tile(model.baseline_V, (30, 1))
stream_V = np.concatenate([rest, touched_V, rest])
noise_V = 1e-4 * np.sqrt(np.mean(model.baseline_V**2))
stream_V = stream_V + noise_V * rng.standard_normal(stream_V.shape)
