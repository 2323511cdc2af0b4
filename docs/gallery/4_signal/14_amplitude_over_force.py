"""
How the signal grows with force
===============================

The r.m.s. signal of three punches at one place.

The signal grows with the force. A narrower punch, which goes deeper, gives a larger one.
"""

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

forces_N = np.linspace(0.1, 2.0, 8)
figure, axis = plt.subplots(layout="constrained")
for diameter_mm, mark in ((10, "o-"), (14, "s-"), (18, "^-")):
    signal_mV = []
    for force_N in forces_N:
        punch = eitsim.Punch(x_m=0.02, diameter_m=diameter_mm / 1e3, force_N=float(force_N))
        scene = eitsim.Scene(punches=[punch], accuracy=eitsim.Accuracy(0.05))
        signal_mV.append(np.sqrt(np.mean(eitsim.simulate(scene, card).readings.signal_V**2)) * 1e3)
    axis.plot(forces_N, signal_mV, mark, label=f"{diameter_mm} mm")
axis.set(xlabel="force (N)", ylabel="r.m.s. signal (mV)")
axis.legend(title="punch")
