"""
Where on the disc is the signal large?
======================================

The same touch from the centre outwards: electrodes near it feel more.

The largest reading grows faster than the mean: one pair of electrodes is then much nearer than all others.
"""

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

places_mm = np.array([0, 10, 20, 30, 40, 50])
largest, rms = [], []
for place_mm in places_mm:
    scene = eitsim.Scene(punches=[eitsim.Punch(x_m=place_mm / 1e3, force_N=0.5)], accuracy=eitsim.Accuracy(0.05))
    signal_V = eitsim.simulate(scene, card).readings.signal_V
    largest.append(np.abs(signal_V).max() * 1e3)
    rms.append(np.sqrt(np.mean(signal_V**2)) * 1e3)
figure, axis = plt.subplots(layout="constrained")
axis.semilogy(places_mm, largest, "o-", label="largest reading")
axis.semilogy(places_mm, rms, "s--", label="r.m.s. of all")
axis.set(xlabel="distance from the disc's centre (mm)", ylabel="signal (mV)")
axis.legend()
