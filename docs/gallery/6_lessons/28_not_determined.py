"""
A parameter that the tests do not determine
===========================================

Mooney-Rivlin has two constants, of which a uniaxial test sees little but the sum. Each point is one test with 2 % of
noise. Grey: from uniaxial tests to a strain of 0.5 the constants lie along the line of the right sum, and their split
may be anything. Blue: with a biaxial test they lie at the truth, the cross. The modulus is good in both, and stress in
other modes only in the second. ``matcal next`` names the test that decides.
"""

import matplotlib.pyplot as plt
import numpy as np

import matcal
from matcal.laws.known_laws import law_of

rubber = law_of("mooney_rivlin", [[9e4], [2e4], [0.5]])
strain = np.linspace(0.02, 0.5, 30)
figure, axis = plt.subplots(layout="constrained")
for modes, colour in ((["uniaxial"], "0.6"), (["uniaxial", "biaxial"], "C0")):
    for seed in range(15):
        draw = np.random.default_rng(seed)
        tests = []
        for mode in modes:
            stress_Pa = matcal.nominal_stress(rubber, mode, strain)
            noise = 0.02 * np.sqrt(np.mean(stress_Pa**2)) * draw.normal(size=strain.size)
            tests.append({mode: (strain, stress_Pa + noise)})
        law = matcal.fit(tests, law="mooney_rivlin").card.law
        label = " and ".join(modes) if seed == 0 else None
        axis.plot(law.c_10_Pa / 1e3, law.c_01_Pa / 1e3, "o", color=colour, label=label)
axis.plot(rubber.c_10_Pa / 1e3, rubber.c_01_Pa / 1e3, "kx", markersize=12, label="truth")
axis.set(xlabel="c_10 (kPa)", ylabel="c_01 (kPa)")
axis.legend()
