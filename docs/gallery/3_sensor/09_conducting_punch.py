"""
A punch that conducts
=====================

Current takes the short cut through a metal punch: the signal changes with its contact impedance.

The insulated punch changes the readings by the strain alone. The better a metal punch's contact, the more of that is
made up for, and at 1e-5 Ohm m2 most readings change the other way.
"""

from dataclasses import replace

import matplotlib.pyplot as plt

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

figure, axis = plt.subplots(figsize=(9, 3.4), layout="constrained")
insulated = eitsim.Punch(x_m=0.03, force_N=1.0)
metal = {f"{impedance:g} Ohm m2": replace(insulated, conductor=True, contact_impedance_Ohm_m2=impedance)
         for impedance in (1e-3, 1e-5)}
for label, punch in {"insulated": insulated, **metal}.items():
    scene = eitsim.Scene(punches=[punch], accuracy=eitsim.Accuracy(0.05))
    axis.plot(eitsim.simulate(scene, card).readings.signal_V.ravel() * 1e3, lw=1, label=label)
axis.set(xlabel="reading", ylabel="signal dV (mV)")
axis.legend()
