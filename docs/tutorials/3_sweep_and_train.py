"""
Sweep and train
===============

Many simulated touches make a table; a model learns from it to read touches from voltages.
"""

# %%
# A design
# --------
# Two numbers are a range to draw from; everything else is a scene's own key. Where touches share a punch, its load path
# is solved once and serves all of them.

import tempfile

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal
import surrogate

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))
folder = tempfile.TemporaryDirectory()
data = eitsim.sweep("../../examples/design.toml", card, out=f"{folder.name}/sweep", scenes=120)
print(data.account.solved, "scenes;", len(data.ok), "of them ok;", data.ok.shape[1], "columns")

# %%
# Train
# -----
# ``forward`` learns the map from touch to signal and inverts it by its likelihood. Rows that it does not see are kept
# back for its scores.

model = surrogate.train(data, method="forward", seed=1)
evaluation = surrogate.evaluate(model, data, noise_dB=(80.0,))
for name, score in evaluation.scores["noise"][0]["outputs"].items():
    test = score["test"]
    print(f"{name:10s} root mean square error {test['rmse']:.3g} {test['unit']}, "
          f"90 % intervals hold {test['coverage_90']:.0%} of {test['n']} rows")

# %%
# Read new touches
# ----------------
# Touches that were not in the sweep, with noise 80 dB below the untouched readings.

rng = np.random.default_rng(0)
truth, frames, baseline = [], [], None
for x_mm, y_mm, force_N in ((20, 5, 0.5), (-30, 15, 1.0), (5, -40, 1.5), (-10, -25, 0.8)):
    punch = eitsim.Punch(x_m=x_mm / 1e3, y_m=y_mm / 1e3, diameter_m=0.014, force_N=force_N)
    readings = eitsim.simulate(eitsim.Scene(punches=[punch]), card).readings
    baseline = readings.baseline_V.ravel()
    truth.append((x_mm, y_mm, force_N))
    frames.append(readings.touched_V.ravel())
noise_V = np.sqrt(np.mean(baseline**2)) * 1e-4
found = model.predict(np.array(frames) + noise_V * rng.standard_normal(np.shape(frames)), baseline, noise_V=noise_V)
print(found[["x0_m", "y0_m", "d_m", "F_N", "F_lo90_N", "F_hi90_N", "flag"]].round(4).to_string())

# %%
# Where they were read
# --------------------

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
left.add_patch(plt.Circle((0, 0), 100, fill=False, color="0.5"))
left.plot(*np.array(truth)[:, :2].T, "o", mfc="none", ms=12, label="pressed")
left.plot(found["x0_m"] * 1e3, found["y0_m"] * 1e3, "+", ms=12, label="read")
left.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", xlim=(-105, 105), ylim=(-105, 105))
left.legend()
half = np.abs(found[["F_lo90_N", "F_hi90_N"]].to_numpy().T - found["F_N"].to_numpy())
right.errorbar([one[2] for one in truth], found["F_N"], half, fmt="o", capsize=3)
right.plot([0, 2], [0, 2], "0.6", zorder=0)
right.set(xlabel="pressed (N)", ylabel="read, with 90 % intervals (N)")
folder.cleanup()

# %%
# Designs and the commands: :doc:`/how-to/sweep`, :doc:`/how-to/train`, :doc:`/how-to/read-touches`.
