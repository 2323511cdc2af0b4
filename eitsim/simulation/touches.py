"""The touches of a scene, each solved as finely as the scene asks, alone, together with a neighbour, or held."""

from collections.abc import Sequence
from contextlib import suppress

from eitsim.mechanics.axisymmetric.continuation import BOTTOM
from eitsim.mechanics.axisymmetric.hold import kept, solve_hold
from eitsim.mechanics.axisymmetric.solve_axisymmetric import Unresolved, solve_touch
from eitsim.mechanics.rim.solve_near_rim import COARSE, FINE, rim_problem, solve_near_rim
from eitsim.mechanics.rim.two_punches import FINEST, solved_together
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import Touch, of_strain
from eitsim.scene.scene import Punch, Scene
from eitsim.simulation.plan import near_rim
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony

MECHANICS_SHARE = 0.8  # Part of the requested signal error that the mechanics may use up.
_MOST_NODES = 6000  # Nodes of a mesh that may still be halved: four times as many took 430 MB for 5700.


def solved_touches(law: Hyperfoam, scene: Scene, stored: Sequence[Touch | None], groups: Sequence[tuple[int, ...]],
                   exact: bool) -> tuple[Touch, ...]:
    """All touches, each alone, and what those of a group, solved together, change of each other."""
    touches = [kept or _touch(law, scene, punch, exact, paired=any(i in group for group in groups))
               for i, (punch, kept) in enumerate(zip(scene.punches, stored, strict=True))]
    for i, j in groups:
        touches[i], touches[j] = solved_together(
            (touches[i], touches[j]), law, scene.body, (scene.punches[i], scene.punches[j]),
            coarse=FINE if exact else COARSE, fine=FINEST if exact else FINE)
    return tuple(touches)


def _touch(law: Hyperfoam, scene: Scene, punch: Punch, exact: bool, *, paired: bool = False) -> Touch:
    """A touch on the default mesh, and on one of half its element size where that misses the requested error or is not
    exact; in three dimensions near the rim and, where that is built and no neighbour is solved together with it, to be
    exact."""
    if near_rim(scene, punch) or (exact and not paired and not rim_problem(scene.body, punch)):
        return solve_near_rim(law, scene.body, punch, whole=exact)
    if not exact:
        with suppress(Unresolved):  # where the default mesh is too coarse to show the foam at the punch's edge or tip
            touch = solve_touch(law, scene.body, punch)
            if fine_enough([touch], scene) or not _refinable(touch, punch):
                return touch
    return solve_touch(law, scene.body, punch, element_m=default_element_m(scene.body, punch) / 2)


def _refinable(touch: Touch, punch: Punch) -> bool:
    """Whether half the element size is in reach: of the memory, and not at the end of a load path with friction, which
    may have to be loaded again from rest on the finer mesh at fifty times the cost."""
    within_memory = touch.section is None or len(touch.section.nodes_m) <= _MOST_NODES
    return within_memory and punch.friction == "none"


def held_touch(law: Hyperfoam, series: Prony, scene: Scene, punch: Punch, exact: bool) -> list[tuple[float, Touch]]:
    """A held touch as `_touch`, fine enough at the times that the scene asks for."""
    if scene.hold.keeps_deformation:
        return kept(series, scene.hold, _touch(law, scene, punch, exact))
    if not exact:
        held = solve_hold(law, series, scene.body, punch, scene.hold)
        if fine_enough([touch for _, touch in held[1:]], scene):
            return held
    return solve_hold(law, series, scene.body, punch, scene.hold, element_m=default_element_m(scene.body, punch) / 2)


def fine_enough(touches: list[Touch], scene: Scene) -> bool:
    return all(of_strain(touch.signal_errors, scene.skin.strain) <= MECHANICS_SHARE * scene.accuracy.signal
               or touch.depth_m > BOTTOM * scene.body.thickness_m for touch in touches)
