"""What a scene and a card may ask of numbers: forces, depths and conductivities that rounding does not hide."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import root_scalar

from eitsim.mechanics.solid.grid import default_element_m
from eitsim.scene.choices import Why
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Punch, Scene, profile_of
from eitsim.sheet.sheet_conductance import driving_strain
from eitsim.simulation.material import Material
from matcal.laws.conduction_laws import conduction_law
from matcal.laws.conductivity import Conductivity, NotPositive, conductivity
from matcal.laws.law import Law
from touchcal.arrays import Array
from touchcal.choice import Choice

# Force over the foam's modulus times the square of the thickness or of the diameter, the larger, and depth over the
# thickness, below which a touch is lost in rounding; a hundredth of either was still solved (Table 1, 14 mm).
_LEAST_FORCE, _LEAST_DEPTH = 1e-8, 1e-8
# Conductivities, S/m, outside which only a slip of the unit can lie: silver has 6e7, pure water 6e-6.
_LEAST_S_PER_M, _LARGEST_S_PER_M = 1e-9, 1e12
# Most elements across by which the foam's default mesh may follow half a punch, and its widest there, thicknesses.
_MOST_ELEMENTS, _WIDEST = 2000, 0.08
_FLAT, _STEPS = -0.97, 195  # Strain that touches of a foam come near to: flat; strains from rest to it.
# Conductivity over that at rest that is nearly none; strain up to which laws are looked at, and how finely.
_NEARLY_NONE, _FAR, _FINELY = 1e-3, 20.0, 20_971


def unresolvable(scene: Scene, material: Material) -> Choice | None:
    """Why a touch or the card's conductivity is more than numbers resolve; None where none is."""
    problems = (_too_thin(scene.body, punch) or _too_light(scene.body, punch, material.law) for punch in scene.punches)
    return _conductivity_problem(material) or next((problem for problem in problems if problem), None)


def positive_from(law: Conductivity) -> float | None:
    """Strain at which c(e) first falls to 0 in compression; None where it stays positive."""
    def ratio(strain: ArrayLike) -> Array:
        return conduction_law(law.kind).ratio(law.a, np.asarray(strain))

    strain = np.linspace(0, _FLAT, _STEPS)
    below = np.flatnonzero(ratio(strain) <= 0)
    return root_scalar(ratio, bracket=(strain[below[0]], strain[below[0] - 1])).root if below.size else None


def positive_limits(law: Conductivity) -> tuple[float, float]:
    """Strains about 0 between which c(e) is at least a thousandth of c_0."""
    strain = np.linspace(_FLAT, _FAR, _FINELY)
    below = strain[~(conduction_law(law.kind).ratio(law.a, strain) >= _NEARLY_NONE)]
    return (float(below[below < 0].max(initial=-np.inf)), float(below[below > 0].min(initial=np.inf)))


def check_positive(law: Conductivity, strain: str, touches: Sequence[Touch]) -> None:
    """NotPositive where solved touches, by themselves, strain the skin to where its law is not positive; only their
    mechanics tells."""
    driving = np.concatenate([driving_strain(strain, touch.stretch_meridian, touch.stretch_hoop, touch.stretch_normal)
                              for touch in touches])
    conductivity(law, driving)


def strained_too_far(error: NotPositive) -> str:
    """Why a solved touch is refused whose skin's law is not positive, with what to change."""
    return ("the touch strains the skin further than its law goes, which its solved mechanics alone tells. Press less, "
            f"or fix the card: {error}")


def _conductivity_problem(material: Material) -> Choice | None:
    law = None if material.card.conductivity is None else material.skin
    if law is None or _LEAST_S_PER_M <= law.c0_S_per_m <= _LARGEST_S_PER_M:
        return None
    return Choice(Why.CONDUCTIVITY_UNIT, {"c0_S_per_m": law.c0_S_per_m, "card": material.card.name,
                                          "least": _LEAST_S_PER_M, "most": _LARGEST_S_PER_M})


def _too_thin(body: Body, punch: Punch) -> Choice | None:
    """Whether the foam is so thin under the punch that its mesh takes too long: counted before it is built."""
    profile = profile_of(punch)
    rounded, inner = profile.edge_radius, punch.diameter_m / 2 - profile.edge_radius
    count = rounded / default_element_m(body, replace(punch, fillet_m=rounded)) + inner / (_WIDEST * body.thickness_m)
    return None if count <= _MOST_ELEMENTS else Choice(Why.TOO_THIN, {
        "thickness_m": body.thickness_m, "diameter_m": punch.diameter_m, "count": count, "most": _MOST_ELEMENTS})


def _too_light(body: Body, punch: Punch, law: Law) -> Choice | None:
    if punch.depth_m is not None:
        least_m = _LEAST_DEPTH * body.thickness_m
        return None if punch.depth_m >= least_m else Choice(Why.TOO_SHALLOW, {
            "depth_m": punch.depth_m, "least_m": least_m})
    least_N = _LEAST_FORCE * law.mu_0_Pa * max(body.thickness_m, punch.diameter_m) ** 2
    return None if punch.force_N is None or punch.force_N >= least_N else Choice(Why.TOO_LIGHT, {
        "force_N": punch.force_N, "least_N": least_N})
