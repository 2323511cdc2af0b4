"""
What could be read at best
==========================

Cramer-Rao bounds of place and force against noise: no unbiased reader is better.

At 20 dB more noise all limits are ten times larger. The diameter (d) is known less well than the place (x0, y0).
"""

import matplotlib.pyplot as plt

import eitsim
import matcal
import surrogate

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

scene = eitsim.Scene(punches=[eitsim.Punch(x_m=0.03, force_N=1.0)], accuracy=eitsim.Accuracy(0.05))
levels_dB = (100.0, 80.0, 60.0)
bounds = surrogate.cramer_rao(scene, card, noise_dB=levels_dB)
figure, axis = plt.subplots(layout="constrained")
for output, rows in bounds.groupby("output", sort=False):
    axis.semilogy(rows["noise_db"], rows["limit"], "o-", label=f"{output} ({rows['unit'].iloc[0]})")
axis.set(xlabel="noise, dB below the untouched readings", ylabel="least standard deviation")
axis.invert_xaxis()
axis.legend()
