"""Ansys Mechanical APDL: TB,HYPER with FOAM (Ogden compressible foam) or a rubber's option, and TB,PRONY.

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

from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import scaled
from matcal.laws.prony import Prony
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.extended_tube import ExtendedTube
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.record.exporters import shift_lines, softening_lines
from matcal.record.exporters.base import Material, Target, Written, moduli_note
from matcal.record.exporters.formatting import commented_file, number
from matcal.record.exporters.rubber_constants import MIXED, compliance, other_volume, polynomial, powers

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
            law = replace(scaled(material.law, 1 / material.prony.g_infinity), moduli="instantaneous")
            material = replace(material, law=law)
    terms, option, values, data = _constants(material)
    density = [] if material.density is None else [f"MP,DENS,1,{number(material.density)}"]
    lines = [*density, f"TB,HYPER,1,1,{terms},{option}", *_data(values)]
    notes = [moduli_note(material), f"Data: {data}"]
    if not material.is_foam:
        warnings += (MIXED,) if material.law.incompressible else ()
        warnings += other_volume(material, "Ansys") if option in ("BOYCE", "GENT") else ()
    elif np.any(material.foam.beta == 0):
        warnings += ("The manual's energy divides by beta; the stress is regular at beta = 0, which is written. "
                     "Compare one element with `matcal predict` before use.",)
    if material.prony:
        lines += _relaxation(material, material.prony)
        notes.append("Relaxation: a_i, t_i for SHEAR and again for BULK, because the whole stress relaxes.")
        warnings += ("Ansys convolves deviator and pressure separately; the card was fitted with the second "
                     "Piola-Kirchhoff stress. Holds after a fast step agree; at the end of a slow ramp to large "
                     "compression Ansys differs by some per cent.",)
    return Written(tuple(lines), tuple(notes), warnings, shifts=material.prony is not None)


def _constants(material: Material) -> tuple[int, str, list[float], str]:
    """Terms and option of TB,HYPER, its data, and what they are."""
    law, unit, d = material.law, material.units.stress, 0.0 if material.is_foam else compliance(material)
    if isinstance(law, Hyperfoam):
        foam = [v for pair in zip(2 * material.mu / law.alpha, law.alpha, strict=True) for v in pair]
        return (law.mu_Pa.size, "FOAM", [*foam, *law.beta],
                "mu_1, alpha_1, ..., mu_N, alpha_N, beta_1, ..., beta_N; mu_i here is 2 mu_i/alpha_i of the card.")
    if (c := polynomial(material)) is not None:
        if isinstance(law, Yeoh):
            return 3, "YEOH", [c["10"], c["20"], c["30"], d, 0.0, 0.0], "C_10, C_20, C_30, d_1, d_2, d_3."
        names = ("10", "01") if isinstance(law, MooneyRivlin) else ("10", "01", "20", "11", "02")
        return len(names), "MOONEY", [*(c[ij] for ij in names), d], f"C_{', C_'.join(names)}, d = 2/kappa."
    if isinstance(law, Gent):
        return 1, "GENT", [law.mu_Pa * unit, law.j_m, d], "mu, J_m, d = 2/kappa."
    if isinstance(law, ArrudaBoyce):
        return 1, "BOYCE", [law.mu_Pa * unit, law.lambda_m, d], "mu, lambda_L, d = 2/kappa."
    if isinstance(law, ExtendedTube):
        return (1, "ETUBE", [law.g_c_Pa * unit, law.delta, law.g_e_Pa * unit, law.beta, d],
                "G_c, delta, G_e, beta, d_1 = 2/kappa.")
    pairs = powers(material) or []
    return (len(pairs), "OGDEN", [*(v for pair in pairs for v in pair), d, *[0.0] * (len(pairs) - 1)],
            "mu_1, alpha_1, ..., mu_N, alpha_N, d_1, ..., d_N; mu_i here is 2 mu_i/alpha_i of the card.")


def _relaxation(material: Material, prony: Prony) -> list[str]:
    data = _data([v for pair in zip(prony.g, material.tau, strict=True) for v in pair])
    return [line for kind in ("SHEAR", "BULK") for line in (f"TB,PRONY,1,1,{prony.g.size},{kind}", *data)]


def _data(values: Sequence[float]) -> list[str]:
    return [",".join(["TBDATA", str(i + 1), *map(number, values[i:i + PER_LINE])])
            for i in range(0, len(values), PER_LINE)]


TARGET = Target("Ansys Mechanical APDL", write, commented_file("!"),
                ("hyperfoam", "mooney_rivlin", "mooney_rivlin_5", "yeoh", "ogden", "gent", "arruda_boyce",
                 "extended_tube"), similar={"neo_hooke": "TB,HYPER,,,,NEO"},
                shift=shift_lines.ansys, softening=softening_lines.ansys)
