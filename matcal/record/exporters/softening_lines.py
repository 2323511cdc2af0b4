"""Softening by earlier loading (Ogden-Roxburgh) as Abaqus and Ansys write it.

Abaqus: *MULLINS EFFECT takes r, m, beta of eta = 1 - erf((U_max - U)/(m + beta U_max))/r, the card's own; with
*HYPERFOAM it is the energy dissipation of elastomeric foams. Ansys: TB,CDM with PSE2 takes r, m, beta of the same.

Sources: Abaqus Keywords Reference Guide, *MULLINS EFFECT; Abaqus Analysis User's Guide, "Energy dissipation in
elastomeric foams"; Ansys Mechanical APDL Material Reference, "Mullins Effect".
"""

from matcal.laws.histories.damage import Damage
from matcal.record.exporters.formatting import number


def abaqus(damage: Damage, stress: float) -> tuple[str, ...]:
    """*MULLINS EFFECT; `stress` turns Pa into the units of the deck."""
    return "*MULLINS EFFECT", ", ".join(map(number, (damage.r, damage.m_Pa * stress, damage.beta)))


def ansys(damage: Damage, stress: float) -> tuple[str, ...]:
    """TB,CDM with the modified Ogden-Roxburgh function."""
    values = ",".join(map(number, (damage.r, damage.m_Pa * stress, damage.beta)))
    return "TB,CDM,1,1,3,PSE2", f"TBDATA,1,{values}"
