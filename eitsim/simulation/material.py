"""A card's laws as one scene takes them, resolved once."""

from dataclasses import dataclass, replace

from eitsim.mechanics.solid.bonded_laws import Bonded
from eitsim.scene.scene import Scene
from matcal.card import MaterialCard, read_card, require, with_moduli
from matcal.laws.conductivity import Conductivity
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from matcal.laws.volumetric import nearly_incompressible


@dataclass(frozen=True)
class Material:
    """The foam and the skin of a scene."""

    card: MaterialCard  # the card they are from
    # the foam's law with the moduli that the scene asks for, or instantaneous ones where there is a hold; its bulk
    # modulus is finite
    law: Law
    c0_S_per_m: float | None = None  # conductivity of the untouched skin by a calibrated sensor; None: the card's
    base: Law | None = None  # law of the soft base under the layer, as `law`; None without one

    @property
    def solid(self) -> Law:
        """What is pressed: the foam's law, or the laws of a layer and its base."""
        return self.law if self.base is None else Bonded(self.law, self.base)

    @property
    def stiffer(self) -> float:
        """mu_0 of the layer over that of its base; 1 without one."""
        return 1.0 if self.base is None else self.law.mu_0_Pa / self.base.mu_0_Pa

    @property
    def series(self) -> Prony:
        """How the foam relaxes; ValueError where the card lacks it."""
        return require(self.card, "prony", "a hold")

    @property
    def skin(self) -> Conductivity:
        """The skin's law; ValueError where the card lacks it."""
        law = require(self.card, "conductivity", "the skin")
        return law if self.c0_S_per_m is None else replace(law, c0_S_per_m=self.c0_S_per_m)


def material_of(scene: Scene, card: MaterialCard | Material) -> Material:
    """The material of a scene; one that is resolved already is given back.

    ValueError where the card lacks the foam's law, or a Prony series that is needed.
    """
    if isinstance(card, Material):
        return card
    calibrated = scene.channels.conductance_S
    c0 = calibrated[0] / scene.skin.thickness_m if calibrated else None
    if not scene.hold.time_s:
        base = _base_law(scene) if scene.skin.base_m else None
        return Material(card, nearly_incompressible(with_moduli(card, scene.hold.moduli)), c0,
                        None if base is None else nearly_incompressible(base))
    require(card, "prony", "a hold (time_s in [hold])")
    return Material(card, nearly_incompressible(with_moduli(card, "instantaneous")), c0)


def _base_law(scene: Scene) -> Law:
    """The law of the soft base's card; ValueError, naming the key, where the card lacks it."""
    card = read_card(scene.skin.base_card)
    try:
        return with_moduli(card, scene.hold.moduli)
    except ValueError as error:
        raise ValueError(f"base_card in [skin]: {error}") from None
