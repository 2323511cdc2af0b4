"""
A touch that is held
====================

At a constant force the foam creeps: depth grows and with it the signal.
"""

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

creeping = matcal.MaterialCard("foam by hand", card.hyperfoam, matcal.Prony([0.2, 0.1], [1.0, 20.0]),
                               conductivity=card.conductivity)
scene = eitsim.Scene(punches=[eitsim.Punch(x_m=0.03, force_N=0.5)], accuracy=eitsim.Accuracy(0.05),
                     hold=eitsim.Hold(time_s=(0.1, 0.5, 2.0, 10.0, 60.0), moduli="instantaneous"))
moments = eitsim.simulate(scene, creeping).moments
figure, axis = plt.subplots(layout="constrained")
times_s = [max(moment.time_s, 0.03) for moment in moments]
axis.semilogx(times_s, [moment.touches[0].depth_m * 1e3 for moment in moments], "o-")
axis.set(xlabel="time since loading (s); the first point is the end of loading", ylabel="depth (mm)")
signal = axis.twinx()
signal_mV = [np.sqrt(np.mean(moment.readings.signal_V**2)) * 1e3 for moment in moments]
signal.semilogx(times_s, signal_mV, "s--", color="tab:red")
signal.set_ylabel("r.m.s. signal (mV)", color="tab:red")
