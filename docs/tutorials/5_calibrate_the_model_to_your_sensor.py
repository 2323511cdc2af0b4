"""
Calibrate the model to your sensor
==================================

A model of an ideal sensor explains a real one badly: channels have gains, electrodes leak to ground, contacts differ.
One untouched frame says how much of each there is.

The sensor here is **synthetic**: a simulated skin behind an instrument whose errors are drawn by chance. The fit is
given its untouched frames alone.
"""

# %%
# A sensor that is not ideal
# --------------------------
# With the sink of a pattern at ground, the body takes currents I to the voltages G I of its electrodes. Leaks L to
# ground and gains g of the channels make of them ``g (1 + G L)^-1 G I``. The impedances G of the body, untouched and
# touched, are simulated; the contacts are the skin's own.

import json
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
rng, count = np.random.default_rng(5), 16
contacts_Ohm_m = np.exp(0.7 * rng.standard_normal(count))
gains = 1 + 0.03 * rng.standard_normal(count)
leaks_S = 30e-6 * np.abs(rng.standard_normal(count))

unit = np.eye(count)
to_ground = eitsim.Drive(1e-3, currents=unit[1:] - unit[0], measurements=unit[1:] - unit[0])
punch = eitsim.Punch(x_m=0.03, y_m=0.02, diameter_m=0.014, force_N=1.0)
body = eitsim.simulate(eitsim.Scene(punches=[punch], drive=to_ground, electrodes=eitsim.Electrodes(
    contact_impedance_Ohm_m=contacts_Ohm_m)), card).readings
untouched_Ohm, touched_Ohm = (np.pad(volts / 1e-3, ((1, 0), (1, 0))) for volts in (body.baseline_V, body.touched_V))


def read(impedance_Ohm: np.ndarray) -> np.ndarray:
    """Readings, V, of opposite drives and of neighbours that carry no current, through the instrument."""
    frame = []
    for source in range(count):
        sink = (source + count // 2) % count
        grounded = (impedance_Ohm - impedance_Ohm[sink] - impedance_Ohm[:, [sink]] + impedance_Ohm[sink, sink])
        volts = gains * np.linalg.solve(unit + grounded * leaks_S, grounded[:, source] * 5e-3)
        first = [(source + step) % count for step in range(1, count - 1) if step not in (count // 2 - 1, count // 2)]
        frame += [volts[(k + 1) % count] - volts[k] for k in first]
    return np.array(frame)


# %%
# Frames go into a recording: twenty untouched ones, then ten of one touch.

temporary = tempfile.TemporaryDirectory()
folder = Path(temporary.name)
names = [""] * 20 + ["press"] * 10
clean = np.array([read(touched_Ohm if name else untouched_Ohm) for name in names])
noise_V = 1e-4 * np.sqrt(np.mean(clean**2))
frames = pd.DataFrame(clean + noise_V * rng.standard_normal(clean.shape),
                      columns=[f"v_{k:03d}" for k in range(clean.shape[1])])
frames.insert(0, "touch", names)
frames.to_csv(folder / "frames.csv", index=False)
(folder / "sensor.toml").write_text('[drive]\npattern = "opposite"\nreading = "differential"\n')

# %%
# Fit
# ---
# The sensor file says what the sensor was built to be. Groups of parameters are freed one after the other, and a group
# that predicts drives worse which were not fitted is left out.


def run(*command: object) -> str:
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True,
                          cwd=folder, env={**os.environ, "COLUMNS": "76"}).stdout


print(run("eitsim", "sensor", "fit", "frames.csv", "--sensor", "sensor.toml", "--out", "sensor.json"))

# %%
# What stays unexplained
# ----------------------
# ``predict`` writes the untouched readings of the calibrated sensor. The first group, one conductance, is the ideal
# sensor, and each later one adds to it; the share is of drives that were not fitted.

run("eitsim", "sensor", "predict", "sensor.json", "--out", "untouched.csv")
found = json.loads((folder / "sensor.json").read_text())
seen = frames[frames["touch"] == ""].filter(like="v_").to_numpy().mean(axis=0)
scene = eitsim.Scene(punches=[punch], drive=eitsim.Drive(pattern="opposite", reading="differential"))
ideal = eitsim.simulate(scene, card).readings
ideal_V = ideal.baseline_V.ravel()
calibrated_V = pd.read_csv(folder / "untouched.csv").filter(like="v_").to_numpy()[0]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for name, model_V in (("ideal sensor", ideal_V * (seen @ ideal_V) / (ideal_V @ ideal_V)), ("calibrated", calibrated_V)):
    left.plot((seen - model_V) * 1e3, lw=0.8, label=name)
left.set(xlabel="reading", ylabel="reading less the model (mV)")
left.legend()
shares = {name: 100 * one["held_out"] for name, one in found["unexplained"].items()}
right.semilogy(list(shares), list(shares.values()), "o-")
right.set(ylabel="unexplained (%)")
right.tick_params(axis="x", rotation=60)

# %%
# Was it right?
# -------------
# Here the truth is known. Readings determine gains but for a common factor, so that their mean is 1. Contacts are the
# least sure: no reading is taken on a driven electrode.

figure, axes = plt.subplots(1, 3, figsize=(9, 3.2), layout="constrained")
for axis, (name, true) in zip(axes, (("gain", gains / gains.mean()), ("leak_uS", leaks_S * 1e6),
                                     ("ln_contact_impedance", np.log(contacts_Ohm_m))), strict=True):
    fitted = [one for key, one in found["parameters"].items() if key.startswith(name)]
    axis.errorbar(true, [one["value"] for one in fitted], [1.96 * one["sd"] for one in fitted], fmt=".", lw=0.8)
    axis.plot(axis.get_xlim(), axis.get_xlim(), "0.6", zorder=0)
    axis.set(title=name, xlabel="true")
axes[0].set_ylabel("fitted, with 95 % intervals")

# %%
# Correct the frames
# ------------------
# ``correct`` makes of each frame what the ideal sensor would read, so that models of that one serve. Signals, touched
# less untouched, are compared with those that the simulator gives for the ideal sensor.

print(run("eitsim", "sensor", "correct", "frames.csv", "--sensor", "sensor.json", "--out", "corrected.csv"))


def rest_and_press(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """The mean untouched frame and the mean frame of the press, V."""
    rest, press = (table[table["touch"] == name].filter(like="v_").to_numpy().mean(axis=0) for name in ("", "press"))
    return rest, press


recordings = {"as read": frames, "corrected": pd.read_csv(folder / "corrected.csv", keep_default_na=False)}
means = {name: rest_and_press(table) for name, table in recordings.items()}
true_mV = ideal.signal_V.ravel() * 1e3
figure, axis = plt.subplots(layout="constrained")
for name, (rest_V, press_V) in means.items():
    off_mV = (press_V - rest_V) * 1e3 - true_mV
    axis.plot(true_mV, off_mV, ".", ms=4, label=name)
    print(f"{name}: {np.linalg.norm(off_mV) / np.linalg.norm(true_mV):.1%} of the ideal sensor's signal is off")
axis.set(xlabel="signal of the ideal sensor (mV)", ylabel="signal less that of the ideal sensor (mV)")
axis.legend()

# %%
# No uniform skin explains the untouched frame of the uncalibrated readings, so that their image is of normalised
# differences, in which gains cancel and sizes are qualitative. Corrected frames give an image of volts.

for name, (rest_V, press_V) in means.items():
    image = eitsim.reconstruct(press_V, rest_V, scene=scene)
    print(f"{name}: image of {image.differences}", *image.cautions, sep="\n  ")
figure, axis = plt.subplots(layout="constrained")
most = np.abs(image.change).max()
drawn = axis.tripcolor(*(image.pixels.nodes_m * 1e3).T, image.pixels.triangles, image.change[0], cmap="RdBu",
                        vmin=-most, vmax=most)
axis.add_patch(plt.Circle((punch.x_m * 1e3, punch.y_m * 1e3), punch.diameter_m * 500, fill=False))
axis.set(title="image of the corrected frames", aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
figure.colorbar(drawn, label="relative change of conductance")
temporary.cleanup()

# %%
# What is fitted, when it is refused, and what it gave on real sensors: :doc:`/how-to/calibrate-a-sensor`.
