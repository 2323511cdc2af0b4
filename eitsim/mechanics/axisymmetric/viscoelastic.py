"""Finite-strain relaxation of the foam: each step in time is a minimisation of its own, at any length of the step.

The second Piola-Kirchhoff stress is S(t) = int G(t-s)/G_0 dS_0(s) of the instantaneous law's S_0, as in
`matcal.laws.prony.convolve`, which takes S_0 as linear in time over a step. At the end of a step it is a S_0 + H with
one number a and a stress H that the past alone decides; since S_0 derives from the energy w(E), the step's equilibrium
minimises a w(E) + H : E. The recursion is exact for the times of the series, so no step is too long for stability.
Source: Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153, DOI 10.1016/0045-7825(87)90107-1.
"""

from dataclasses import dataclass, replace

import numpy as np

from eitsim.mechanics.axisymmetric.indentation import IndentationProblem
from eitsim.mechanics.solid import axisymmetric_assembly
from matcal.laws.law import scaled
from matcal.laws.prony import Prony, decaying, relaxation
from touchcal.arrays import Array

# First step, in shortest relaxation times, times the number of steps per decade.
_FIRST = 0.5
# Relaxation, over the instantaneous stress, below which neighbouring steps are joined.
_IDLE = 1e-5


@dataclass(frozen=True)
class Memory:
    """What the foam remembers; second Piola-Kirchhoff parts rr, rz, zz and hoop, over mu_0."""

    instantaneous: Array  # (elements, points, 4) stress of the instantaneous law
    decaying: Array  # (M, elements, points, 4) int exp(-(t-s)/tau_i) dS_0(s) of each term of the series


def unloaded(model: IndentationProblem, series: Prony) -> Memory:
    """Memory of foam that was never touched."""
    none = np.zeros((*model.grid.weight.shape, 4))
    return Memory(none, np.zeros((series.tau_s.size, *none.shape)))


def loaded_at_once(model: IndentationProblem, series: Prony, x: Array) -> Memory:
    """Memory of foam that was brought to x in no time."""
    stress = _instantaneous(model, x)
    return Memory(stress, np.broadcast_to(stress, (series.tau_s.size, *stress.shape)))


def stepped(model: IndentationProblem, series: Prony, memory: Memory, step_s: float) -> IndentationProblem:
    """The problem whose equilibria are those of the instantaneous problem `model` after a step in time."""
    decay, weight = _factors(series, step_s)
    share = series.g_infinity + float(series.g @ weight)
    kept = np.tensordot(series.g * decay, memory.decaying, axes=1)
    past = kept - float(series.g @ weight) * memory.instantaneous
    return replace(model, law=scaled(model.law, share), prestress=past)


def remembered(model: IndentationProblem, series: Prony, memory: Memory, step_s: float, x: Array) -> Memory:
    """Memory after that step, which ended at x."""
    decay, weight = (factor[:, None, None, None] for factor in _factors(series, step_s))
    stress = _instantaneous(model, x)
    return Memory(stress, decay * memory.decaying + weight * (stress - memory.instantaneous))


def steps_s(series: Prony, times_s: Array, per_decade: int) -> Array:
    """Ends of the steps (n,) of a hold, s, increasing: `times_s`, and between them as many per decade as asked for. The
    first is a part of the shortest relaxation time; where nothing relaxes, steps are left out."""
    times = np.unique(times_s)
    first = min(_FIRST / per_decade * float(series.tau_s[0]), float(times[0]))
    count = int(np.ceil(per_decade * np.log10(times[-1] / first)))
    between = first * (times[-1] / first) ** (np.arange(count) / max(count, 1))
    kept, level = [], 1.0
    for t, now in zip(between, relaxation(series, between), strict=True):
        if level - now > _IDLE:
            kept.append(t)
            level = now
    return np.unique(np.concatenate([kept, times]))


def _instantaneous(model: IndentationProblem, x: Array) -> Array:
    return axisymmetric_assembly.second_piola(model.law, axisymmetric_assembly.deformation(model.grid, x[:-1]),
                                              axisymmetric_assembly.projection_of(model.law, model.grid))


def _factors(series: Prony, step_s: float) -> tuple[Array, Array]:
    """(M,) what a step leaves of the decaying parts, and what it adds to them of a rise of S_0."""
    ends = decaying(series, [0.0, step_s], [[1.0, 0.0], [1.0, 1.0]])[:, 1]
    return ends[:, 0], ends[:, 1]
