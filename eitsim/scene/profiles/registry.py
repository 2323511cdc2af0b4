"""Profiles by the word that a scene file holds; a new one is its own file here and its line below, or an entry point
`touchcal.profiles` of an installed package."""

from eitsim.scene.profiles.ellipse import Ellipse
from eitsim.scene.profiles.profile import Profile
from eitsim.scene.profiles.rounded_cone import Cone, Flat, Sphere
from touchcal.entry_points import added

_BUILT_IN: dict[str, type[Profile]] = {
    "flat": Flat,
    "sphere": Sphere,
    "cone": Cone,
    "ellipse": Ellipse,
}


def profiles() -> dict[str, type[Profile]]:
    """Word -> profile, the built-in ones first."""
    return {**_BUILT_IN, **added("profiles")}
