"""The first touches of a design again by punches of every other profile: what a signal leaves open of the force, where
nobody says which profile pressed."""

from collections.abc import Mapping
from dataclasses import replace

from eitsim.scene.curved.curved_scene import is_curved
from eitsim.scene.profiles.registry import profiles
from eitsim.sweeps.design.design import Design, valid_scenes, with_scenes

# Scenes from which other profiles are solved too, and touches of each: enough to know their forces at the same signals
# within some per cent (benchmarks/silent_answers.py), and 20 CPU seconds of three profiles.
ENOUGH, TOUCHES = 100, 16


def other_profiles(design: Design) -> Design | None:
    """The design of these touches, each profile in turn; None of few scenes, or where a design does not draw, by chance
    and one at a time, touches of one profile."""
    punch = design.tables.get("punch", {})
    if (design.scenes < ENOUGH or design.sampler != "random" or design.source is not None or design.touches is not None
            or is_curved(design.tables) or not isinstance(punch, Mapping)
            or not isinstance(punch.get("profile", "flat"), str) or punch.get("shape")):
        return None
    others = [name for name in profiles() if name != punch.get("profile", "flat")]
    tables = {**design.tables, "punch": {**punch, "profile": {"list": others}}}
    found = with_scenes(replace(design, tables=tables, measurement={}, fields=None), TOUCHES * len(others))
    return None if next(valid_scenes(found, found.scenes), None) is None else found
