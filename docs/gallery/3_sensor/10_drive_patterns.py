"""
Adjacent or opposite currents
=============================

The same touch, driven through neighbours and through opposite electrodes.

A row is a pattern of currents, a column one of its readings. Opposite currents give about twice the largest signal
(note the two scales).
"""

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for axis, pattern in zip(axes, ("adjacent", "opposite"), strict=True):
    scene = eitsim.Scene(punches=[eitsim.Punch(x_m=0.03, y_m=0.02, force_N=1.0)], drive=eitsim.Drive(pattern=pattern),
                         accuracy=eitsim.Accuracy(0.05))
    signal_mV = eitsim.simulate(scene, card).readings.signal_V * 1e3
    most = np.nanmax(np.abs(signal_mV))
    image = axis.imshow(signal_mV, cmap="RdBu", vmin=-most, vmax=most, aspect="auto")
    axis.set(title=pattern, xlabel="reading", ylabel="pattern")
    figure.colorbar(image, label="dV (mV)")
