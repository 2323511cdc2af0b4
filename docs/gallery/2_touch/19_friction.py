"""
Does friction at the punch matter?
==================================

The surface's strain next to a punch that slips and one that sticks.

A punch that sticks goes less deep. It keeps the skin under it from stretching, and stretches it more next to its
edge. At 6 to 7 mm, where its rounded edge rolls onto the foam, the computed strain jumps from element to element:
single values there mean nothing.
"""

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

figure, axis = plt.subplots(layout="constrained")
for friction in ("none", "stick"):
    punch = eitsim.Punch(force_N=1.0, friction=friction)
    found = eitsim.simulate(eitsim.Scene(punches=[punch], accuracy=eitsim.Accuracy(0.05)), card)
    touch = found.touches[0]
    axis.plot(touch.radius_m * 1e3, np.maximum(touch.stretch_meridian, touch.stretch_hoop) - 1,
              label=f"{friction}: depth {touch.depth_m * 1e3:.2f} mm")
axis.set(xlim=(0, 20), xlabel="distance from the axis (mm)", ylabel="largest strain in plane")
axis.legend(title="friction")
