"""The touches of a scene, each solved as finely as the scene asks, alone, together with a neighbour, or held.

Where load paths are reused, touches that these do not serve are kept as well, by content: the skin's law, its
electrodes and whether the punch conducts are no part of their mechanics, so that another skin takes them as they are.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from typing import Any

from numpy.typing import NDArray

from eitsim.mechanics.axisymmetric.continuation import BOTTOM
from eitsim.mechanics.axisymmetric.hold import kept, solve_hold
from eitsim.mechanics.axisymmetric.solve_axisymmetric import Unresolved, solve_touch
from eitsim.mechanics.rim.solve_near_rim import COARSE, FINE, rim_problem, solve_near_rim
from eitsim.mechanics.rim.two_punches import FINEST, solved_together
from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.results import Touch, of_strain
from eitsim.scene.scene import Body, Punch, Scene
from eitsim.simulation.edge_effects import near_rim, several_edges
from eitsim.simulation.plan import near_edges
from matcal.laws.law import Law, values_of
from matcal.laws.prony import Prony
from touchcal import cache
from touchcal.array_store import from_arrays, to_arrays
from touchcal.code_version import MECHANICS
from touchcal.jit import cpu_s

MECHANICS_SHARE = 0.8  # Part of the requested signal error that the mechanics may use up.
_MOST_NODES = 6000  # Nodes of a mesh that may still be halved: four times as many took 430 MB for 5700.
_ELECTRIC = ("conductor", "contact_impedance_Ohm_m2")  # Fields of a punch that change no touch.
# law, body, punch -> its touch
Solve = Callable[[Law, Body, Punch], Touch]


def solved_touches(law: Law, scene: Scene, stored: Sequence[Touch | None], groups: Sequence[tuple[int, ...]],
                   exact: bool, *, keep: bool = False) -> tuple[Touch, ...]:
    """All touches, each alone, and what those of a group, solved together, change of each other; `keep` keeps those
    that are solved alone and takes those that were."""
    paired = [any(i in group for group in groups) for i in range(len(scene.punches))]
    # those of a group start from the axisymmetric touch, without what edges change, which a stored one may have
    touches = [found if found is not None and not (pair and found.rim is not None) else _touch(
        law, scene, punch, exact, paired=pair, keep=keep)
               for punch, found, pair in zip(scene.punches, stored, paired, strict=True)]
    for i, j in groups:
        touches[i], touches[j] = solved_together(
            (touches[i], touches[j]), law, scene.body, (scene.punches[i], scene.punches[j]),
            coarse=FINE if exact else COARSE, fine=FINEST if exact else FINE, edges=near_edges(scene, (i, j)))
    return tuple(touches)


def _touch(law: Law, scene: Scene, punch: Punch, exact: bool, *, paired: bool = False,
           keep: bool = False) -> Touch:
    """A touch on the default mesh, and on one of half its element size where that misses the requested error or is not
    exact; where no neighbour is solved together with it, in three dimensions near the rim and, where that is built, to
    be exact."""
    whole = exact and not scene.body.has_outline and not rim_problem(scene.body, punch)
    if not paired and (near_rim(scene, punch) or whole):
        several = several_edges(scene, punch)
        return _kept("near several edges" if several else "near the rim",
                     partial(solve_near_rim, whole=exact, all_edges=several), law, scene.body, punch, keep)[0]
    if not exact:
        with suppress(Unresolved):  # where the default mesh is too coarse to show the foam at the punch's edge or tip
            touch, nodes = _kept("default mesh", solve_touch, law, scene.body, punch, keep)
            if fine_enough([touch], scene) or not _refinable(nodes, punch):
                return touch
    finer = partial(solve_touch, element_m=default_element_m(scene.body, punch) / 2)
    return _kept("finer mesh", finer, law, scene.body, punch, keep)[0]


def _kept(how: str, solve: Solve, law: Law, body: Body, punch: Punch, keep: bool) -> tuple[Touch, int]:
    """A touch solved this way and the nodes of its section; where it is to be kept the one that was before, with the
    CPU time that it took now and without displacements inside the foam. Where the cache cannot be used, the table
    of load paths that is kept there has said so."""
    if not keep:
        touch = solve(law, body, punch)
        return touch, _nodes(touch)
    begun = cpu_s()
    key = {"touch": how, "law": [law.name, *values_of(law)], "body": asdict(body),
           "punch": {name: value for name, value in asdict(punch).items() if name not in _ELECTRIC}}
    arrays, _ = cache.kept(cache.key_of(key, MECHANICS), lambda: _bare(solve(law, body, punch)))
    touch, nodes = from_arrays(arrays)
    return replace(touch, cpu_s=cpu_s() - begun), nodes


def _bare(touch: Touch) -> dict[str, NDArray[Any]]:
    return to_arrays((replace(touch, section=None, volume=None), _nodes(touch)))


def _nodes(touch: Touch) -> int:
    return 0 if touch.section is None else len(touch.section.nodes_m)


def _refinable(nodes: int, punch: Punch) -> bool:
    """Whether half the element size is in reach: of the memory, and not at the end of a load path with friction, which
    may have to be loaded again from rest on the finer mesh at fifty times the cost."""
    return nodes <= _MOST_NODES and punch.friction == "none"


def held_touch(law: Law, series: Prony, scene: Scene, punch: Punch, exact: bool) -> list[tuple[float, Touch]]:
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
