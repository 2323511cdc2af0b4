"""
What extrapolation costs
========================

A law fitted to the first part of a test is asked for the rest.

The data are **real**: foam VN600 in quasi-static compression, measured by NIST (``docs/gallery/5_real/data/NOTICE``
has source and licence).

Laws fitted up to 20 or 30 % compression miss the stress at 50 % by more than half of it, in either direction. The one
fitted up to 40 % is about 11 % off there.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import matcal

test = pd.read_csv("data/vn600_compression.csv", comment="#", skiprows=[2])
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
left.plot(test["strain"], test["stress"], ".", color="0.7", label="test (NIST)")
for most in (0.2, 0.3, 0.4, 0.5):
    seen = test[test["strain"] >= -most]
    card = matcal.fit({"uniaxial": (seen["strain"].to_numpy(), seen["stress"].to_numpy() * 1e3)}).card
    law = matcal.predict(card, "uniaxial", test["strain"])
    stress_kPa, asked = np.asarray(law["stress_Pa"]) / 1e3, np.asarray(law["extrapolated"])
    order = card.hyperfoam.mu_Pa.size
    (line,) = left.plot(test["strain"], stress_kPa, lw=0.9, label=f"fitted to {most:.0%}, order {order}")
    off = np.abs(stress_kPa / test["stress"] - 1) * 100
    right.semilogy(test["strain"][~asked], off[~asked], color=line.get_color(), lw=0.9)
    right.semilogy(test["strain"][asked], off[asked], ":", color=line.get_color(), lw=1.8)
left.set(xlabel="nominal strain", ylabel="nominal stress (kPa)", ylim=(-260, 10))
left.legend()
right.set(xlabel="nominal strain", ylabel="law off (%); dotted: extrapolated", ylim=(0.01, 300))
