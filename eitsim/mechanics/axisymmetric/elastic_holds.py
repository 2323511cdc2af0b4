"""Creep and relaxation of any touches by elastic ones: what a hold of each touch alone, stepped in time, says of them.

Alone and far from edges, a touch is stepped in time. At each time an elastic touch of the instantaneous law is as deep,
without friction, under another force; the same forces press touches that edges and neighbours change, and every stress
is taken as much smaller as the lone touch's force is. What the two lone touches differ by, with friction, is the error
of the others.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric.hold import relaxed, solve_hold, stepped_with_friction
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_path, solve_touch
from eitsim.scene.results import Touch
from eitsim.scene.scene import Body, Hold, Punch
from eitsim.sheet.sheet_conductance import driving_strains, stretches
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.arrays import Array

# Radii at which the surfaces of two touches are compared.
_RADII = 6000


@dataclass(frozen=True, eq=False)
class StandIns:
    """Elastic touches that stand for held ones at one time."""

    time_s: float  # since the end of loading, s
    lone: tuple[tuple[Touch, Touch], ...]  # one a punch: it alone, held and elastic

    @property
    def force_N(self) -> Array:
        """(punches,) Forces of the elastic touches, N."""
        return np.array([elastic.force_N for _, elastic in self.lone])

    def held(self, touches: Sequence[Touch]) -> tuple[Touch, ...]:
        """Held touches (punches,) by elastic ones under these forces; what the lone ones differ by adds to the errors.
        """
        return tuple(_held(*lone, touch) for lone, touch in zip(self.lone, touches, strict=True))


def _held(held: Touch, elastic: Touch, touch: Touch) -> Touch:
    share, (signals, strains) = held.force_N / elastic.force_N, differences(held, elastic, touch)

    def more(error: float | None, one: float, other: float) -> float | None:
        return None if error is None else float(error + abs(one / other - 1))

    return replace(
        relaxed(touch, share), signal_errors=touch.signal_errors + signals,
        depth_error=touch.depth_error + float(abs(held.depth_m / elastic.depth_m - 1)),
        strain_errors=None if touch.strain_errors is None else touch.strain_errors + strains,
        sigma_max_error=more(touch.sigma_max_error, held.sigma_max_Pa, share * elastic.sigma_max_Pa),
        contact_area_error=more(touch.contact_area_error, held.contact_area_m2, elastic.contact_area_m2),
        contact_end_error=more(touch.contact_end_error, held.contact_radius_m, elastic.contact_radius_m))


def stand_ins(law: Law, series: Prony, body: Body, punches: Sequence[Punch], hold: Hold) -> list[StandIns]:
    """At the end of loading and at every time of a hold; law: instantaneous moduli.

    NotConverged where a lone touch has no equilibrium.
    """
    lone = [replace(punch, x_m=0.0, y_m=0.0, conductor=False) for punch in punches]
    known = {punch: _over_time(law, series, body, punch, hold) for punch in dict.fromkeys(lone)}
    return [StandIns(moments[0][0], tuple(pair for _, pair in moments))
            for moments in zip(*(known[punch] for punch in lone), strict=True)]


def _over_time(law: Law, series: Prony, body: Body, punch: Punch, hold: Hold
               ) -> list[tuple[float, tuple[Touch, Touch]]]:
    """Times, s, each with one lone punch held and the elastic one that stands for it."""
    smooth, out, elastic = replace(punch, friction="none"), [], None
    for time_s, held in solve_hold(law, series, body, smooth, hold):
        if elastic is None or hold.control == "force":
            elastic = solve_touch(law, body, replace(smooth, force_N=None, depth_m=held.depth_m))
        out.append((time_s, (held, elastic)))
    if punch.friction == "none" or not stepped_with_friction(punch, hold):
        return out
    rubbed = solve_hold(law, series, body, punch, hold)
    pressed = solve_path(law, body, punch, [elastic.force_N for _, (_, elastic) in out])
    return [(time_s, pair) for (time_s, *_), pair in zip(out, zip((touch for _, touch in rubbed), pressed, strict=True),
                                                         strict=True)]


def differences(held: Touch, elastic: Touch, touch: Touch) -> tuple[Array, Array]:
    """(3,) differences of two touches' surface strains about their punch, without signs, over the moments of the
    strains, which make dV to first order, and (3,) in L2 over the surface, by scene.STRAINS; none where all strains
    vanish. touch: the one that they speak for, whose moments count where they are the smaller ones: near edges a
    bonded layer's areal strains cancel more."""
    radius = np.linspace(0, float(held.radius_m[-1]), _RADII + 1)[1:]
    one, other, own = (driving_strains(*stretches(each, radius)) for each in (held, elastic, touch))

    def share(away: Array, *whole: Array) -> Array:
        least = np.minimum(*whole)
        return np.divide(away, least, out=np.zeros_like(away), where=least > 0)

    return (share(np.abs(one - other) @ radius, np.abs(other @ radius), np.abs(own @ radius)),
            share(*(np.sqrt(each**2 @ radius) for each in (one - other, other, own))))
