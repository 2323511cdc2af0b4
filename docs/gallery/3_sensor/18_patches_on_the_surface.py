"""
Electrodes at the rim or on the surface
=======================================

Line contacts of the rim, and patches that lie on the skin.

The two curves cover each other: the kind of contact hardly changes the signal of a touch inside.
"""

import matplotlib.pyplot as plt

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

figure, axis = plt.subplots(figsize=(9, 3.4), layout="constrained")
for kind in ("line", "patch"):
    scene = eitsim.Scene(punches=[eitsim.Punch(x_m=0.03, force_N=0.5)], electrodes=eitsim.Electrodes(kind=kind),
                         accuracy=eitsim.Accuracy(0.05))
    axis.plot(eitsim.simulate(scene, card).readings.signal_V.ravel() * 1e3, lw=1, label=kind)
axis.set(xlabel="reading", ylabel="signal dV (mV)")
axis.legend(title="kind")
