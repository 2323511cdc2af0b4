"""
How many terms does the foam's law need?
========================================

The same synthetic compression test, fitted with one, two and three terms.

One term misses the plateau and the steep end, three follow the test.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import matcal

tests = [Path("../../../data_raw") / name for name in ("uniaxial.csv", "shear.csv")]
strain = np.linspace(-0.8, 0, 100)
figure, axis = plt.subplots(layout="constrained")
measured = pd.read_csv(tests[0], comment="#", skiprows=[2])
axis.plot(measured["strain"], measured["stress"], ".", color="0.7", label="test (synthetic)")
for order, dash in ((1, ":"), (2, "--"), (3, "-")):
    card = matcal.fit(tests, order=order).card
    stress_Pa = np.asarray(matcal.predict(card, "uniaxial", strain)["stress_Pa"])
    axis.plot(strain, stress_Pa / 1e3, dash, label=f"order {order}")
axis.set(xlabel="nominal strain", ylabel="nominal stress (kPa)")
axis.legend()
