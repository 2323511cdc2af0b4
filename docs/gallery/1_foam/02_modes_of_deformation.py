"""
One law in four modes
=====================

What a hyperfoam law fitted in compression and shear says of other modes. Blue: strains that the tests reached. Grey,
dashed: extrapolated, as all of biaxial and planar compression is.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import matcal

card = matcal.fit([Path("../../../data_raw/uniaxial.csv"), Path("../../../data_raw/shear.csv")], order=2).card
modes = {"uniaxial": (-0.7, 0), "biaxial": (-0.5, 0), "planar": (-0.7, 0), "shear": (0, 1)}
figure, axes = plt.subplots(1, 4, figsize=(11, 2.8), layout="constrained")
for axis, (mode, (low, high)) in zip(axes, modes.items(), strict=True):
    strain = np.linspace(low, high, 60)
    found = matcal.predict(card, mode, strain)
    stress_kPa, outside = np.asarray(found["stress_Pa"]) / 1e3, np.asarray(found["extrapolated"], bool)
    axis.plot(strain, np.where(outside, np.nan, stress_kPa))
    axis.plot(strain, np.where(outside, stress_kPa, np.nan), "--", color="0.6")
    axis.set(title=mode, xlabel="shear" if mode == "shear" else "nominal strain")
axes[0].set_ylabel("nominal stress (kPa)")
