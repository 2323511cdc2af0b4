"""
Depth against force
===================

Three punches on the same foam.

A narrower punch goes deeper at the same force. Its curve flattens where little of the 10 mm of foam is left under it.
"""

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

forces_N = np.array([0.1, 0.3, 0.6, 1.0, 1.5, 2.0])
figure, axis = plt.subplots(layout="constrained")
for diameter_mm in (10, 14, 18):
    depth_mm = []
    for force_N in forces_N:
        punch = eitsim.Punch(diameter_m=diameter_mm / 1e3, force_N=force_N)
        scene = eitsim.Scene(punches=[punch], accuracy=eitsim.Accuracy(0.05))
        depth_mm.append(eitsim.simulate(scene, card).touches[0].depth_m * 1e3)
    axis.plot(forces_N, depth_mm, "o-", label=f"{diameter_mm} mm")
axis.set(xlabel="force (N)", ylabel="depth (mm)")
axis.legend(title="punch")
