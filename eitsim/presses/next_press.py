"""Which punch to press next: how much each would narrow mu_0 and plateau, by what the presses so far leave open.

To first order draws q of a quantity and x of the forces that a press would read narrow to var q - cov(q, x)
(cov x + R)^-1 cov(x, q), with R what the reading adds: white and slow errors as of the presses so far, and a contact
point of its own.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric.press_path import press_path
from eitsim.presses.identify import Identified, relative_covariance
from eitsim.presses.law_features import by_features, features
from eitsim.scene.scene import Punch
from matcal.laws.volumetric import nearly_incompressible
from matcal.posterior.derived_quantities import derived_of
from touchcal.arrays import Array
from touchcal.errors import NotConverged

QUANTITIES = ("mu_0_Pa", "plateau_Pa")
_SIZES, _PROFILES, _POINTS = (0.5, 1.0, 2.0), ("flat", "sphere"), 20  # diameters over that pressed first
_RUBBED, _THICKER = 0.35, 0.03  # friction and ln thickness by which slopes are taken


@dataclass(frozen=True, eq=False)
class NextPress:
    """One press that was not made."""

    punch: Punch
    depth_m: float  # as deep as the deepest so far
    force_N: float  # about what it takes
    narrows: Mapping[str, float]  # quantity -> 1 - sd after/sd before


def next_presses(found: Identified) -> list[NextPress]:
    """Flat and round punches of half, the same and twice the first's diameter that were not pressed, the one that
    narrows most first; those that the layer does not carry are left out."""
    done = {(one.press.punch.profile, round(one.press.punch.diameter_m, 6)) for one in found.model.near}
    first = found.model.near[0].press.punch
    punches = [replace(first, profile=profile, diameter_m=size * first.diameter_m)
               for profile in _PROFILES for size in _SIZES]
    made = [one for punch in punches if (punch.profile, round(punch.diameter_m, 6)) not in done
            for one in _worth(found, punch)]
    return sorted(made, key=lambda one: -sum(one.narrows.values()))


def _worth(found: Identified, punch: Punch) -> Iterator[NextPress]:
    model, setup, p = found.model, found.model.setup, found.model.terms
    deepest = max(float(one.press.depth_m[-1]) for one in model.near)
    law, thicker = nearly_incompressible(found.law), float(np.median(setup.sd[0] * found.y[:, p]))
    try:
        plain = press_path(law, setup.body(thicker), punch, 0.0, deepest)
        thick = press_path(law, setup.body(thicker + _THICKER), punch, 0.0, deepest)
        rough = press_path(law, setup.body(thicker), punch, _RUBBED, deepest)
    except NotConverged:
        return
    depth = deepest * np.arange(1, _POINTS + 1) / _POINTS
    at = np.log(depth)
    slope = np.stack([np.interp(at, plain.log_depth, column)
                      for column in by_features(model.prior, np.median(found.y[:, :p], axis=0), plain.by_law).T], -1)
    y = found.y
    read = features(model.prior.law, model.prior.vectors(y[:, :p])) @ slope.T + setup.sd[3] * y[:, p + 3, None]
    read = read + setup.sd[0] * y[:, p, None] * (thick.at(at) - plain.at(at)) / _THICKER
    rubbed = np.interp(at, rough.log_depth, rough.log_force - plain.at(rough.log_depth))
    read = read + np.minimum(y[:, p + 1, None] / _RUBBED, 1.0) * rubbed
    stiff = np.exp(plain.at(at + 1e-3) - plain.at(at - 1e-3)) - 1
    by_depth = stiff / 2e-3 / depth
    force = np.exp(plain.at(at))
    read = read - setup.sd[2] * y[:, p + 2, None] * force * by_depth
    errors = relative_covariance(force, depth, found.noise.mean(axis=0))
    errors = errors + setup.each_sd[0] ** 2 * by_depth[:, None] * by_depth
    narrows = {name: _narrowed(derived_of(found.draws)[name], read, errors) for name in QUANTITIES}
    yield NextPress(punch, deepest, float(force[-1]), narrows)


def _narrowed(quantity: Array, read: Array, errors: Array) -> float:
    q, x = quantity - quantity.mean(), read - read.mean(axis=0)
    across = x.T @ q / len(q)
    left = 1 - across @ np.linalg.solve(x.T @ x / len(q) + errors, across) / np.mean(q**2)
    return float(1 - np.sqrt(max(left, 0.0)))
