"""LS-DYNA: *MAT_HILL_FOAM (177), elastic; rubbers as 77_H, 77_O or 127, with viscous terms.

Energy: W = sum C_j/b_j [ sum_k lambda_k^b_j - 3 + (J^(-n b_j) - 1)/n ], mu = sum C_j b_j / 2, K = 2 mu (n + 1/3), up to
eight pairs and one n for all: the card's energy with C_j = 2 mu_j/alpha_j, b_j = alpha_j, n = beta. The keyword ends
in +, so that every field has 20 columns (the usual 10 hold six digits of a modulus).

Cards: MID RO K N MU LCID FITTYPE LCSR / C1-C8 / B1-B8 / R M. K serves contact and time step only, MU is a numerical
damping, R and M are the Mullins effect (none). *MAT_VISCOELASTIC_HILL_FOAM (178) adds a linear viscous stress to the
Hill stress; the card's relaxation multiplies it, which is another law, so it is left out.

Rubbers: the stress of the energy is long-term, and terms GI, BETAI add sum_i 2 int G_i exp(-BETA_i (t - s)) de(s) of
the deviator (VFLAG 0): G_i = g_i mu_0 with the instantaneous mu_0, BETA_i = 1/tau_i is the card at small strain. One
term a card, at most twelve of 77_H and 77_O, six of 127.

Sources: LS-DYNA Keyword User's Manual, Volume II, *MAT_HILL_FOAM, *MAT_VISCOELASTIC_HILL_FOAM, *MAT_OGDEN_RUBBER,
Volume I, "Long format"; field tables of PyDyna (`MatHillFoam`, `Mat077O`). Hill, Adv. Appl. Mech. 18 (1979) 1;
Storakers, J. Mech. Phys. Solids 34 (1986) 125.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from matcal.laws.law import scaled
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.record.exporters.base import Material, Target, Written, elastic_warning, moduli_note, refuse_more_terms
from matcal.record.exporters.formatting import commented_file, number
from matcal.record.exporters.rubber_constants import polynomial, powers, stiff
from touchcal.arrays import Array

WIDTH, MOST_TERMS = 20, 8
DAMPING = 0.1
_VISCOUS = ("LS-DYNA's terms are a linear viscous stress next to the law: G_i = g_i mu_0. The card's relaxation "
            "multiplies the stress of the law, which is the same at small strain alone. Compare one element with "
            "`matcal predict` at the strains of the model.")


def write(material: Material) -> Written:
    """The material as *MAT_HILL_FOAM; ValueError where nu differs from term to term, or for more than eight terms."""
    if not material.is_foam:
        return _rubber(material)
    law = material.foam
    refuse_more_terms(material, MOST_TERMS, "LS-DYNA")
    if np.ptp(law.nu) > 0:
        raise ValueError(f"LS-DYNA's *MAT_HILL_FOAM has one n (beta) for all terms; this card has nu = "
                         f"{law.nu.tolist()}. Fit it with one `poisson`, or export to another target.")
    n = float(law.beta[0])
    bulk = float(np.sum(2 * material.mu * (1 / 3 + n)))
    lines = ("*MAT_HILL_FOAM+",
             _heads("mid", "ro", "k", "n", "mu", "lcid", "fittype", "lcsr"),
             "1".rjust(WIDTH) + _fields((material.density or 0.0, bulk, n, DAMPING)) + "".join(
                 text.rjust(WIDTH) for text in ("0", "1", "0")),
             _heads(*(f"c{j}" for j in range(1, 9))), _fields(_eight(2 * material.mu / law.alpha)),
             _heads(*(f"b{j}" for j in range(1, 9))), _fields(_eight(law.alpha)),
             _heads("r", "m"), _fields((0.0, 0.0)))
    notes = (moduli_note(material),
             "C_j = 2 mu_j/alpha_j, b_j = alpha_j, n = beta = nu/(1 - 2 nu); fields of 20 columns.",
             "K is the bulk modulus at rest; LS-DYNA uses it for contact and the time step. MU is a numerical damping.")
    return Written(lines, notes, _warnings(material, n))


def _warnings(material: Material, n: float) -> tuple[str, ...]:
    said = elastic_warning(material, "*MAT_VISCOELASTIC_HILL_FOAM adds a linear viscous stress, while "
                                       "the card's relaxation multiplies the stress")
    if material.density is None:
        said += ("RO is 0 because the card holds no density: fill it in, or export with --density.",)
    if n == 0:
        said += ("The manual's energy divides by n; the stress is regular at n = 0, which is written. Compare one "
                 "element with `matcal predict` before use.",)
    return said


def _rubber(material: Material) -> Written:
    """*MAT_HYPERELASTIC_RUBBER (77_H), *MAT_OGDEN_RUBBER (77_O) or *MAT_ARRUDA_BOYCE_RUBBER (127)."""
    material, viscous, relaxing = _relaxing(material)
    law, (kappa, nu, said) = material.law, stiff(material)
    said = (*said, *relaxing)
    head = "1".rjust(WIDTH) + _fields((material.density or 0.0,))
    if isinstance(law, ArrudaBoyce):
        lines = ("*MAT_ARRUDA_BOYCE_RUBBER+", _heads("mid", "ro", "k", "g", "n"),
                 head + _fields((kappa, law.mu_Pa * material.units.stress, law.lambda_m**2)),
                 _heads("lcid", "tramp", "nt"), _fields((0.0, 0.0, 0.0)), *viscous)
        return Written(lines, (moduli_note(material), "G = mu, N = lambda_m^2, K = kappa."), said)
    first = (_heads("mid", "ro", "pr", "n", "nv", "g", "sigf", "ref"), head + _fields((nu,)) + "0".rjust(WIDTH) * 5)
    if (c := polynomial(material)) is not None:
        names = ("10", "01", "11", "20", "02", "30")
        lines = ("*MAT_HYPERELASTIC_RUBBER+", *first, _heads(*(f"c{ij}" for ij in names)),
                 _fields(c[ij] for ij in names), *viscous)
        data = "C_pq of (I_1 - 3)^p (I_2 - 3)^q."
    else:
        pairs = powers(material) or []
        padded = [*pairs, *[(0.0, 0.0)] * (MOST_TERMS - len(pairs))]
        lines = ("*MAT_OGDEN_RUBBER+", *first, _heads(*(f"mu{j}" for j in range(1, 9))),
                 _fields(mu for mu, _ in padded), _heads(*(f"alpha{j}" for j in range(1, 9))),
                 _fields(alpha for _, alpha in padded), *viscous)
        data = "mu_j = 2 mu_j/alpha_j of the card, alpha_j."
    return Written(lines, (moduli_note(material), f"{data} PR gives the bulk modulus."), said)


def _relaxing(material: Material) -> tuple[Material, tuple[str, ...], tuple[str, ...]]:
    """The material with long-term moduli, its viscous terms, one a card, and what to warn of; as it is, without terms,
    where instantaneous moduli were asked for or where the program takes fewer."""
    prony, most = material.prony, 6 if isinstance(material.law, ArrudaBoyce) else 12
    if prony is None:
        return material, (), ()
    if material.moduli_asked and material.law.moduli == "instantaneous":
        return material, (), elastic_warning(material, "its terms come on top of long-term moduli, and instantaneous "
                                                       "ones were asked for")
    if prony.g.size > most:
        return material, (), elastic_warning(
            material, f"this law of LS-DYNA takes at most {most} terms, the card has {prony.g.size}")
    law = material.law
    if law.moduli == "instantaneous":
        law = replace(scaled(law, prony.g_infinity), moduli="longterm")
    shear = law.mu_0_Pa * material.units.stress / prony.g_infinity
    cards = tuple(_fields((g * shear, 1 / time)) + "0".rjust(WIDTH)
                  for g, time in zip(prony.g, material.tau, strict=True))
    return replace(material, law=law), (_heads("gi", "betai", "vflag"), *cards), (_VISCOUS,)


def _heads(*names: str) -> str:
    return "$#" + "".join(name.rjust(WIDTH) for name in names)[2:]


def _fields(values: Iterable[float]) -> str:
    return "".join(number(v, WIDTH - 1).rjust(WIDTH) for v in values)


def _eight(values: Array) -> list[float]:
    return [*values.tolist(), *[0.0] * (8 - values.size)]


TARGET = Target("LS-DYNA", write, commented_file("$"),
                ("hyperfoam", "mooney_rivlin", "mooney_rivlin_5", "yeoh", "ogden", "arruda_boyce"),
                similar={"neo_hooke": "*MAT_HYPERELASTIC_RUBBER"})
