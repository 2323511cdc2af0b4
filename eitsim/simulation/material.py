"""A card's laws as one scene takes them, resolved once."""

from dataclasses import dataclass

from eitsim.scene.scene import Scene
from matcal.card import MaterialCard, require, with_moduli
from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony


@dataclass(frozen=True)
class Material:
    """The foam and the skin of a scene."""

    card: MaterialCard  # the card they are from
    # the foam's law: with the moduli that the scene asks for, or instantaneous ones where there is a hold
    law: Hyperfoam

    @property
    def series(self) -> Prony:
        """How the foam relaxes; ValueError where the card lacks it."""
        return require(self.card, "prony", "a hold")

    @property
    def skin(self) -> Conductivity:
        """The skin's law; ValueError where the card lacks it."""
        return require(self.card, "conductivity", "the skin")


def material_of(scene: Scene, card: MaterialCard | Material) -> Material:
    """The material of a scene; one that is resolved already is given back.

    ValueError where the card lacks the foam's law, or a Prony series that is needed.
    """
    if isinstance(card, Material):
        return card
    if not scene.hold.time_s:
        return Material(card, with_moduli(card, scene.hold.moduli))
    require(card, "prony", "a hold (time_s in [hold])")
    return Material(card, with_moduli(card, "instantaneous"))
