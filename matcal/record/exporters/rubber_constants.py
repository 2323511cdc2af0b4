"""Rubber laws as the constants of finite-element programs, W + kappa/2 (J - 1)^2 in all of them but where noted.

`polynomial`: c_ij of (I_1 - 3)^i (I_2 - 3)^j; `powers`: m_i, a_i of sum_i m_i/a_i (sum_k lambda_bar_k^a_i - 3), which
is Ansys's, LS-DYNA's and Radioss's form of Ogden's law. A law that keeps its volume has no kappa: programs that take
none get D = 0 and need elements with a pressure of their own, the others kappa = 1000 mu_0.
"""

from typing import Any

from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.mooney_rivlin_5 import MooneyRivlin5
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.laws.volumetric import nearly_incompressible
from matcal.record.exporters.base import Material

NEARLY = ("The law keeps its volume; kappa = 1000 mu_0 was written, which changes stresses by some 0.1 % of what they "
          "are where pressures are of the size of mu_0, and by more at large stretches.")
MIXED = ("D = 0: the law keeps its volume. Take elements with a pressure of their own (Abaqus's hybrid ones, Ansys's "
         "mixed u-P).")


def polynomial(material: Material) -> dict[str, float] | None:
    """Constants 10, 01, 20, 11, 02, 30 in the units of stress; None where the law is none of invariants alone."""
    law: Any = material.law
    names = {MooneyRivlin: ("10", "01"), MooneyRivlin5: ("10", "01", "20", "11", "02"), Yeoh: ("10", "20", "30")}
    if type(law) not in names:
        return None
    return {"10": 0.0, "01": 0.0, "20": 0.0, "11": 0.0, "02": 0.0, "30": 0.0} | {
        ij: getattr(law, f"c_{ij}_Pa") * material.units.stress for ij in names[type(law)]}


def powers(material: Material) -> list[tuple[float, float]] | None:
    """(m_i, a_i) in the units of stress; None where the law is no sum of powers of stretches."""
    law, unit = material.law, material.units.stress
    if isinstance(law, Ogden):
        return [(2 * mu / alpha * unit, alpha) for mu, alpha in zip(law.mu_Pa, law.alpha, strict=True)]
    if isinstance(law, MooneyRivlin):
        return [(2 * law.c_10_Pa * unit, 2.0), (-2 * law.c_01_Pa * unit, -2.0)]
    return None


def compliance(material: Material) -> float:
    """D = 2/kappa in the units of stress; 0 where the law keeps its volume."""
    return 0.0 if material.law.incompressible else 2 / (material.law.kappa_0_Pa * material.units.stress)


def stiff(material: Material) -> tuple[float, float, tuple[str, ...]]:
    """kappa in the units of stress, Poisson's ratio, and what to warn of, for programs that need a finite one."""
    law: Any = nearly_incompressible(material.law)
    return law.kappa_0_Pa * material.units.stress, law.nu, (NEARLY,) if material.law.incompressible else ()


def other_volume(material: Material, program: str) -> tuple[str, ...]:
    """The warning for programs whose law has kappa/2 ((J^2 - 1)/2 - ln J)."""
    if material.law.incompressible:
        return ()
    return (f"{program} takes kappa/2 ((J^2 - 1)/2 - ln J) of the volume with this law, the card kappa/2 (J - 1)^2: "
            "equal to first order in J - 1.",)
