"""
Where a law loses stability
===========================

Drucker's criterion along five modes, for laws of two signs.

With moduli of one sign the law is stable over all strains that are scanned. With two signs it is unstable in a band
of strains in every mode.
"""

import matplotlib.pyplot as plt

import matcal

laws = {"mu of one sign": matcal.Hyperfoam([9000.0, 600.0], [6.0, -2.0], [0.0, 0.0]),
        "mu of two signs": matcal.Hyperfoam([43108.0, -51115.0, 17835.0], [0.47, 0.65, 4.16], [0.0, 0.0, 0.0])}
figure, axes = plt.subplots(1, 2, figsize=(9, 3), sharey=True, layout="constrained")
for axis, (name, law) in zip(axes, laws.items(), strict=True):
    found = matcal.stability(law)["drucker"]
    for row, one in enumerate(found.values()):
        low, high = one["scanned"]
        axis.plot([low, high], [row, row], color="tab:blue", lw=6, solid_capstyle="butt")
        for start, end in one["unstable_strain"]:
            axis.plot([start, end], [row, row], color="tab:red", lw=6, solid_capstyle="butt")
    axis.set(title=name, xlabel="strain (J in volumetric)", yticks=range(len(found)), yticklabels=list(found))
figure.suptitle("blue: stable, red: not")
