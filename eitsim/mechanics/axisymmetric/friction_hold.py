"""A touch with friction that lasts under a force: every step in time is an increment of its friction."""

from collections.abc import Iterable, Sequence

import numpy as np

from eitsim.mechanics.axisymmetric import friction_increments
from eitsim.mechanics.axisymmetric.friction_increments import INCREMENTS, FrictionHistory, Loaded
from eitsim.mechanics.axisymmetric.indentation import IndentationProblem
from eitsim.mechanics.axisymmetric.viscoelastic import Memory, loaded_at_once, remembered, stepped, steps_s, unloaded
from eitsim.numerics.work_budget import bounded
from matcal.laws.prony import Prony
from touchcal.errors import NotConverged

# How often a step in time is halved where no equilibrium is found.
_HALVINGS = 3


def held_with_friction(levels: Sequence[IndentationProblem], coefficient: float, series: Prony,
                       times_s: tuple[float, ...], per_decade: int, loaded: FrictionHistory | tuple[float, float]
                       ) -> list[FrictionHistory]:
    """The course at the end of loading and at each time, s, under the force at that end, in as many steps per decade.

    loaded: the course of a loading in no time, or a loading's length, s, and the force, over mu_0 H^2, at its end.
    """
    coarse, fine = levels[-2:]

    def over(model: IndentationProblem, now: Loaded | None, part: int) -> list[Loaded]:
        if now is not None:
            memory = loaded_at_once(model, series, now.state.x)
        else:
            assert not isinstance(loaded, FrictionHistory)
            memory, now = _ramped(model, coefficient, series, *loaded, INCREMENTS // part)
        ends = steps_s(series, np.array(times_s), max(per_decade // part, 1))
        return [now, *_crept(model, coefficient, series, memory, now, ends.tolist(), times_s)]

    starts = (loaded.rough, loaded.coarse, loaded.fine) if isinstance(loaded, FrictionHistory) else (None, None, None)
    return list(map(FrictionHistory, *map(over, (coarse, coarse, fine), starts, (2, 1, 1))))


def _ramped(model: IndentationProblem, coefficient: float, series: Prony, length_s: float, force: float,
            increments: int) -> tuple[Memory, Loaded]:
    memory, now = unloaded(model, series), friction_increments.at_rest(model)
    for k in range(1, increments + 1):
        memory, now = _step(model, coefficient, series, memory, now, length_s / increments, force * k / increments)
    return memory, now


def _crept(model: IndentationProblem, coefficient: float, series: Prony, memory: Memory, now: Loaded,
           ends_s: Iterable[float], times_s: Sequence[float]) -> list[Loaded]:
    out, before_s = [], 0.0
    for end_s in ends_s:
        memory, now = _step(model, coefficient, series, memory, now, end_s - before_s, now.state.force)
        before_s = end_s
        if end_s in times_s:
            out.append(now)
    return out


def _step(model: IndentationProblem, coefficient: float, series: Prony, memory: Memory, now: Loaded, length_s: float,
          force: float, halvings: int = _HALVINGS) -> tuple[Memory, Loaded]:
    """Memory and foam after one step in time, or two of half its length where that fails."""
    try:
        with bounded(friction_increments.FACTORISATIONS, model.grid.unknowns):
            after = friction_increments.at_force(stepped(model, series, memory, length_s), coefficient, now, force)
    except NotConverged:
        if halvings == 0:
            raise
        middle = (now.state.force + force) / 2
        half = _step(model, coefficient, series, memory, now, length_s / 2, middle, halvings - 1)
        return _step(model, coefficient, series, *half, length_s / 2, force, halvings - 1)
    return remembered(model, series, memory, length_s, after.state.x), after
