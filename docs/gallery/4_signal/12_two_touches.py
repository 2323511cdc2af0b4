"""
Two touches at once
===================

Far from each other their signals add; the program says how far that is from true.

Upper picture: the signal of both touches. Lower picture: what is left when the signal of each one alone is taken
away, some hundred times smaller. The printed bounds are relative.
"""

import matplotlib.pyplot as plt

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

one, other = eitsim.Punch(x_m=0.04, force_N=0.5), eitsim.Punch(x_m=-0.03, y_m=0.03, force_N=0.5)
accuracy = eitsim.Accuracy(0.05)
both = eitsim.simulate(eitsim.Scene(punches=[one, other], accuracy=accuracy), card)
alone = [eitsim.simulate(eitsim.Scene(punches=[punch], accuracy=accuracy), card).readings.signal_V.ravel() * 1e3
         for punch in (one, other)]
together = both.readings.signal_V.ravel() * 1e3
figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 5), sharex=True, layout="constrained")
top.plot(together, lw=1)
top.set(ylabel="dV of both (mV)")
bottom.plot(together - alone[0] - alone[1], lw=1)
bottom.set(xlabel="reading", ylabel="less those of each (mV)")
print(dict(both.interaction))
