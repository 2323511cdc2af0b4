"""
Residuals and posterior of a real foam
======================================

Are the residuals of a fitted law noise, and what does its posterior make of them?

The data are **real**: foam VN600 in quasi-static compression, measured by NIST (``docs/gallery/5_real/data/NOTICE``
has source and licence). Residuals of neighbouring points are similar, since the law has not quite this foam's shape.
The posterior counts them as fewer points, so that its band is as wide as they ask for. It is the band of the law, not
of a point; the first points, where the record begins at 4.6 kPa, lie outside.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import matcal

file = "data/vn600_compression.csv"
test = pd.read_csv(file, comment="#", skiprows=[2])
with tempfile.TemporaryDirectory() as folder:
    card_file = Path(folder) / "card.json"
    matcal.fit(f"uniaxial={file}", order=2, posterior=True, seed=1).save(card_file)
    law = matcal.predict(card_file, "uniaxial", test["strain"])
    prior = matcal.read_card(card_file).posterior["prior"]
stress_kPa, low_kPa, high_kPa = (np.asarray(law[name]) / 1e3 for name in ("stress_Pa", "stress_lo_Pa", "stress_hi_Pa"))
residual_kPa = (test["stress"] - stress_kPa).to_numpy()
print(f"{len(test)} points;", prior.split(";")[-1].strip())

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
left.plot(test["strain"], residual_kPa, label="test (NIST) less law")
left.fill_between(test["strain"], low_kPa - stress_kPa, high_kPa - stress_kPa, alpha=0.3, label="95 % of the posterior")
left.set(xlabel="nominal strain", ylabel="nominal stress (kPa)")
left.legend()
about = residual_kPa - residual_kPa.mean()
lags = np.arange(60)
right.plot(lags, [about[: len(about) - k] @ about[k:] / (about @ about) for k in lags], ".-")
right.axhline(0, color="0.7", lw=0.8, zorder=0)
right.set(xlabel="distance (points)", ylabel="autocorrelation of the residuals")
