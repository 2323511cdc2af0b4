"""Abaqus: *HYPERFOAM and *VISCOELASTIC, TIME=PRONY.

The energy is the card's own, nu_i in place of beta_i. Data lines hold at most eight values of at most 20 characters:
mu_1, alpha_1, ..., mu_N, alpha_N, then nu_1, ..., nu_N, without a break between the two; N <= 6.

Relaxation by Abaqus's equation against the card's, uniaxial to -0.8 with the paper's Table 1: 5 % softer at
the end of a ramp of 192 s, equal to 1e-4 on the hold after a ramp of 1 s (tests/matcal/test_export_relaxation.py).

Sources: Abaqus Keywords Reference Guide, *HYPERFOAM and *VISCOELASTIC; Abaqus Analysis User's Guide, "Hyperelastic
behavior in elastomeric foams" (22.5.2), "Time domain viscoelasticity" (22.7.1) and "Input syntax rules" (1.2.1);
Abaqus Theory Guide, "Finite-strain viscoelasticity" (4.8.2).
"""

from matcal.record.exporters import shift_lines, softening_lines
from matcal.record.exporters.base import Material, Target, Written, moduli_note, refuse_more_terms
from matcal.record.exporters.formatting import commented_file, identifier, number, rows

WIDTH, PER_LINE, MOST_TERMS = 20, 8, 6
_MODULI = {"instantaneous": "INSTANTANEOUS", "longterm": "LONG TERM"}


def write(material: Material) -> Written:
    """The material in Abaqus's keywords; ValueError where N > 6."""
    refuse_more_terms(material, MOST_TERMS, "Abaqus")
    law = material.foam
    relaxing = f", MODULI={_MODULI[law.moduli]}" if material.prony else ""
    lines = [f"*MATERIAL, NAME={identifier(material.name)}", *density_lines(material),
             f"*HYPERFOAM, N={law.mu_Pa.size}{relaxing}", *hyperfoam_data(material)]
    notes = [moduli_note(material),
             "Data: mu_1, alpha_1, ..., mu_N, alpha_N, then nu_1, ..., nu_N, eight values a line."]
    if material.prony is None:
        return Written(tuple(lines), tuple(notes))
    series = zip(material.prony.g, material.tau, strict=True)
    lines += ["*VISCOELASTIC, TIME=PRONY",
              *(", ".join(number(v, WIDTH) for v in (g, g, tau)) for g, tau in series)]
    notes += ["Relaxation: g_i, k_i, tau_i a line; k_i = g_i, because the whole stress relaxes (as Abaqus assumes).",
              "It acts in *VISCO and *DYNAMIC steps; *STATIC, LONG TERM gives the relaxed response."]
    return Written(tuple(lines), tuple(notes), (
        "Abaqus convolves the Kirchhoff stress, its deviator carried along by the distortional deformation; the card "
        "was fitted with the second Piola-Kirchhoff stress. Holds after a fast step agree; at the end of a slow ramp "
        "to large compression Abaqus differs by some per cent.",
    ), shifts=True)


def density_lines(material: Material) -> list[str]:
    """*DENSITY where a density is known."""
    return [] if material.density is None else ["*DENSITY", number(material.density, WIDTH)]


def hyperfoam_data(material: Material) -> list[str]:
    """Data lines of *HYPERFOAM, which CalculiX shares."""
    law = material.foam
    pairs = [v for pair in zip(material.mu, law.alpha, strict=True) for v in pair]
    return rows([number(v, WIDTH) for v in (*pairs, *law.nu)], PER_LINE)


TARGET = Target("Abaqus", write, commented_file("**"), similar={"neo_hooke": "*HYPERELASTIC, NEO HOOKE"},
                shift=shift_lines.abaqus, softening=softening_lines.abaqus)
