"""
A law that does not fit
=======================

A rubber that stiffens, fitted with neo-Hooke, which cannot. Left: law minus test goes up and down in a slow wave, where
noise alone would scatter. Right: in a mode that was not tested the wrong law misses the truth, of which its interval of
mu_0 knows nothing: an interval is one of its own law. ``law="auto"`` compares laws by what they were not fitted to; its
band holds the truth here.
"""

import matplotlib.pyplot as plt
import numpy as np

import matcal
from matcal.laws.known_laws import law_of

rubber = law_of("gent", [[2e5], [30.0], [0.5]])
strain = np.linspace(0.02, 3.0, 60)
stress_Pa = matcal.nominal_stress(rubber, "uniaxial", strain)
record = stress_Pa * (1 + 0.01 * np.random.default_rng(1).normal(size=strain.size))
across = np.linspace(0.05, 1.2, 40)
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
for law, colour in (("neo_hooke", "C1"), ("auto", "C0")):
    choice = {"poisson": 0.5} if law == "neo_hooke" else {}
    card = matcal.fit({"uniaxial": (strain, record)}, law=law, **choice).card
    found = np.asarray(matcal.predict(card, "uniaxial", strain)["stress_Pa"])
    left.plot(strain, (found - record) / 1e3, ".-", color=colour, label=f"{law}: {card.law.name}")
    biaxial = matcal.predict(card, "biaxial", across)
    right.plot(across, np.asarray(biaxial["stress_Pa"]) / 1e3, color=colour)
    if "stress_lo_Pa" in biaxial:
        right.fill_between(across, np.asarray(biaxial["stress_lo_Pa"]) / 1e3, np.asarray(biaxial["stress_hi_Pa"]) / 1e3,
                           color=colour, alpha=0.2)
right.plot(across, matcal.nominal_stress(rubber, "biaxial", across) / 1e3, "k--", label="truth")
left.set(xlabel="nominal strain", ylabel="law minus test (kPa)", title="uniaxial, tested")
right.set(xlabel="nominal strain", ylabel="nominal stress (kPa)", title="biaxial, not tested")
left.legend()
right.legend()
