"""
How a foam relaxes
==================

A synthetic hold at constant strain and the Prony series that the fit chose.

Each grey line is a term of the series: around its time tau the stress loses about the share g of its first value.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import matcal

data = Path("../../../data_raw")
card = matcal.fit([data / "mts_uniaxial.txt", data / "mts_shear.txt", data / "mts_relaxation.txt"],
                  specimen=data / "specimen.toml", order=2).card
time_s = np.geomspace(0.05, 500, 200)
found = matcal.predict(card, "relaxation", time_s)
figure, axis = plt.subplots(layout="constrained")
axis.semilogx(time_s, found["normalised_stress"])
for share, tau_s in zip(card.prony.g, card.prony.tau_s, strict=True):
    axis.axvline(tau_s, color="0.7", lw=1)
    axis.annotate(f"g = {share:.3f}, tau = {tau_s:.2g} s", (tau_s, 0.98), xycoords=axis.get_xaxis_transform(),
                  rotation=90, va="top", ha="left", fontsize=8)
axis.set(xlabel="time since loading (s)", ylabel="stress over its first value", ylim=(None, 1.12))
