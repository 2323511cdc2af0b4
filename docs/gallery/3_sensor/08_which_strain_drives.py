"""
Which strain drives the skin?
=============================

The paper does not say which strain changes the conductivity. The signal of one touch under each of three choices.

The first two are stretch in the plane, under which the skin conducts less. The last is compression through the
thickness, under which it conducts more: the signal has the other sign.
"""

import matplotlib.pyplot as plt

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

figure, axes = plt.subplots(3, 1, figsize=(9, 6), sharex=True, layout="constrained")
for axis, strain in zip(axes, ("principal", "areal", "normal"), strict=True):
    scene = eitsim.Scene(punches=[eitsim.Punch(x_m=0.03, force_N=1.0)], skin=eitsim.Skin(strain=strain),
                         accuracy=eitsim.Accuracy(0.05))
    axis.bar(range(208), eitsim.simulate(scene, card).readings.signal_V.ravel() * 1e3)
    axis.set(title=strain, ylabel="dV (mV)")
axes[-1].set_xlabel("reading")
