"""
Simulate a touch
================

A punch is pressed into a foam disc with a conductive skin: how deep, and what do 16 electrodes read?
"""

# %%
# A material
# ----------
# Any card serves. This one is typed by hand: a foam of 9.5 kPa shear modulus, and a coating whose conductivity falls
# with strain.

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

foam = matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm")
skin = matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4))
card = matcal.MaterialCard("foam by hand", foam, conductivity=skin)

# %%
# Ask what will be left out
# -------------------------
# The plan is made before anything is solved. Each line is a decision and the relative error of the signal that it may
# cost; where no bound is known, the plan says so, and the error estimate below does not hold it.

scene = eitsim.Scene(punches=[eitsim.Punch(x_m=0.03, y_m=0.02, diameter_m=0.014, force_N=1.0)])
for line in eitsim.plan(scene, card).decisions:
    print(f"{line.decision}: {'not bounded' if line.unbounded else f'{line.error_bound:.2g}'}")

# %%
# Solve
# -----

found = eitsim.simulate(scene, card)
touch = found.touches[0]
print(f"depth {touch.depth_m * 1e3:.3f} mm, contact area {touch.contact_area_m2 * 1e6:.1f} mm2, "
      f"largest pressure {touch.sigma_max_Pa / 1e3:.1f} kPa")
print({name: f"{error:.1e}" for name, error in found.error_estimate.items()})

# %%
# The surface under the punch
# ---------------------------

radius_mm = touch.radius_m * 1e3
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
left.plot(radius_mm, touch.u_z_m * 1e3)
left.set(xlim=(0, 30), xlabel="distance from the punch's axis (mm)", ylabel="vertical displacement (mm)")
right.plot(radius_mm, np.maximum(touch.stretch_meridian, touch.stretch_hoop) - 1)
right.set(xlim=(0, 30), xlabel="distance from the punch's axis (mm)", ylabel="largest strain in plane")

# %%
# The readings
# ------------
# Current goes through neighbouring electrodes, pattern after pattern; the signal is touched less untouched.

signal_mV = found.readings.signal_V * 1e3
figure, axis = plt.subplots(figsize=(9, 3), layout="constrained")
axis.bar(np.arange(signal_mV.size), signal_mV.ravel())
axis.set(xlabel="reading", ylabel="signal dV (mV)")

# %%
# Files of scenes, the commands, friction, holds and several touches: :doc:`/how-to/simulate-touches`.
