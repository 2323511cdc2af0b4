"""
Does the contact impedance matter?
==================================

From a perfect contact to 10 Ohm m, readings and signal change by less than 2 %: what is read here is between
electrodes that carry no current.
"""

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

impedances = np.geomspace(1e-3, 10, 5)
baseline_V, signal_V = [], []
for impedance in impedances:
    scene = eitsim.Scene(punches=[eitsim.Punch(x_m=0.03, force_N=0.5)], accuracy=eitsim.Accuracy(0.05),
                         electrodes=eitsim.Electrodes(contact_impedance_Ohm_m=float(impedance)))
    readings = eitsim.simulate(scene, card).readings
    baseline_V.append(np.sqrt(np.mean(readings.baseline_V**2)))
    signal_V.append(np.sqrt(np.mean(readings.signal_V**2)))
figure, axis = plt.subplots(layout="constrained")
axis.semilogx(impedances, np.array(baseline_V) / baseline_V[0], "o-", label="untouched readings")
axis.semilogx(impedances, np.array(signal_V) / signal_V[0], "s--", label="signal of a touch")
axis.set(xlabel="contact impedance (Ohm m)", ylabel="r.m.s. over that at 1e-3 Ohm m")
axis.legend()
