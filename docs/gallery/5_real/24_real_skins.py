"""
Real skins: error against labels
================================

How many labelled presses does a reader of places need?

Measured on **real** recordings of other groups: three silicone skins (Hardman et al., Variable-Sensitivity E-Skins) and
a hydrogel (Hardman et al., HydrogelEIT), last fifth of the presses in time. The values are those of
``benchmarks/results/real_skins.csv``, which ``benchmarks/real_skins.py`` writes where the recordings are present.

More labels make the error smaller on every skin. The dotted line is a reader that has learnt nothing. Both axes are
logarithmic; points are means without an interval.
"""

import matplotlib.pyplot as plt
import pandas as pd

table = pd.read_csv("../../../benchmarks/results/real_skins.csv")
rows = table[(table["split"] == "time") & (table["taken"] == "last") & (table["output"] == "place")
             & table["drift"].isna()]
figure, axes = plt.subplots(1, 4, figsize=(11, 3.2), sharex=True, sharey=True, layout="constrained")
for axis, (skin, own) in zip(axes, rows.groupby("skin", sort=False), strict=True):
    own = own.sort_values("trained")
    axis.loglog(own["trained"], own["error"], "o-", label="this project")
    axis.loglog(own["trained"], own["kernel_ridge"], "s--", label="kernel ridge regression")
    axis.loglog(own["trained"], own["mean"], ":", color="0.5", label="always the mean place")
    axis.set(title=skin.replace("_", " "), xlabel="labelled presses")
axes[0].set(ylabel="mean distance (mm)", xlim=(15, 2500), xticks=[20, 100, 1000], xticklabels=[20, 100, 1000])
axes[0].legend(fontsize=8)
