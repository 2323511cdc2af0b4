"""Touches that are kept by content, so that another skin takes them as they are.

The skin's law, its electrodes and how well the punch conducts are no part of a touch's mechanics; whether it does
sets the mesh.
"""

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

from numpy.typing import NDArray

from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch
from matcal.laws.law import Law, values_of
from touchcal import cache
from touchcal.array_store import from_arrays, to_arrays
from touchcal.code_version import MECHANICS
from touchcal.jit import cpu_s

_ELECTRIC = ("contact_impedance_Ohm_m2",)  # Fields of a punch that change no touch.
# law, body, punch -> its touch
Solve = Callable[[Law, Body, Punch], Touch]


def kept_touch(how: str, solve: Solve, law: Law, body: Body, punch: Punch) -> tuple[Touch, int]:
    """A touch that was kept, or solved this way and kept, and the nodes of its section, with the CPU time that it took
    now and without displacements inside the foam. Where the cache cannot be used, the table of load paths that is kept
    there has said so."""
    begun = cpu_s()
    key = {"touch": how, "law": [law.name, *values_of(law)], "body": asdict(body),
           "punch": {name: value for name, value in asdict(punch).items() if name not in _ELECTRIC}}
    arrays, _ = cache.kept(cache.key_of(key, MECHANICS), lambda: _bare(solve(law, body, punch)))
    touch, nodes = from_arrays(arrays)
    return replace(touch, cpu_s=cpu_s() - begun), nodes


def _bare(touch: Touch) -> dict[str, NDArray[Any]]:
    return to_arrays((replace(touch, section=None, volume=None), with_nodes(touch)[1]))


def with_nodes(touch: Touch) -> tuple[Touch, int]:
    """A touch and the nodes of its section."""
    return touch, 0 if touch.section is None else len(touch.section.nodes_m)
