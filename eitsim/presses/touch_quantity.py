"""How deep a touch goes, as the number that a further test is to narrow: `matcal next --for touch:SCENE`.

About one path of a law, ln depth under a force changes by -g dp/q, with g what the law's parameters p change of ln
force at equal depth and q = d ln force/d ln depth. Draws of a posterior differ too much for that: theirs are -h df/q,
with f the logarithms of stresses in simple modes, in which ln force is nearly linear, at strains where every draw has
one. The touch is taken far from the edges and without friction: of what a law changes of a depth, both are a small
part. A law of the next order under which the touch finds no equilibrium is none, for the touch does; it counts as no
other depth.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from eitsim.mechanics.axisymmetric.press_path import PressPath, press_path
from eitsim.presses.law_features import by_features, features_of, law_prior
from eitsim.scene.scene import Scene, read_scene
from matcal.card import MaterialCard, with_moduli
from matcal.laws.law import Law
from matcal.laws.volumetric import nearly_incompressible
from matcal.posterior.drawn_laws import law_of
from matcal.posterior.draws import Draws
from matcal.record.next_test.open_laws import Predicted, open_laws
from touchcal.arrays import Array
from touchcal.errors import InputFileError, NotConverged

_DEEPEST = (0.1, 0.25, 0.5, 0.8)  # of paths that are tried, over the thickness


@dataclass(frozen=True, eq=False)
class _Pressed:
    """A touch at its force, under one law."""

    log_depth: float  # of m
    path: PressPath

    def at(self, columns: Array) -> Array:
        """(m,) of columns (n, m) at the path's depths."""
        return np.array([np.interp(self.log_depth, self.path.log_depth, column) for column in columns.T])

    def depth_mm(self, moved: Array, slope: Array) -> Array:
        """(D, 1) depths where ln force at equal depth has moved by moved (D, m) times slope (m,)."""
        power = float(self.at(self.path.power[:, None])[0])
        return 1e3 * np.exp(self.log_depth - moved @ slope / power)[:, None]


def touch_depth(path: str, card: MaterialCard) -> tuple[str, Predicted]:
    """The name with its unit, and the depths, mm, (D, 1) of the laws of D draws under the scene's force; InputFileError
    for a scene of several touches or of a given depth, with a base, a hold, friction or a punch that is not upright, or
    where the card's law does not carry the force."""
    scene = read_scene(path)
    punch, *more = scene.punches
    if more or punch.force_N is None:
        raise InputFileError(Path(path), "the depth under the force of one touch is narrowed, and the scene has "
                                         "several touches or a given depth. Give one [punch] with force_N.")
    for key, asked in (("base_card in [skin]", scene.skin.base_m), ("time_s in [hold]", scene.hold.time_s),
                       ("friction in [punch]", punch.friction != "none"),
                       ("tilt_deg or shape in [punch]", not punch.axisymmetric)):
        if asked:
            raise InputFileError(Path(path), f"{key}: the touch is taken on one material without friction, under an "
                                             "upright punch, just after it was loaded. Leave the key out here.")
    try:
        own = _pressed(scene, with_moduli(card, "longterm"))
    except NotConverged:
        raise InputFileError(Path(path), f"the card's law does not carry {punch.force_N:g} N on this punch. "
                                         "Give less force_N.") from None
    depth_mm = _of_posterior(own, card) if card.posterior else lambda draws: _about_first(own, scene, draws)
    return f"depth of {Path(path).name}, mm", depth_mm


def _about_first(own: _Pressed, scene: Scene, draws: Draws) -> Array:
    try:
        found = _pressed(scene, law_of(draws, 0))
    except NotConverged:
        return np.full((len(draws), 1), 1e3 * np.exp(own.log_depth))
    vectors = np.hstack([*draws.law.values()])
    return found.depth_mm(vectors - vectors[0], found.at(found.path.by_law))


def _of_posterior(own: _Pressed, card: MaterialCard) -> Predicted:
    prior, (drawn,) = law_prior(card), open_laws(card)
    middle = features_of(Draws({p.name: np.reshape(getattr(prior.law, p.name), (1, -1)) for p in prior.law.parameters},
                               type(prior.law)))
    kept = np.asarray(np.isfinite(np.vstack([middle, features_of(drawn.draws)])).all(axis=0), dtype=bool)
    slope = own.at(by_features(prior, np.zeros(len(prior.free)), own.path.by_law, kept))
    return lambda draws: own.depth_mm((features_of(draws) - middle)[:, kept], slope)


def _pressed(scene: Scene, law: Law) -> _Pressed:
    """The scene's first touch; NotConverged where the law does not carry its force."""
    punch, body = scene.punches[0], scene.body
    aim = float(np.log(punch.force_N or 0.0))
    for deepest in _DEEPEST:
        found = press_path(nearly_incompressible(law), body, punch, 0.0, deepest * body.thickness_m)
        if found.log_force[-1] >= aim:
            return _Pressed(_root(found, aim), found)
    raise NotConverged(f"{punch.force_N} N press further than {_DEEPEST[-1]} of the thickness", estimate=None)


def _root(path: PressPath, log_force: float) -> float:
    ends = path.log_depth[0] - 20.0, path.log_depth[-1]
    return float(brentq(lambda x: float(path.at(np.array(x))) - log_force, *ends))  # pyright: ignore[reportArgumentType]
