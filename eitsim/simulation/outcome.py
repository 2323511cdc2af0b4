"""How a scene ended: what was solved, with its errors and what is wrong with it, or what stopped the solver."""

from collections.abc import Mapping

from eitsim.mechanics.axisymmetric.continuation import BOTTOM, BottomedOut
from eitsim.scene.curved.curved_scene import AnyScene
from eitsim.scene.results import Moment, Plan, Readings, Result, Touch
from eitsim.simulation.error_budget import error_budget, explain_excess, numerical_errors
from touchcal.errors import NotConverged


def stopped(plan: Plan, error: NotConverged) -> Result:
    """What a solver that found no equilibrium leaves."""
    return Result("bottomed_out" if isinstance(error, BottomedOut) else "not_converged", plan, message=str(error),
                  residuals=error.residuals, load_fraction=error.load_fraction)


def solved(scene: AnyScene, plan: Plan, touches: tuple[Touch, ...], readings: Readings,
           moments: tuple[Moment, ...] = (), unplanned: Mapping[str, float] | None = None) -> Result:
    """The last touches and readings, with their errors; bottomed out where a punch is deeper than a foam's law can be
    trusted. unplanned: what neighbours may change more than the plan counts."""
    numerical = numerical_errors(touches, readings, scene.skin.strain)
    errors = error_budget(plan, numerical, unplanned, readings)
    deepest = max(touch.depth_m for touch in touches)
    too_deep = deepest > BOTTOM * scene.body.thickness_m
    note = (f"the punch is {deepest * 1e3:.3f} mm deep, more than {BOTTOM:.0%} of the layer's thickness." if too_deep
            else explain_excess(scene.accuracy.signal, errors["signal"], numerical["signal"], plan, readings))
    return Result("bottomed_out" if too_deep else "ok", plan, touches, readings, moments, note, error_estimate=errors,
                  numerical_error=numerical)
