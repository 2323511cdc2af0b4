"""FEBio: "Ogden unconstrained" or "neo-Hookean", inside "viscoelastic" where the card relaxes.

Energy: W = c_p/2 (J - 1)^2 + sum c_i/m_i^2 (sum_k lambda_k^m_i - 3 - m_i ln J), at most six terms. The card's energy at
beta = 0 is this with c_i = 2 mu_i, m_i = alpha_i, c_p = 0; at beta > 0 its volumetric term is J^(-alpha beta), which
no c_p gives: exact for beta = 0 only. "neo-Hookean" is the card's neo_hooke, E = 2 mu (1 + nu): W = mu/2 (I_1 - 3)
- mu ln J + lambda/2 (ln J)^2. Relaxation is S(t) = int G(t - s) dS_e, G = g_0 + sum g_i exp(-t/t_i) on the second
Piola-Kirchhoff stress, at most six terms: the card's own form. "uncoupled viscoelastic" relaxes the deviator of that
stress alone, with the same G, and adds the pressure of its own k and pressure model to it; the bulk modulus of the law
inside is added to k, so that the law inside has none.

Source: FEBio User Manual (version 4), "Ogden unconstrained", "neo-Hookean" and "viscoelastic" under unconstrained
materials, "uncoupled viscoelastic" under uncoupled ones; `FENeoHookean.cpp` and `FEUncoupledViscoElasticMaterial.cpp`
of FEBio.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.prony import Prony
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.record.exporters.base import Material, Target, Written, elastic_warning, moduli_note, refuse_more_terms
from matcal.record.exporters.formatting import comment, number
from matcal.record.exporters.rubber_constants import polynomial, stiff
from touchcal.arrays import Array

MOST_TERMS = 6
_RELAXATION = "G(t) = g0 + sum g_i exp(-t/t_i) on the"
_DEVIATOR = ("FEBio relaxes the deviator of the second Piola-Kirchhoff stress, the card that stress with the pressure "
             "of free faces. Holds agree; during a slow ramp to twice the length FEBio is some 2 % stiffer.")


def write(material: Material) -> Written:
    """The material as FEBio's XML; ValueError where a nu (so a beta) of a hyperfoam is not 0, or for more than six
    terms."""
    if isinstance(material.law, NeoHooke) and not material.law.incompressible:
        kind, constants, note = "neo-Hookean", _neo_hooke(material, material.law), "E = 2 mu (1 + nu), v = nu."
    elif not material.is_foam:
        return _rubber(material)
    else:
        kind, constants = "Ogden unconstrained", _terms(material)
        note = "c_i = 2 mu_i, m_i = alpha_i, cp = 0: the card's law for beta = 0."
    notes = [moduli_note(material), note]
    if material.prony is not None:
        notes.append(f"{_RELAXATION} second Piola-Kirchhoff stress, G = 1 for the moduli written.")
    return Written(_material(material, kind, constants, [], "viscoelastic"), tuple(notes))


def _material(material: Material, kind: str, constants: list[str], volume: list[str], around: str) -> tuple[str, ...]:
    """The law alone, or inside the material `around` that relaxes it; `volume` is of the outer one of both."""
    heading = f'<material id="1" name={quoteattr(material.name)} type='
    density = [] if material.density is None else [_element("density", material.density)]
    if material.prony is None:
        return f'{heading}"{kind}">', *_indent([*density, *constants, *volume]), "</material>"
    relaxation = _relaxation(material.prony, material.tau, material.law.moduli)
    elastic = [f'<elastic type="{kind}">', *_indent([*density, *constants]), "</elastic>"]
    return f'{heading}"{around}">', *_indent([*density, *relaxation, *volume, *elastic]), "</material>"


def _rubber(material: Material) -> Written:
    """An uncoupled material, kappa/2 (J - 1)^2 of its volume: pressure model 2, Abaqus's."""
    law, unit = material.law, material.units.stress
    kappa, _, said = stiff(material)
    if isinstance(law, Ogden):
        terms = enumerate(zip(2 * law.mu_Pa * unit, law.alpha, strict=True), 1)
        kind, constants = "Ogden", [pair for i, (c, m) in terms for pair in ((f"c{i}", float(c)), (f"m{i}", float(m)))]
    elif isinstance(law, ArrudaBoyce):
        kind, constants = "Arruda-Boyce", [("mu", law.mu_Pa * unit), ("N", law.lambda_m**2)]
    elif isinstance(law, Gent):
        kind, constants = "Gent", [("G", law.mu_Pa * unit), ("Jm", law.j_m)]
    else:
        c = polynomial(material) or {}
        kind, constants = ("Yeoh", [("c1", c["10"]), ("c2", c["20"]), ("c3", c["30"])]) if isinstance(law, Yeoh) else (
            "Mooney-Rivlin", [("c1", c["10"]), ("c2", c["01"])])
    volume = [_element("k", kappa), "<pressure_model>2</pressure_model>"]
    notes = [moduli_note(material), "Uncoupled: energy of the stretches at constant volume, and k/2 (J - 1)^2."]
    if material.prony is not None and material.prony.g.size > MOST_TERMS:
        said = (*said, *elastic_warning(material, f"FEBio takes at most {MOST_TERMS} terms, the card has "
                                                  f"{material.prony.g.size}"))
        material = replace(material, prony=None)
    if material.prony is not None:
        notes.append(f"{_RELAXATION} deviator of the second Piola-Kirchhoff stress, G = 1 for the moduli written.")
        said = (*said, _DEVIATOR)
    lines = _material(material, kind, [_element(tag, value) for tag, value in constants], volume,
                      "uncoupled viscoelastic")
    return Written(lines, tuple(notes), said)


def _neo_hooke(material: Material, law: NeoHooke) -> list[str]:
    return [_element("E", 2 * law.mu_Pa * (1 + law.nu) * material.units.stress), _element("v", law.nu)]


def _terms(material: Material) -> list[str]:
    if np.any(material.foam.nu != 0):
        raise ValueError("FEBio's Ogden unconstrained law is the card's hyperfoam for beta = 0 only; this card has "
                         f"nu = {material.foam.nu.tolist()}. Fit it with `matcal fit --poisson 0`, or export to "
                         "another target.")
    refuse_more_terms(material, MOST_TERMS, "FEBio")
    return [line for i, (mu, alpha) in enumerate(zip(material.mu, material.foam.alpha, strict=True), 1)
            for line in (_element(f"c{i}", 2 * mu), _element(f"m{i}", alpha))] + [_element("cp", 0.0)]


def _relaxation(prony: Prony, tau: Array, moduli: str) -> list[str]:
    """G(t) over the modulus that is written: G(0) = 1 for instantaneous, G(infinity) = 1 for long-term moduli."""
    if prony.g.size > MOST_TERMS:
        raise ValueError(f"FEBio takes at most {MOST_TERMS} Prony terms, the card has {prony.g.size}.")
    whole = 1.0 if moduli == "instantaneous" else prony.g_infinity
    out = [_element("g0", prony.g_infinity / whole)]
    for i, (g, time) in enumerate(zip(prony.g, tau, strict=True), 1):
        out += [_element(f"g{i}", g / whole), _element(f"t{i}", time)]
    return out


def _element(tag: str, value: float) -> str:
    return f"<{tag}>{number(value)}</{tag}>"


def _indent(lines: Iterable[str]) -> list[str]:
    return [f"  {line}" for line in lines]


def assemble(sentences: Sequence[str], lines: Sequence[str]) -> str:
    """A file with a Material section alone, to be included or copied; XML forbids two hyphens in a comment."""
    said = [re.sub("-(?=-)", "- ", escape(line)) for line in comment(sentences, " ")]
    body = ["<Material>", *_indent(lines), "</Material>"]
    return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', '<febio_spec version="4.0">', "  <!--", *said, "  -->",
                      *_indent(body), "</febio_spec>"]) + "\n"


TARGET = Target("FEBio", write, assemble, ("hyperfoam", "neo_hooke", "mooney_rivlin", "yeoh", "ogden", "gent",
                                           "arruda_boyce"))
