"""Abaqus: *HYPERFOAM, *HYPERELASTIC and *VISCOELASTIC, TIME=PRONY.

The energy is the card's own, nu_i in place of beta_i. Data lines hold at most eight values of at most 20 characters:
mu_1, alpha_1, ..., mu_N, alpha_N, then nu_1, ..., nu_N, without a break between the two; N <= 6.

Relaxation by Abaqus's equation against the card's, uniaxial to -0.8 with the paper's Table 1: 5 % softer at
the end of a ramp of 192 s, equal to 1e-4 on the hold after a ramp of 1 s (tests/matcal/test_export_relaxation.py).

Rubbers go out as *HYPERELASTIC with Abaqus's own energies, D_1 = 2/kappa, or 0 where the volume is kept.

Sources: Abaqus Keywords Reference Guide, *HYPERFOAM and *VISCOELASTIC; Abaqus Analysis User's Guide, "Hyperelastic
behavior in elastomeric foams" (22.5.2), "Time domain viscoelasticity" (22.7.1) and "Input syntax rules" (1.2.1);
Abaqus Theory Guide, "Finite-strain viscoelasticity" (4.8.2).
"""

from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.record.exporters import shift_lines, softening_lines
from matcal.record.exporters.base import Material, Target, Written, moduli_note, refuse_more_terms
from matcal.record.exporters.formatting import commented_file, identifier, number, rows
from matcal.record.exporters.rubber_constants import MIXED, compliance, other_volume, polynomial

WIDTH, PER_LINE, MOST_TERMS = 20, 8, 6
_MODULI = {"instantaneous": "INSTANTANEOUS", "longterm": "LONG TERM"}


def write(material: Material) -> Written:
    """The material in Abaqus's keywords; ValueError where N > 6."""
    relaxing = f", MODULI={_MODULI[material.law.moduli]}" if material.prony else ""
    head = [f"*MATERIAL, NAME={identifier(material.name)}", *density_lines(material)]
    warned: tuple[str, ...] = ()
    if material.is_foam:
        refuse_more_terms(material, MOST_TERMS, "Abaqus")
        lines = [*head, f"*HYPERFOAM, N={material.foam.mu_Pa.size}{relaxing}", *hyperfoam_data(material)]
        data = "mu_1, alpha_1, ..., mu_N, alpha_N, then nu_1, ..., nu_N, eight values a line."
    else:
        keyword, values, data = hyperelastic(material, compliance(material))
        lines = [*head, f"*HYPERELASTIC, {keyword}{relaxing}", *rows([number(v, WIDTH) for v in values], PER_LINE)]
        warned = (MIXED,) if material.law.incompressible else (
            other_volume(material, "Abaqus") if keyword == "ARRUDA-BOYCE" else ())
    notes = [moduli_note(material), f"Data: {data}"]
    if material.prony is None:
        return Written(tuple(lines), tuple(notes), warned)
    series = zip(material.prony.g, material.tau, strict=True)
    lines += ["*VISCOELASTIC, TIME=PRONY",
              *(", ".join(number(v, WIDTH) for v in (g, g, tau)) for g, tau in series)]
    notes += ["Relaxation: g_i, k_i, tau_i a line; k_i = g_i, because the whole stress relaxes (as Abaqus assumes).",
              "It acts in *VISCO and *DYNAMIC steps; *STATIC, LONG TERM gives the relaxed response."]
    return Written(tuple(lines), tuple(notes), (
        *warned, "Abaqus convolves the Kirchhoff stress, its deviator carried along by the distortional deformation; "
        "the card was fitted with the second Piola-Kirchhoff stress. Holds after a fast step agree; at the end of a "
        "slow ramp to large compression Abaqus differs by some per cent.",
    ), shifts=True)


def hyperelastic(material: Material, d: float, further: float = 0.0) -> tuple[str, list[float], str]:
    """Keyword of *HYPERELASTIC, its data with D_1 = d and D_2, D_3, ... = further, and what they are; CalculiX shares
    them."""
    law, unit = material.law, material.units.stress
    if (c := polynomial(material)) is not None:
        if isinstance(law, MooneyRivlin):
            return "MOONEY-RIVLIN", [c["10"], c["01"], d], "C_10, C_01, D_1."
        if isinstance(law, Yeoh):
            return "YEOH", [c["10"], c["20"], c["30"], d, further, further], "C_10, C_20, C_30, D_1, D_2, D_3."
        return ("POLYNOMIAL, N=2", [*(c[ij] for ij in ("10", "01", "20", "11", "02")), d, further],
                "C_10, C_01, C_20, C_11, C_02, D_1, D_2.")
    if isinstance(law, ArrudaBoyce):
        return "ARRUDA-BOYCE", [law.mu_Pa * unit, law.lambda_m, d], "mu, lambda_m, D."
    assert isinstance(law, Ogden)
    pairs = [v for mu, alpha in zip(law.mu_Pa * unit, law.alpha, strict=True) for v in (mu, alpha)]
    return (f"OGDEN, N={law.alpha.size}", [*pairs, d, *[further] * (law.alpha.size - 1)],
            "mu_1, alpha_1, ..., mu_N, alpha_N, D_1, ..., D_N, eight values a line.")


def density_lines(material: Material) -> list[str]:
    """*DENSITY where a density is known."""
    return [] if material.density is None else ["*DENSITY", number(material.density, WIDTH)]


def hyperfoam_data(material: Material) -> list[str]:
    """Data lines of *HYPERFOAM, which CalculiX shares."""
    law = material.foam
    pairs = [v for pair in zip(material.mu, law.alpha, strict=True) for v in pair]
    return rows([number(v, WIDTH) for v in (*pairs, *law.nu)], PER_LINE)


RUBBERS = ("mooney_rivlin", "mooney_rivlin_5", "yeoh", "ogden", "arruda_boyce")
TARGET = Target("Abaqus", write, commented_file("**"), ("hyperfoam", *RUBBERS),
                similar={"neo_hooke": "*HYPERELASTIC, NEO HOOKE"}, shift=shift_lines.abaqus,
                softening=softening_lines.abaqus)
