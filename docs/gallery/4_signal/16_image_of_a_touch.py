"""
An image by one Gauss-Newton step
=================================

What classical EIT makes of the readings, with the touch that caused them.

The circle is the punch. Both images find the place, and draw it far wider than the punch.
"""

import matplotlib.pyplot as plt
import numpy as np

import eitsim
import matcal

card = matcal.MaterialCard("foam by hand", matcal.Hyperfoam([9530.0], [8.0], [0.0], "longterm"),
                           conductivity=matcal.Conductivity(30.0, [-2.0, 2.0, -1.0], (0.0, 0.4)))

punch = eitsim.Punch(x_m=0.04, y_m=0.02, force_N=0.5)
readings = eitsim.simulate(eitsim.Scene(punches=[punch], accuracy=eitsim.Accuracy(0.05)), card).readings
figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for axis, prior in zip(axes, ("laplace", "noser"), strict=True):
    images = eitsim.reconstruct(readings.touched_V, readings.baseline_V, prior=prior)
    most = np.abs(images.change).max()
    drawn = axis.tripcolor(*(images.pixels.nodes_m * 1e3).T, images.pixels.triangles, images.change[0], cmap="RdBu",
                           vmin=-most, vmax=most)
    axis.add_patch(plt.Circle((punch.x_m * 1e3, punch.y_m * 1e3), punch.diameter_m * 500, fill=False))
    axis.set(title=prior, aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
    figure.colorbar(drawn, label="relative change of conductance")
