"""What a scene on a curved body decides, assumes and leaves out, as choices in the order of a plan."""

from collections.abc import Iterator

import numpy as np

from eitsim.electrics.curved.solve_curved import READINGS
from eitsim.mechanics.curved.solve_on_surface import alone_on_balls
from eitsim.scene.choices import Kind
from eitsim.scene.curved.curved_scene import CurvedScene
from eitsim.scene.drive import protocol
from eitsim.scene.results import Plan
from eitsim.simulation import words
from eitsim.simulation.assumptions import STEEL_E_PA, hold_choices, moduli_choice
from eitsim.simulation.choose import curved_problem
from eitsim.simulation.material import Material
from eitsim.simulation.routes.general import cost_s
from eitsim.simulation.routes.on_surface import ON_SURFACE
from eitsim.simulation.validity import positive_from
from touchcal.choice import Choice

# CPU time of a usual touch that is alone on a ball, s, and of any other over that of one on a flat layer.
_BALL_S, _OVER_FLAT = 2.0, 4 / 3


def curved_plan(scene: CurvedScene, material: Material) -> Plan:
    """The plan of a scene on a curved body."""
    why = curved_problem(scene, material)
    return Plan(tuple(map(words.decision, _choices(scene, material))), "" if why is None else words.refusal(why))


def _choices(scene: CurvedScene, material: Material) -> Iterator[Choice]:
    law, card, count = material.law, material.card, len(scene.punches)
    balls = alone_on_balls(scene.body.surface, scene.body.thickness_m, scene.punches, scene.places_m)
    cost = balls * _BALL_S + (count - balls) * _OVER_FLAT * cost_s(scene)
    inwards = -scene.body.surface.nearest(scene.places_m)[1]
    yield Choice(ON_SURFACE.kind, {"count": count, "thickness_m": scene.body.thickness_m, "cost_s": cost,
                                   "inwards": np.round(inwards, 2).tolist()})
    yield Choice(Kind.FROM_REST)
    yield Choice(Kind.INSULATED)
    yield from hold_choices(scene.hold, law, elastic=not scene.hold.keeps_deformation) if (
        scene.hold.time_s) else (moduli_choice(scene.hold, law, card.prony),)
    yield Choice(Kind.OUTSIDE_FITS, cost=None)
    if card.conductivity is not None and (least := positive_from(card.conductivity)) is not None:
        yield Choice(Kind.POSITIVE_IN_PART, {"strain": least})
    yield Choice(Kind.STRAIN, {"strain": scene.skin.strain, "conducts": False}, None)
    yield Choice(Kind.ONE_CARD, cost=None)
    rubs = any(punch.friction != "none" for punch in scene.punches)
    yield Choice(Kind.FRICTION, {"near": True}) if rubs else Choice(Kind.NO_FRICTION, cost=None)
    yield Choice(Kind.FIXED_CHOICES, cost=None)
    yield Choice(Kind.RIGID_PUNCH, {"ratio": STEEL_E_PA / law.E_0_Pa}, law.E_0_Pa / STEEL_E_PA)
    yield Choice(Kind.YIELDING_ELECTRODES, cost=None)
    yield Choice(Kind.NO_LOAD_IN_SKIN, cost=None)
    over_fillet = scene.skin.thickness_m / min(p.fillet_m for p in scene.punches)
    yield Choice(Kind.SHEET, {"over_fillet": over_fillet}, over_fillet**2)
    yield Choice(Kind.MESH, {"outline": True})
    yield Choice(Kind.UNTOUCHED_TRIANGLES, {"readings": READINGS})
    yield Choice(Kind.PATCH_AREA, cost=None)
    yield Choice(Kind.ONE_MATRIX, {"patterns": protocol(scene.drive, scene.sheet(1.0).count).shape[0]})
