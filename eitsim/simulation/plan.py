"""What a scene needs, decided before anything is solved, with the reason and the error each decision may cost."""

from eitsim.scene.results import Plan
from eitsim.scene.scene import Scene
from eitsim.simulation import words
from eitsim.simulation.assumptions import choices
from eitsim.simulation.choose import Chosen, choose
from eitsim.simulation.material import Material, material_of
from matcal.card import MaterialCard


def make_plan(scene: Scene, card: MaterialCard | Material, *, exact: bool = False, bodies: bool = True) -> Plan:
    """The plan of a scene with a card or its material; what cannot be solved is a refusal in it, never an exception.

    exact: turn off every omission that can be, and say of the others that they stay; bodies: as of `Case`.
    """
    return plan_of(choose(scene, material_of(scene, card), exact=exact, bodies=bodies))


def plan_of(chosen: Chosen) -> Plan:
    """What was chosen as a plan, in words."""
    made = tuple(choices(chosen))
    return Plan(tuple(map(words.decision, made)), "" if chosen.why is None else words.refusal(chosen.why))
