"""
A real foam and the orders of the law
=====================================

How many terms does a vinyl nitrile foam need?

The data are **real**: foam VN600 in quasi-static compression, measured by NIST (``docs/gallery/5_real/data/NOTICE``
has source and licence). One test in compression says nothing of the lateral stretch, and the law takes it as 1. The
record begins at 4.6 kPa, which no law has at rest.

Two or three terms follow the test but for its first points; one term does not.
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import matcal

file = "data/vn600_compression.csv"
test = pd.read_csv(file, comment="#", skiprows=[2])
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
left.plot(test["strain"], test["stress"], ".", color="0.7", label="test (NIST)")
for order, dash in ((1, ":"), (2, "--"), (3, "-")):
    law = matcal.predict(matcal.fit(f"uniaxial={file}", order=order).card, "uniaxial", test["strain"])
    stress_kPa = np.asarray(law["stress_Pa"]) / 1e3
    left.plot(test["strain"], stress_kPa, dash, label=f"order {order}")
    right.plot(test["strain"], test["stress"] - stress_kPa, dash, color=left.lines[-1].get_color())
left.set(xlabel="nominal strain", ylabel="nominal stress (kPa)")
left.legend()
right.axhline(0, color="0.7", lw=0.8, zorder=0)
right.set(xlabel="nominal strain", ylabel="test less law (kPa)")

# %%
# What the automatic choice says of them: each order's error and Schwarz's criterion, and why a better fit is passed
# over.

for decision in matcal.fit(f"uniaxial={file}").card.provenance["decisions"]:
    if decision.startswith("Order"):
        print(decision, "\n")
