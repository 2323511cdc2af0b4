"""Solving the load paths of a table, and its deviation from touches solved anew between them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from eitsim.mechanics.load_paths import load_path
from eitsim.mechanics.load_paths.load_path import Deviation, LoadPath, Node, course_of, hermite, traced
from eitsim.mechanics.load_paths.table import carried_over, parts_of, state
from eitsim.mechanics.load_paths.types import DimensionlessProblem, Table
from eitsim.scene.scene import STRAINS
from touchcal.arrays import Array
from touchcal.errors import NotConverged
from touchcal.jit import cpu_s

# map a function over arguments, in this process or in others
Run = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]

# Depths, over the thickness, near which a path is solved at first.
DEPTHS = (*(1e-4 * 2.0**np.arange(10)).tolist(), *np.arange(0.1, 0.91, 0.08).tolist())
# Least number of depths of a table, and the depths at which each held-out diameter is solved anew.
_FEWEST, _CHECKS = 4, 20


def build(shape: DimensionlessProblem, run: Run = map, depths: Sequence[float] = DEPTHS) -> Table:
    """Solve the paths of a shape, at first near some increasing depths, over the thickness; `run` maps a function over
    diameters, possibly in other processes. NotConverged where no path of a useful length is found."""
    base = shape.base
    (((at, own), spent),) = run(partial(timed, _base_path, shape, tuple(depths)), [base])
    paths = {base: own}
    others = [d for d in shape.solved if d != base]
    solved = list(run(partial(timed, _path, shape, at), others))
    fresh = list(run(partial(timed, _fresh, shape, _probes(at)), shape.held_out))
    paths |= dict(zip(others, (arrays for arrays, _ in solved), strict=True))
    shortest = min(len(values) for values, _, _ in paths.values())
    values, slopes, error_estimate = (np.stack([paths[d][part][:shortest] for d in shape.solved]) for part in range(3))
    spent += sum(cpu for _, cpu in [*solved, *fresh])
    table = Table(shape, at[:shortest], course_at(shape, base).radius, values, slopes, error_estimate,
                  Deviation(0.0, np.zeros(len(STRAINS)), 0.0), 0, spent)
    return compared(table, dict(zip(shape.held_out, (found for found, _ in fresh), strict=True)))


def timed(solve: Callable[..., Any], *of: Any) -> tuple[Any, float]:
    """What a function finds, and the CPU time."""
    started = cpu_s()
    return solve(*of), cpu_s() - started


def _base_path(shape: DimensionlessProblem, depths: Sequence[float],
               diameter: float) -> tuple[Array, tuple[Array, ...]]:
    """The depths of a path refined where it needs it, and what `tabulated` makes of it."""
    nodes = load_path.refined(course_at(shape, diameter), depths)
    at = np.array([node.depth for node in nodes])
    return at, tabulated(nodes, at)


def _probes(depths: Array) -> Array:
    middles = (depths[1:] + depths[:-1]) / 2
    return middles[np.unique(np.linspace(0, len(middles) - 1, _CHECKS).round().astype(int))]


def course_at(shape: DimensionlessProblem, diameter: float) -> LoadPath:
    """One of a shape's punches, kept at the table's radii carried over to it."""
    base = course_of(*parts_of(shape, shape.base))
    if diameter == shape.base:
        return base
    return course_of(*parts_of(shape, diameter), carried_over(shape, base.radius, shape.base, diameter))


def _path(shape: DimensionlessProblem, depths: Array, diameter: float) -> tuple[Array, Array, Array]:
    nodes = list(traced(course_at(shape, diameter), depths.tolist()))
    return tabulated(nodes, depths[:len(nodes)])


def _fresh(shape: DimensionlessProblem, depths: Array, diameter: float) -> list[Node]:
    """Nodes near these depths, at the radii of their own samples, without their states."""
    course = course_of(*parts_of(shape, diameter))
    return [replace(node, states=()) for node in traced(course, depths.tolist())]


def tabulated(nodes: list[Node], depths: Array) -> tuple[Array, Array, Array]:
    """Values and slopes (k, 6 r + 6) at depths near those of the nodes, by the path's cubics, and ERRORS (k, 11) there;
    NotConverged where these are too few."""
    if len(nodes) < _FEWEST:
        raise NotConverged(f"a load path was found at {len(nodes)} depths only, too few for a table.", estimate=depths)
    at = np.array([node.depth for node in nodes])
    fields, slopes = (np.stack([getattr(n, name).ravel() for n in nodes]) for name in ("fields", "slopes"))
    numbers = np.stack([node.numbers for node in nodes])
    number_slopes = PchipInterpolator(at, numbers).derivative()(at)
    number_slopes[:, 0] = [node.stiffness for node in nodes]
    values, slopes = np.hstack([fields, numbers]), np.hstack([slopes, number_slopes])
    left = np.clip(np.searchsorted(at, depths) - 1, 0, len(at) - 2)
    pairs = [(at[i:i + 2], values[i:i + 2], slopes[i:i + 2], depth) for i, depth in zip(left, depths, strict=True)]
    return (np.stack([hermite(*pair) for pair in pairs]), np.stack([_hermite_slope(*pair) for pair in pairs]),
            np.stack([node.error_estimate for node in nodes]))


def _hermite_slope(ends: Array, values: Array, slopes: Array, at: float) -> Array:
    h = ends[1] - ends[0]
    t = (at - ends[0]) / h
    return (6 * t * (1 - t) * (values[1] - values[0]) / h + (1 - t) * (1 - 3 * t) * slopes[0]
            + t * (3 * t - 2) * slopes[1])


def compared(table: Table, fresh: dict[float, list[Node]]) -> Table:
    """The table with its largest deviation from nodes solved anew at some diameters."""
    error, checks = table.error, 0
    for diameter, nodes in fresh.items():
        course = course_of(*parts_of(table.shape, diameter))
        radius = carried_over(table.shape, table.radius, table.shape.base, diameter)
        for node in nodes:
            found = state(table, diameter, mean_pressure=node.mean_pressure)
            if found is not None:
                fields = PchipInterpolator(radius, found.fields, axis=1)(np.clip(course.radius, *radius[[0, -1]]))
                ratio = found.depth / node.corrected_depth
                error = error.at_least(load_path.deviation(course, ratio, fields, node.fields))
                checks += 1
    if not checks:
        raise NotConverged("no touch was solved anew to check a table of load paths by.", estimate=table.depths)
    return replace(table, error=error, checks=checks)
