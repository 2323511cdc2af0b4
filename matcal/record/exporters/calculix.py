"""CalculiX: *HYPERFOAM with N <= 3 and *HYPERELASTIC; elastic, because CalculiX 2.20 has no Prony series.

The energy and the order of the data are Abaqus's. CalculiX reads 20 characters of a value and no more, and
knows no parameter of *HYPERFOAM but N. A wrong order runs silently. Version 2.20 stops without a word on N = 1, so one
term goes out as two equal halves, which is the same law.

Sources: CalculiX CrunchiX User's Manual, *HYPERFOAM (energy, beta_i = nu_i/(1 - 2 nu_i), data lines); `hyperfoams.f`
of CalculiX (width of a value, known parameters); N = 1 was tried.
"""

from dataclasses import replace

from matcal.record.exporters.abaqus import (
    PER_LINE,
    RUBBERS,
    WIDTH,
    density_lines,
    hyperelastic,
    hyperfoam_data,
)
from matcal.record.exporters.base import Material, Target, Written, elastic_warning, moduli_note, refuse_more_terms
from matcal.record.exporters.formatting import commented_file, identifier, number, rows
from matcal.record.exporters.rubber_constants import other_volume, stiff

MOST_TERMS = 3
_NONE = 1e10  # D_2, D_3 over D_1: CalculiX 2.20 replaces zeros by values that change the stress by a per cent


def write(material: Material) -> Written:
    """The material in CalculiX's keywords; ValueError where N > 3."""
    if not material.is_foam:
        return _rubber(material)
    refuse_more_terms(material, MOST_TERMS, "CalculiX")
    notes = [moduli_note(material),
             "Data: mu_1, alpha_1, ..., mu_N, alpha_N, then nu_1, ..., nu_N, eight values a line."]
    if material.foam.mu_Pa.size == 1:
        law = material.foam
        halves = replace(law, mu_Pa=law.mu_Pa.repeat(2) / 2, alpha=law.alpha.repeat(2), nu=law.nu.repeat(2))
        material = replace(material, law=halves)
        notes.append("The card's one term is written as two equal halves, because CalculiX 2.20 fails on N = 1.")
    lines = (f"*MATERIAL, NAME={identifier(material.name)}", *density_lines(material),
             f"*HYPERFOAM, N={material.foam.mu_Pa.size}", *hyperfoam_data(material))
    return Written(lines, tuple(notes), elastic_warning(material, "CalculiX 2.20 has none for hyperfoam"))


def _rubber(material: Material) -> Written:
    kappa, _, said = stiff(material)
    keyword, values, data = hyperelastic(material, 2 / kappa, _NONE * 2 / kappa)
    if keyword.startswith("OGDEN") and len(values) > 3 * MOST_TERMS:
        raise ValueError(f"CalculiX takes at most {MOST_TERMS} Ogden terms, the card has {len(values) // 3}. Fit it "
                         f"again with `order` {MOST_TERMS}.")
    lines = (f"*MATERIAL, NAME={identifier(material.name)}", *density_lines(material), f"*HYPERELASTIC, {keyword}",
             *rows([number(v, WIDTH) for v in values], PER_LINE))
    more = other_volume(material, "CalculiX") if keyword == "ARRUDA-BOYCE" else ()
    return Written(lines, (moduli_note(material), f"Data: {data}"),
                   (*said, *more, *elastic_warning(material, "CalculiX 2.20 has none for hyperelastic laws")))


TARGET = Target("CalculiX", write, commented_file("**"), ("hyperfoam", *RUBBERS),
                similar={"neo_hooke": "*HYPERELASTIC, NEO HOOKE"})
