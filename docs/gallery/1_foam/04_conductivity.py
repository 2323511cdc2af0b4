"""
Conductivity of a coating against stretch
=========================================

From a load frame's displacement and a potentiostat's resistance to the cubic law c(e).

The more the coating is stretched, the less it conducts. Outside the strains of the test the law is extrapolated.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import matcal

data = Path("../../../data_raw")
stretched = {"conductivity": [data / "mts_stretch.txt", data / "nova_stretch.txt"]}
measured = matcal.read_test(stretched, specimen=data / "specimen.toml")
card = matcal.fit([data / "uniaxial.csv", stretched], specimen=data / "specimen.toml", order=1).card
strain = np.linspace(-0.2, 0.6, 100)
found = matcal.predict(card, "conductivity", strain)
outside = np.asarray(found["extrapolated"], bool)
conductivity = np.asarray(found["conductivity_S_per_m"])
figure, axis = plt.subplots(layout="constrained")
axis.plot(measured.strain, measured.value, ".", color="0.7", label="test (synthetic)")
axis.plot(strain, np.where(outside, np.nan, conductivity), label="fitted")
axis.plot(strain, np.where(outside, conductivity, np.nan), "--", color="0.6", label="extrapolated")
axis.set(xlabel="strain e", ylabel="conductivity (S/m)")
axis.legend()
