"""
Pressure under four profiles
============================

A flat punch, a sphere, a cone and an ellipse, 14 mm wide, at 0.5 N.

The flat punch presses most under its rounded edge, the cone under its tip. The sphere goes deeper than the flat punch
at the same force.
"""

import matplotlib.pyplot as plt

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

figure, axis = plt.subplots(layout="constrained")
for profile in ("flat", "sphere", "cone", "ellipse"):
    punch = eitsim.Punch(force_N=0.5, profile=profile)
    touch = eitsim.simulate(eitsim.Scene(punches=[punch], accuracy=eitsim.Accuracy(0.05)), card).touches[0]
    axis.plot(touch.radius_m * 1e3, touch.pressure_Pa / 1e3, label=f"{profile}: depth {touch.depth_m * 1e3:.2f} mm")
axis.set(xlim=(0, 9), xlabel="distance from the axis (mm)", ylabel="contact pressure (kPa)")
axis.legend()
