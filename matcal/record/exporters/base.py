"""The seam of every exporter: what a target gets (`Material`), what it gives (`Written`), and its name (`Target`)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from matcal.laws.histories.damage import Damage
from matcal.laws.histories.time_temperature import Shift
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.arrays import Array


@dataclass(frozen=True)
class Units:
    """A consistent system of units: multiply an SI value by the factor to write it in the system."""

    name: str  # name on the command line
    words: str  # the units in words, for the comment
    stress: float  # of stress, 1/Pa
    stress_name: str  # and its name
    time: float  # of time, 1/s
    density: float  # of mass density, m3/kg


UNITS = {u.name: u for u in (
    Units("SI", "SI: m, kg, s, N; stress in Pa, density in kg/m3", 1.0, "Pa", 1.0, 1.0),
    Units("mm-t-s", "mm, tonne, s, N; stress in MPa, density in tonne/mm3", 1e-6, "MPa", 1.0, 1e-12),
    Units("mm-kg-ms", "mm, kg, ms, kN; stress in GPa, density in kg/mm3", 1e-9, "GPa", 1e3, 1e-9),
)}


@dataclass(frozen=True)
class Material:
    """What a target gets: a law, what relaxes it, and the units to write."""

    name: str  # name of the card, as it stands there
    law: Law  # the law with the moduli as asked for, Pa
    prony: Prony | None  # relaxation, times in s; None where the card has none
    units: Units
    density_kg_per_m3: float | None = None  # mass density at rest, kg/m3; None where it was not given
    moduli_asked: bool = False  # whether `law.moduli` was asked for, or is only what the card holds

    @property
    def foam(self) -> Hyperfoam:
        """The law of a target that writes hyperfoam alone."""
        assert isinstance(self.law, Hyperfoam)
        return self.law

    @property
    def mu(self) -> Array:
        """(N,) shear moduli of a hyperfoam in the units of stress."""
        return self.foam.mu_Pa * self.units.stress

    @property
    def tau(self) -> Array:
        """(M,) relaxation times in the units of time; empty without relaxation."""
        return self.prony.tau_s * self.units.time if self.prony else np.zeros(0)

    @property
    def density(self) -> float | None:
        """Mass density in the units of density."""
        return None if self.density_kg_per_m3 is None else self.density_kg_per_m3 * self.units.density


@dataclass(frozen=True)
class Written:
    """What a target gives."""

    lines: tuple[str, ...]  # lines of input, without the comment
    notes: tuple[str, ...]  # sentences for the comment: layout, meaning of the moduli
    # sentences for the comment and for standard error: what the target does otherwise than the card
    warnings: tuple[str, ...] = ()
    shifts: bool = False  # whether the lines relax, so that a shift of times with temperature may follow them


@dataclass(frozen=True)
class Target:
    """A finite-element program."""

    title: str  # its name in words
    write: Callable[[Material], Written]  # writes a material; ValueError where the target's law cannot be the card's
    # joins the sentences of the comment and the lines of input into the text of a file
    assemble: Callable[[Sequence[str], Sequence[str]], str]
    laws: tuple[str, ...] = ("hyperfoam",)  # names of the laws that `write` can write
    # law that `write` cannot write -> the target's own keyword of a law of this name, which is another one
    similar: Mapping[str, str] = field(default_factory=dict)
    # lines of the shift of relaxation times with temperature, none where the program has no such law; None: it has none
    shift: Callable[[Shift], tuple[str, ...]] | None = None
    # lines of the softening by earlier loading, its m in the units of stress; None where the program has no such law
    softening: Callable[[Damage, float], tuple[str, ...]] | None = None


def refuse_more_terms(material: Material, most: int, title: str) -> None:
    """ValueError where the law has more terms than the target takes."""
    n = material.foam.mu_Pa.size
    if n > most:
        raise ValueError(f"{title} takes at most {most} hyperfoam terms, the card has {n}. "
                         f"Fit it again with `matcal fit --order {most}`.")


def moduli_note(material: Material) -> str:
    """The sentence that says which moduli were written."""
    return (f"Moduli: {MEANING[material.law.moduli]}, mu_0 = {material.law.mu_0_Pa * material.units.stress:.8g} "
            f"{material.units.stress_name}")


def elastic_warning(material: Material, reason: str) -> tuple[str, ...]:
    """The warning that the card's relaxation was left out; empty where the card has none."""
    if material.prony is None:
        return ()
    return (f"The Prony series is not exported: {reason}. The material is elastic; its moduli are "
            f"{MEANING[material.law.moduli]}.",)


MEANING = {"instantaneous": "instantaneous (before relaxation)", "longterm": "long-term (after relaxation)"}
