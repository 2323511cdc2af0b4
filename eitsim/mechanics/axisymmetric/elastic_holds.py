"""Creep and relaxation of any touches by elastic ones: what a hold of each touch alone, stepped in time, says of them.

Alone, without friction and far from edges, a touch is stepped in time. At each time an elastic touch of the
instantaneous law is as deep under another force; the same forces press touches that edges, neighbours and friction
change, and every stress is taken as much smaller as the lone touch's force is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric.hold import solve_hold
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.scene import Body, Hold, Punch
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.arrays import Array


@dataclass(frozen=True, eq=False)
class ElasticForces:
    """Elastic touches that stand for held ones at one time."""

    time_s: float  # since the end of loading, s
    force_N: Array  # (punches,) force of the elastic touch that is as deep alone as the held one, N
    share: Array  # (punches,) force of the held touch over that of the elastic one


def elastic_forces(law: Law, series: Prony, body: Body, punches: Sequence[Punch], hold: Hold) -> list[ElasticForces]:
    """At the end of loading and at every time of a hold; law: instantaneous moduli.

    NotConverged where a lone touch has no equilibrium.
    """
    lone = [replace(punch, x_m=0.0, y_m=0.0, friction="none", conductor=False) for punch in punches]
    known = {punch: _over_time(law, series, body, punch, hold) for punch in dict.fromkeys(lone)}
    times, force, share = zip(*(known[punch] for punch in lone), strict=True)
    return [ElasticForces(float(t), *each) for t, *each in zip(
        times[0], np.transpose(force), np.transpose(share), strict=True)]


def _over_time(law: Law, series: Prony, body: Body, punch: Punch, hold: Hold) -> tuple[Array, Array, Array]:
    """Times, s, elastic forces, N, and shares of one lone punch, each (times,)."""
    held = solve_hold(law, series, body, punch, hold)
    depths = np.array([touch.depth_m for _, touch in held])
    kept = hold.control == "depth"
    elastic = np.array([_force_at(law, body, punch, depth) for depth in (depths[:1] if kept else depths)])
    return (np.array([t for t, _ in held]), elastic * np.ones(len(held)),
            np.array([touch.force_N for _, touch in held]) / elastic)


def _force_at(law: Law, body: Body, punch: Punch, depth_m: float) -> float:
    return solve_touch(law, body, replace(punch, force_N=None, depth_m=float(depth_m))).force_N
