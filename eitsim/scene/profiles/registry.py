"""Profiles by the word that a scene file holds; a new one is its own file here and its line below."""

from eitsim.scene.profiles.ellipse import Ellipse
from eitsim.scene.profiles.profile import Profile
from eitsim.scene.profiles.rounded_cone import Cone, Flat, Sphere

PROFILES: dict[str, type[Profile]] = {
    "flat": Flat,
    "sphere": Sphere,
    "cone": Cone,
    "ellipse": Ellipse,
}
