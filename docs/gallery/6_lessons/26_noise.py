"""
What noise does to a modulus
============================

The same rubber tested twelve times, with 1 % of noise of the load and a load that starts up to 2 % off. Left: noise
that is new at every point. Right: noise that lasts over some seven points, as a load cell's drift does; it averages out
less, so the intervals are wider. Each bar is the 95 % interval of one fit, the line the truth. Read the bars, not the
points: some points are off, and the bars hold the line.
"""

import matplotlib.pyplot as plt
import numpy as np

import matcal
from matcal.laws.known_laws import law_of

rubber = law_of("yeoh", [[1e5], [-1e3], [60.0], [0.5]])
strain = np.linspace(0.02, 2.5, 80)
stress_Pa = matcal.nominal_stress(rubber, "uniaxial", strain)
size_Pa = np.sqrt(np.mean(stress_Pa**2))
figure, axes = plt.subplots(1, 2, figsize=(8, 3), sharey=True, layout="constrained")
for axis, lasting in zip(axes, (0.0, 0.85), strict=True):
    for seed in range(12):
        draw = np.random.default_rng(seed)
        noise = draw.normal(size=strain.size)
        for k in range(1, strain.size):
            noise[k] = lasting * noise[k - 1] + np.sqrt(1 - lasting**2) * noise[k]
        record = stress_Pa + size_Pa * (0.01 * noise + draw.uniform(-0.02, 0.02))
        found = matcal.fit({"uniaxial": (strain, record)}, law="yeoh").card.fit["derived"]["mu_0_Pa"]
        axis.plot([seed, seed], [found["lo"] / 1e3, found["hi"] / 1e3], color="0.5")
        axis.plot(seed, found["value"] / 1e3, "o", color="C0")
    axis.axhline(rubber.mu_0_Pa / 1e3, color="C1")
    axis.set(xlabel="test", title=f"correlation {lasting:g}")
axes[0].set_ylabel("mu_0 (kPa)")
