"""The seam of every importer: what a deck says of one material (`DeckMaterial`), and its constants as laws.

Volume: U(J) = kappa/2 (J - 1)^2 with D = 2/kappa; D = 0 keeps the volume. A Prony series of the card relaxes the whole
stress. One of the shear modulus alone is the same where the bulk modulus is at least ten times as large, because free
faces then leave the volume nearly as it is.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from matcal.laws.histories.damage import Damage
from matcal.laws.histories.time_temperature import Shift
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.prony import Prony
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.mooney_rivlin_5 import MooneyRivlin5
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.record.exporters.base import Units

_STIFF = 10.0  # bulk over shear modulus from which on a series of the shear modulus alone is that of the stress
_ABSENT = 1e6  # D_i over D_1 from which on a term of the volume adds nothing
_SPLIT = "the volume's part there is kappa/2 ((J^2 - 1)/2 - ln J), the card's kappa/2 (J - 1)^2: equal to first order"


class DeckProblem(ValueError):
    """What a line of a deck says cannot be read, or is no law of the card."""

    def __init__(self, line: int | None, problem: str) -> None:
        self.line = line
        super().__init__(problem)


@dataclass(frozen=True)
class DeckMaterial:
    """One material of a deck, in SI."""

    law: Law
    prony: Prony | None = None
    shift: Shift | None = None
    softening: Damage | None = None
    notes: tuple[str, ...] = ()  # what was assumed, and what was left out


# name of a material -> what reads it in these units, for every material of a deck that has a law
Materials = Mapping[str, Callable[[Units], DeckMaterial]]


def real(text: str, line: int | None) -> float:
    """A number of a deck, Fortran's d for e too; 0 for an empty field."""
    try:
        return float(text.strip().lower().replace("d", "e")) if text.strip() else 0.0
    except ValueError:
        raise DeckProblem(line, f"'{text.strip()}' is no number. Write the number itself in its place.") from None


def made(line: int | None, kind: Callable[..., Law], *values: Any) -> Law:
    """A law of these values; DeckProblem where there is no such law."""
    try:
        return kind(*values)
    except ValueError as error:
        raise DeckProblem(line, str(error)) from None


def hyperfoam(line: int | None, mu_Pa: Sequence[float], alpha: Sequence[float], nu: Sequence[float]) -> Law:
    """A hyperfoam; equal terms, as programs that take no single one need them, become one."""
    if len(mu_Pa) > 1 and len({*zip(alpha, nu, strict=True)}) == 1:
        mu_Pa, alpha, nu = [sum(mu_Pa)], alpha[:1], nu[:1]
    if 0.0 in alpha:
        raise DeckProblem(line, "a term has the exponent 0. Leave it out.")
    return made(line, Hyperfoam, list(mu_Pa), list(alpha), list(nu))


def polynomial(line: int | None, c_Pa: Mapping[str, float]) -> Law:
    """The law that keeps its volume with c_ij of (I_1 - 3)^i (I_2 - 3)^j, named as in {"10": ...}."""
    used = {ij for ij, value in c_Pa.items() if value}
    forms: tuple[tuple[type[Any], tuple[str, ...]], ...] = (
        (MooneyRivlin, ("10", "01")), (Yeoh, ("10", "20", "30")), (MooneyRivlin5, ("10", "01", "20", "11", "02")))
    for kind, names in forms:
        if used <= set(names):
            return made(line, kind, *(c_Pa.get(ij, 0.0) for ij in names))
    raise DeckProblem(line, f"a polynomial with C_{', C_'.join(sorted(used))} is no law of the card, which has C_10, "
                            "C_01, C_20, C_11, C_02, or C_10, C_20, C_30. Fit one of its laws to the deck's curve.")


def with_volume(line: int | None, law: Law, d_per_Pa: Sequence[float]) -> Law:
    """The law with the bulk modulus 2/D_1; a Mooney-Rivlin law of C_10 alone that keeps its volume is neo-Hooke's."""
    if any(d and d < _ABSENT * d_per_Pa[0] for d in d_per_Pa[1:]):
        raise DeckProblem(line, "D_2, D_3, ... are terms of the volume that the card does not have. Set them to 0 "
                                "where the volume changes little.")
    if not d_per_Pa or d_per_Pa[0] == 0:
        if isinstance(law, MooneyRivlin) and law.c_01_Pa == 0:
            return NeoHooke(2 * law.c_10_Pa, 0.5, law.moduli)
        return law
    return with_bulk(line, law, 2 / d_per_Pa[0])


def with_bulk(line: int | None, law: Law, kappa_Pa: float) -> Law:
    """The law with a bulk modulus."""
    mu = law.mu_0_Pa
    return with_nu(line, law, (3 * kappa_Pa - 2 * mu) / (2 * (3 * kappa_Pa + mu)))


def with_nu(line: int | None, law: Law, nu: float) -> Law:
    """The law with an initial Poisson's ratio."""
    if not 0 <= nu <= 0.5:
        raise DeckProblem(line, f"Poisson's ratio is {nu:.4g}, and that of a rubber's law is from 0 to 0.5.")
    law = replace(law, nu=nu)
    return with_volume(line, law, ()) if law.incompressible else law


def volume_note(law: Law, keyword: str) -> tuple[str, ...]:
    """That the program's volume is not the card's, where the law does not keep it."""
    return () if law.incompressible else (f"{keyword}: {_SPLIT}.",)


def prony_of(line: int | None, law: Law, shear: Sequence[tuple[float, float]], bulk: Sequence[tuple[float, float]] = ()
             ) -> tuple[Prony | None, tuple[str, ...]]:
    """The series of (share, time in s) of the shear modulus where that of the bulk modulus is the same, or the volume
    nearly kept."""
    at: dict[float, list[float]] = {}
    for k, series in enumerate((shear, bulk)):
        for share, time in series:
            if share:
                at.setdefault(time, [0.0, 0.0])[k] += share
    if not at:
        return None, ()
    notes: tuple[str, ...] = ()
    if any(abs(g - k) > 1e-9 for g, k in at.values()):
        if not law.incompressible and law.kappa_0_Pa < _STIFF * law.mu_0_Pa:
            raise DeckProblem(line, "shear and bulk modulus relax by different shares, and the card relaxes the whole "
                                    "stress. Give both the same shares.")
        notes = ("Relaxation: the shares of the shear modulus count, those of the bulk modulus differ. The volume "
                 "changes so little that the difference shows only under pressure.",)
    try:
        times = sorted(at)
        return Prony(np.array([at[t][0] for t in times]), np.array(times)), notes
    except ValueError as error:
        raise DeckProblem(line, str(error)) from None


def kelvin(line: int | None, reference: float, zero: float | None) -> float:
    """A reference temperature in K; `zero`: absolute zero in the deck's degrees, None where it does not say."""
    if zero is None and reference > 200:
        raise DeckProblem(line, f"the reference temperature {reference:g} may be in C or in K. State absolute zero in "
                                "the deck (Abaqus: *PHYSICAL CONSTANTS, Ansys: TOFFST).")
    return reference - (-273.15 if zero is None else zero)
