"""
Thin foam, thick foam
=====================

The same touch on layers of three thicknesses, bonded at the bottom.

On thicker foam the punch goes deeper, and the surface sinks in a wider ring around it.
"""

import matplotlib.pyplot as plt

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

figure, axis = plt.subplots(layout="constrained")
for thickness_mm in (5, 10, 20):
    scene = eitsim.Scene(body=eitsim.Body(thickness_m=thickness_mm / 1e3), punches=[eitsim.Punch(force_N=0.5)],
                         accuracy=eitsim.Accuracy(0.05))
    touch = eitsim.simulate(scene, card).touches[0]
    axis.plot(touch.radius_m * 1e3, touch.u_z_m * 1e3, label=f"{thickness_mm} mm: depth {touch.depth_m * 1e3:.2f} mm")
axis.set(xlim=(0, 30), xlabel="distance from the axis (mm)", ylabel="vertical displacement (mm)")
axis.legend(title="thickness")
