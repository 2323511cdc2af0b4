"""
Read a touch live
=================

A tracker reads frames one by one: whether something touches, where, how hard, and how surely.

The frames here are **synthetic**: a punch that moves over a simulated skin, with noise.
"""

# %%
# A model
# -------
# A forward model of touches by two punches of 12 and 16 mm, learnt from a small sweep; with ``known_punches`` it knows
# no others.

import subprocess
import tempfile
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
scenes = 84
seed = 1
[punch]
place = { within_mm = 45 }
diameter_mm = { choice = [12, 16] }
force_N = [0.05, 0.7]
[accuracy]
signal = 0.05
""")
data = eitsim.sweep(folder / "design.toml", card, out=folder / "sweep")
model = surrogate.train(data, method="forward", seed=1, known_punches=True)

# %%
# A touch that moves
# ------------------
# The 12 mm punch comes down, goes along an arc at some 90 mm/s and is lifted: 50 frames a second, the simulator's own
# at each place and force, none of which trained the model. Noise is 80 dB below the untouched readings.

rate_Hz, moving = 50.0, 40
angle = np.linspace(-0.6, 1.8, moving)
force_N = 0.6 * np.minimum(1, np.minimum(np.arange(1, moving + 1), np.arange(moving, 0, -1)) / 10)
true = pd.DataFrame({"x_mm": 30 * np.cos(angle) - 5, "y_mm": 30 * np.sin(angle) - 10, "d_mm": 12.0, "F_N": force_N,
                     "accuracy.signal": 0.05})
true.to_csv(folder / "path.csv", index=False)
path = eitsim.sweep(folder / "path.csv", card, out=folder / "path").ok.sort_values("scene")
touched_V = path.filter(regex=r"^v_\d+$").to_numpy()

rng = np.random.default_rng(0)
rest_V = np.tile(model.baseline_V, (30, 1))
stream_V = np.concatenate([rest_V, touched_V, rest_V])
noise_V = 1e-4 * np.sqrt(np.mean(model.baseline_V**2))
stream_V += noise_V * rng.standard_normal(stream_V.shape)

# %%
# Follow it
# ---------
# A tracker is given the frames in turn. The first twenty tell it the untouched frame and the noise: touch nothing then.

tracker = surrogate.Tracker(model, rate_hz=rate_Hz)
answers = [tracker.update(frame_V) for frame_V in stream_V]
states = pd.Series([one.state for one in answers])
print(states.groupby((states != states.shift()).cumsum()).agg(["first", "size"]).to_string(index=False, header=False))

# %%
# Where it was read
# -----------------
# Ellipses hold the place at 90 %. They are wide where the touch is light. The diameter is read too: after a few frames
# the tracker knows which of the two punches it is, and the force with it.

frame = np.array([k for k, one in enumerate(answers) if one.state == "touch" and 30 <= k < 30 + moving])
read = np.array([answers[k].value for k in frame])
force = np.array([[answers[k].below[3], answers[k].above[3]] for k in frame])
pressed = true.iloc[frame - 30]
ellipses = np.array([answers[k].ellipse for k in frame])
off_mm = read[:, :2] * 1e3 - pressed[["x_mm", "y_mm"]].to_numpy()
time_s = frame / rate_Hz
figure, (left, middle, right) = plt.subplots(1, 3, figsize=(11, 3.8), layout="constrained")
left.plot(true["x_mm"], true["y_mm"], "0.6", lw=4, label="pressed")
left.plot(read[:, 0] * 1e3, read[:, 1] * 1e3, ".-", ms=4, lw=0.8, label="read")
for place_m, (major_m, minor_m, angle_rad) in zip(read[:, :2], ellipses, strict=True):
    left.add_patch(Ellipse(place_m * 1e3, 2e3 * major_m, 2e3 * minor_m, angle=np.degrees(angle_rad), fill=False,
                           color="tab:orange", lw=0.8))
left.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", xlim=(-35, 35), ylim=(-35, 35))
left.legend(loc="lower left")
middle.semilogy(time_s, np.hypot(*off_mm.T), label="read less pressed")
middle.semilogy(time_s, ellipses[:, 0] * 1e3, color="tab:orange", label="longer half axis")
middle.set(xlabel="time (s)", ylabel="distance (mm)")
middle.legend()
right.plot(time_s, pressed["F_N"], "0.6", lw=4, label="pressed")
right.plot(time_s, read[:, 3], label="read")
right.fill_between(time_s, read[:, 3] - force[:, 0], read[:, 3] + force[:, 1], alpha=0.3, label="90 %")
right.set(xlabel="time (s)", ylabel="force (N)")
right.legend()

reach = [off @ np.linalg.solve(answers[k].covariance[:2, :2] * 1e6, off) for k, off in zip(frame, off_mm, strict=True)]
print(f"place off by {np.median(np.hypot(*off_mm.T)):.2f} mm in the median; "
      f"{np.mean(np.array(reach) <= -2 * np.log(0.1)):.0%} of the {len(frame)} places lie in their ellipses")

# %%
# Frames of one press share their errors, so that this share is of few independent trials. Thirty presses are counted in
# :doc:`/how-to/live`.

# %%
# In a browser
# ------------
# The same tracker stands behind a page on which one presses the skin::
#
#     surrogate live MODEL                             # the model's own map answers the presses
#     surrogate live MODEL --simulate card.json        # the simulator does
#     surrogate live MODEL serial:/dev/ttyACM0         # frames of a device, a line a frame
#
# ``--export`` writes a page that needs no server: the learned map is in it, and it opens from disk. The one below is
# the skin on the first page of this documentation.

model.save(folder / "model")
done = subprocess.run(["surrogate", "live", folder / "model", "--export", "press.html"], capture_output=True, text=True,
                      check=True)
print(done.stdout)
temporary.cleanup()
