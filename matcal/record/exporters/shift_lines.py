"""Shift of relaxation times with temperature as Abaqus and Ansys write it, after the Prony series.

Abaqus: *TRS, DEFINITION=WLF takes theta_0, C_1, C_2 of log10 A = -C_1 (theta - theta_0)/(C_2 + theta - theta_0), with
the reduced time t/A: the card's a_T. DEFINITION=ARRHENIUS takes the activation energy and theta_0. Ansys: TB,SHIFT with
WLF takes T_r, C_1, C_2 of log10 A = C_1 (T - T_r)/(C_2 + T - T_r), with the reduced time A t: the same with 1/a_T.

Sources: Abaqus Keywords Reference Guide, *TRS; Ansys Mechanical APDL Material Reference, "Shift Functions".
"""

from matcal.laws.histories.time_temperature import GAS_J_PER_MOL_K, Shift, Wlf
from matcal.record.exporters.formatting import number

_ZERO_C = 273.15


def abaqus(shift: Shift) -> tuple[str, ...]:
    """*TRS with temperatures in degrees Celsius."""
    at = number(shift.reference_K - _ZERO_C)
    if isinstance(shift, Wlf):
        return "*TRS, DEFINITION=WLF", f"{at}, {number(shift.C1)}, {number(shift.C2_K)}"
    return ("** Arrhenius: give *PHYSICAL CONSTANTS, ABSOLUTE ZERO=-273.15, UNIVERSAL GAS="
            f"{number(GAS_J_PER_MOL_K)} for an activation energy in J/mol",
            "*TRS, DEFINITION=ARRHENIUS", f"{number(shift.activation_J_per_mol)}, {at}")


def ansys(shift: Shift) -> tuple[str, ...]:
    """TB,SHIFT with temperatures in degrees Celsius; a WLF shift, or nothing."""
    if not isinstance(shift, Wlf):
        return ()
    values = ",".join(map(number, (shift.reference_K - _ZERO_C, shift.C1, shift.C2_K)))
    return "TB,SHIFT,1,1,3,WLF", f"TBDATA,1,{values}"
