"""Forces of several presses on one layer, about one law, thickness and friction, as a function of all that is open.

ln F is that of a path without friction at the same depth over thickness, plus terms linear in the law's features and in
ln thickness, plus what friction changes, between solved paths and as far as these go; the true depth is the read one
plus the error of the contact point less compliance times force. Unknowns y are the law's parameters (p,), then
NUISANCES, then for each press EACH; all but the law's in units of their prior's standard deviation or, of friction, as
they are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.interpolate import PchipInterpolator

from eitsim.mechanics.axisymmetric.press_path import PressPath, press_path
from eitsim.presses.law_features import LawPrior, by_features, features
from eitsim.presses.press_file import Press
from eitsim.scene.scene import Body
from matcal.laws.law import Law
from matcal.laws.volumetric import nearly_incompressible
from touchcal.arrays import Array
from touchcal.errors import NotConverged

NUISANCES, EACH = ("thickness", "friction", "compliance", "load_cell"), ("contact",)
# Friction of paths that are solved, each with those that are tried in its place where it has none.
_FRICTIONS = ((0.2, 0.25, 0.15), (0.6, 0.7, 0.5))
_THICKER = 0.03  # step of ln thickness
_REACH, _SPARE_M = 1.05, 1e-4  # how much deeper than the deepest point paths go
_LEAST_M = 1e-9  # depth that stands for none


@dataclass(frozen=True)
class PressSetup:
    """The layer and the machine, with what is not known of them."""

    thickness_m: float  # of the layer
    thickness_error: float = 0.03  # largest relative error of it
    friction: tuple[float, float] = (0.0, 1.0)  # least and largest shear over pressure
    contact_m: float = 1e-4  # largest error of the depth at which a press first touches
    force_error: float = 0.005  # standard deviation of the load cell's gain, and least of a reading's noise
    compliance_m_per_N: float = 2e-6  # about the machine's: standard deviation, positive

    @property
    def sd(self) -> Array:
        """(4,) of NUISANCES; of friction its range."""
        return np.array([self.thickness_error / 3**0.5, self.friction[1] - self.friction[0], self.compliance_m_per_N,
                         self.force_error])

    @property
    def each_sd(self) -> Array:
        """(1,) of EACH."""
        return np.array([self.contact_m / 3**0.5])

    def body(self, ln_thicker: float) -> Body:
        return Body(thickness_m=self.thickness_m * float(np.exp(ln_thicker)))


@dataclass(frozen=True, eq=False)
class NearPress:
    """One press about a law, a thickness and a friction; n points."""

    press: Press
    path: PressPath
    slope: Array  # (nodes, q) derivatives of ln force by features at equal depth, at the path's depths
    by_thickness: Array  # (n,) that by ln thickness at equal depth over thickness, in which less is curved
    friction: tuple[float, ...]  # at which paths were solved, 0 first; 0 alone: not yet
    by_friction: Array  # (f, n) what they add to ln force

    def by_features(self, log_depth: Array, moved: Array) -> Array:
        """(D, n) what features moved by (D, q) add at (D, n), linear between the path's depths."""
        nodes = self.path.log_depth
        at = np.clip(log_depth, nodes[0], nodes[-1])
        left = np.clip(np.searchsorted(nodes, at) - 1, 0, len(nodes) - 2)
        share = (at - nodes[left]) / np.diff(nodes)[left]
        ends = moved @ self.slope.T
        row = np.arange(len(moved))[:, None]
        return (1 - share) * ends[row, left] + share * ends[row, left + 1]

    def rubbed(self, friction: Array) -> Array:
        """(D, n) what friction (D,) adds; above the last one solved no more."""
        if len(self.friction) == 1:
            return np.zeros((len(friction), len(self.by_thickness)))
        at = np.clip(friction, self.friction[0], self.friction[-1])
        return np.asarray(PchipInterpolator(self.friction, self.by_friction)(at))


@dataclass(frozen=True, eq=False)
class NearModel:
    """All presses about one y."""

    setup: PressSetup
    prior: LawPrior
    near: tuple[NearPress, ...]
    features: Array  # (q,)
    ln_thicker: float

    @property
    def terms(self) -> int:
        """How many of y are the law's."""
        return len(self.prior.free)

    def log_forces(self, y: Array) -> list[Array]:
        """(D, n) ln force of each press at (D, size) unknowns; not finite where the law has no such stress."""
        p, sd = self.terms, self.setup.sd
        moved = features(self.prior.law, self.prior.vectors(y[:, :p])) - self.features
        thicker = sd[0] * y[:, p] - self.ln_thicker
        out = []
        for k, one in enumerate(self.near):
            depth = one.press.depth_m + self.setup.each_sd[0] * y[:, p + 4 + k, None]
            depth = depth - sd[2] * y[:, p + 2, None] * one.press.force_N
            at = np.log(np.maximum(depth, _LEAST_M)) - thicker[:, None]
            found = one.path.at(at) + one.by_features(at, moved)
            found += thicker[:, None] * one.by_thickness + sd[3] * y[:, p + 3, None]
            out.append(found + one.rubbed(y[:, p + 1]))
        return out


def near_model(setup: PressSetup, prior: LawPrior, presses: Sequence[Press], y: Array, before: "NearModel | None", *,
               whole: bool) -> NearModel:
    """The model about y; with `whole` what friction and thickness change too, else as `before`. NotConverged where the
    law does not carry a press."""
    p = len(prior.free)
    ln_thicker = float(setup.sd[0] * y[p])
    law = nearly_incompressible(prior.laws(y[:p]))
    near = [_near(setup, prior, law, press, y[:p], ln_thicker, None if before is None else before.near[k], whole=whole)
            for k, press in enumerate(presses)]
    found = features(prior.law, prior.vectors(y[None, :p]))[0]
    return NearModel(setup, prior, tuple(near), found, ln_thicker)


def _near(setup: PressSetup, prior: LawPrior, law: Law, press: Press, white: Array, ln_thicker: float,
          before: NearPress | None, *, whole: bool) -> NearPress:
    deepest = _REACH * press.depth_m[-1] + _SPARE_M
    at = np.log(np.maximum(press.depth_m, _SPARE_M))

    def solved(ln_more: float, friction: float) -> PressPath:
        return press_path(law, setup.body(ln_thicker + ln_more), press.punch, friction, deepest)

    path = solved(0.0, 0.0)
    found = NearPress(press, path, by_features(prior, white, path.by_law), np.zeros(len(at)), (0.0,),
                      np.zeros((1, len(at))))
    if not whole:
        return found if before is None else replace(
            found, by_thickness=before.by_thickness, friction=before.friction, by_friction=before.by_friction)
    thicker = (solved(_THICKER, 0.0).at(at + _THICKER) - path.at(at)) / _THICKER
    rubbed = [one for tried in _FRICTIONS if (one := _rubbed(path, at, tried, partial(solved, 0.0))) is not None]
    if not rubbed:
        raise NotConverged(f"{press.name}: no equilibrium with friction was found.", estimate=white)
    return replace(found, by_thickness=thicker, friction=(0.0, *(friction for friction, _ in rubbed)),
                   by_friction=np.vstack([np.zeros(len(at)), *(more for _, more in rubbed)]))


def _rubbed(path: PressPath, at: Array, tried: Sequence[float], solved: Callable[[float], PressPath]
            ) -> tuple[float, Array] | None:
    """Friction, and (n,) what it adds to ln force, as far as its path goes; None where there is none."""
    for friction in tried:
        try:
            other = solved(friction)
        except NotConverged:
            continue
        return friction, np.interp(at, other.log_depth, other.log_force - path.at(other.log_depth))
    return None
