"""Ansys Mechanical APDL: TB,HYPER,,,,FOAM (Ogden compressible foam) and TB,PRONY.

Energy: W = sum mu_i/alpha_i (J^(alpha_i/3) sum_k lambda_bar_k^alpha_i - 3) + sum mu_i/(alpha_i beta_i)
(J^(-alpha_i beta_i) - 1) with lambda_bar_k = J^(-1/3) lambda_k, and mu_0 = sum mu_i alpha_i / 2: the card's energy with
mu_i(Ansys) = 2 mu_i/alpha_i. Constants: mu_1, alpha_1, ..., mu_N, alpha_N, beta_1, ..., beta_N, six a TBDATA line.
Relaxation: a_1, t_1, a_2, t_2, ... for SHEAR and again for BULK (the whole stress relaxes); the elastic constants then
are those of the fast load limit, so instantaneous moduli are written.

Sources: Ansys Mechanical APDL Theory Reference, "Ogden Compressible Foam Option"; Structural Analysis Guide, "Ogden
Compressible Foam Option (TB,HYPER,,,,FOAM)" and "Viscoelasticity"; Command Reference, TB and TBDATA.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from matcal.laws.prony import Prony
from matcal.record.exporters import shift_lines, softening_lines
from matcal.record.exporters.base import Material, Target, Written, moduli_note
from matcal.record.exporters.formatting import commented_file, number

PER_LINE = 6


def write(material: Material) -> Written:
    """The material in APDL; with relaxation always instantaneous moduli, elastic where long-term ones are asked for."""
    warnings: tuple[str, ...] = ()
    if material.prony and material.law.moduli == "longterm":
        if material.moduli_asked:
            warnings += ("The Prony series is not exported: with TB,PRONY Ansys takes instantaneous moduli, and "
                         "long-term ones were asked for. The material is elastic.",)
            material = replace(material, prony=None)
        else:
            moduli = material.foam.mu_Pa / material.prony.g_infinity
            material = replace(material, law=replace(material.law, mu_Pa=moduli, moduli="instantaneous"))
    law = material.foam
    foam = [v for pair in zip(2 * material.mu / law.alpha, law.alpha, strict=True) for v in pair]
    density = [] if material.density is None else [f"MP,DENS,1,{number(material.density)}"]
    lines = [*density, f"TB,HYPER,1,1,{law.mu_Pa.size},FOAM", *_data([*foam, *law.beta])]
    notes = [moduli_note(material),
             "Data: mu_1, alpha_1, ..., mu_N, alpha_N, beta_1, ..., beta_N; mu_i here is 2 mu_i/alpha_i of the card."]
    if np.any(law.beta == 0):
        warnings += ("The manual's energy divides by beta; the stress is regular at beta = 0, which is written. "
                     "Compare one element with `matcal predict` before use.",)
    if material.prony:
        lines += _relaxation(material, material.prony)
        notes.append("Relaxation: a_i, t_i for SHEAR and again for BULK, because the whole stress relaxes.")
        warnings += ("Ansys convolves deviator and pressure separately; the card was fitted with the second "
                     "Piola-Kirchhoff stress. Holds after a fast step agree; at the end of a slow ramp to large "
                     "compression Ansys differs by some per cent.",)
    return Written(tuple(lines), tuple(notes), warnings, shifts=material.prony is not None)


def _relaxation(material: Material, prony: Prony) -> list[str]:
    data = _data([v for pair in zip(prony.g, material.tau, strict=True) for v in pair])
    return [line for kind in ("SHEAR", "BULK") for line in (f"TB,PRONY,1,1,{prony.g.size},{kind}", *data)]


def _data(values: Sequence[float]) -> list[str]:
    return [",".join(["TBDATA", str(i + 1), *map(number, values[i:i + PER_LINE])])
            for i in range(0, len(values), PER_LINE)]


TARGET = Target("Ansys Mechanical APDL", write, commented_file("!"), similar={"neo_hooke": "TB,HYPER,,,,NEO"},
                shift=shift_lines.ansys, softening=softening_lines.ansys)
