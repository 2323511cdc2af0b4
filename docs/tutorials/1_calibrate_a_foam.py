r"""
Calibrate a foam
================

From files of a load frame to a material card with intervals.

The files in ``data_raw`` are **synthetic**: a generator with a known truth wrote them in the layouts of real machines.
The law is the hyperfoam of Ogden and Hill. With principal stretches :math:`\lambda_k` and volume ratio :math:`J` its
energy is

.. math:: U = \sum_i \frac{2\mu_i}{\alpha_i^2}
          \left[\sum_k \lambda_k^{\alpha_i} - 3 + \frac{1}{\beta_i}\left(J^{-\alpha_i\beta_i} - 1\right)\right],
          \qquad \beta_i = \frac{\nu_i}{1 - 2\nu_i}.
"""

# %%
# Look at a file first
# --------------------
# Each file is recognised by its contents. ``inspect`` says what was understood, before anything is fitted.

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import matcal

data = Path("../../data_raw")
seen = matcal.inspect(data / "uniaxial.csv")
print(seen["kind"], seen["rows"])

# %%
# Fit
# ---
# One call fits all that the tests allow: the foam from compression and shear, the conductivity of the coating from
# stretch and resistance. The order of the law is chosen by the data.

fit = matcal.fit([data / "uniaxial.csv", data / "shear.csv",
                  {"conductivity": [data / "mts_stretch.txt", data / "nova_stretch.txt"]}],
                 specimen=data / "specimen.toml")
card = fit.card
print("mu, Pa:   ", card.hyperfoam.mu_Pa.round(0))
print("alpha:    ", card.hyperfoam.alpha.round(3))
print("c0, S/m:  ", round(card.conductivity.c0_S_per_m, 2), "a:", card.conductivity.a.round(2))

# %%
# Single mu and alpha compensate each other and are not measurable. What the tests determine are the moduli and the
# plateau, here with their 95 % intervals. They are those of the specimens: one of each kind says nothing of others.

for name, one in card.fit["derived"].items():
    print(f"{name:10s} {one['value']:7.0f}, {one['lo']:.0f} to {one['hi']:.0f}")

# %%
# Compare with the data
# ---------------------
# ``predict`` gives the law in any mode of deformation, and says which rows are extrapolated.

measured = pd.read_csv(data / "uniaxial.csv", comment="#", skiprows=[2])
strain = np.linspace(measured["strain"].min(), 0, 80)
law = matcal.predict(card, "uniaxial", strain)

figure, axis = plt.subplots(layout="constrained")
axis.plot(measured["strain"], measured["stress"], ".", label="test (synthetic)", color="0.6")
axis.plot(strain, np.asarray(law["stress_Pa"]) / 1e3, label="law")
axis.set(xlabel="nominal strain", ylabel="nominal stress (kPa)")
axis.legend()

# %%
# Is the law stable?
# ------------------
# A fit can be good and its law unusable. ``check`` names the strains at which it is not Drucker stable.

for mode, one in matcal.check(card)["drucker"].items():
    print(f"{mode:11s}", "stable" if one["stable"] else f"unstable at {one['unstable_strain']}")

# %%
# It is not, so ask for a law that is; the fit becomes a little worse.

stable = matcal.fit([data / "uniaxial.csv", data / "shear.csv"], stable="drucker").card
figure, axis = plt.subplots(layout="constrained")
axis.plot(measured["strain"], measured["stress"], ".", label="test (synthetic)", color="0.6")
axis.plot(strain, np.asarray(matcal.predict(stable, "uniaxial", strain)["stress_Pa"]) / 1e3, label="stable law")
axis.set(xlabel="nominal strain", ylabel="nominal stress (kPa)")
axis.legend()

# %%
# Keep it
# -------
# ``fit.save("card.json")`` writes the card with its data. A card is what everything else here begins with; other
# programs read it as well:

print(matcal.export(card, "abaqus").text)

# %%
# The commands, and sizes of specimens for raw files: :doc:`/how-to/calibrate-a-foam`.
