"""The rows of a design: random numbers of each row, the values they give, and places where touches do not overlap."""

import copy
import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.scene.curved.curved_scene import is_curved
from eitsim.scene.scene import Body, Punch, Scene
from eitsim.sweeps.design.curved_places import at_surface, on_surface
from eitsim.sweeps.design.outline_places import on_outline, outlined
from eitsim.sweeps.design.punch_positions import on_disc
from eitsim.sweeps.design.variables import Layout, Variable

# Samplers whose points are chosen together, so that their number is fixed; any other draws each row for itself.
FIXED = ("lhs", "sobol")
_TRIES = 1000  # Places that are tried for a touch that would overlap another.

Circle = tuple[float, float, float]
Standing = tuple[Circle, float]  # a touch that has its place, and how far others keep from its edge, mm


def row_tables(layout: Layout, sampler: str, scenes: int, seed: int, index: int) -> dict[str, Any]:
    """Tables of the scene of one row, "punch" a list of its touches; ValueError where touches find no place.

    Touches whose place is left to chance, and that would overlap others, are placed again by random numbers of their
    own that depend on (seed, index) only, whatever the sampler.
    """
    tables = copy.deepcopy(dict(layout.plain))
    count = len(tables["punch"])
    numbers = (_points(sampler, scenes, seed, layout.free)[index] if sampler in FIXED else
               np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,))).random(layout.free))
    for variable, value in _values(layout, numbers, index):
        if variable.key == "touches":
            count = value
        elif value is not None:
            held = tables["punch"][variable.touch] if variable.table == "punch" else tables[variable.table]
            held[variable.key] = value
    tables["punch"] = tables["punch"][:count]
    _without_idle_friction(layout, tables["punch"])
    if is_curved(tables):
        _place_on_surface(layout, tables)
    else:
        _place(layout, tables, seed, index)
    return tables


@lru_cache(maxsize=4)
def _points(sampler: str, scenes: int, seed: int, count: int) -> NDArray[np.float64]:
    """(scenes, count) points that fill the unit cube evenly."""
    from scipy.stats import qmc

    if count == 0:
        return np.empty((scenes, 0))
    if sampler == "lhs":
        points = qmc.LatinHypercube(count, rng=seed).random(scenes)
    else:
        points = qmc.Sobol(count, rng=seed).random_base2(math.ceil(math.log2(max(scenes, 2))))[:scenes]
    points.setflags(write=False)
    return points


def _values(layout: Layout, numbers: NDArray[np.float64], index: int) -> Iterator[tuple[Variable, Any]]:
    """The value of each variable in a row; of lists every combination once, the last list the fastest."""
    chances, left = iter(numbers.tolist()), layout.combinations or 1
    for variable in layout.variables:
        distribution = variable.distribution
        if distribution.quantile is not None:
            yield variable, distribution.quantile(next(chances))
        elif distribution.order == "list":
            left //= len(distribution.values)
            yield variable, distribution.values[index // left % len(distribution.values)]
        else:
            yield variable, distribution.values[index]


def _without_idle_friction(layout: Layout, punches: list[dict[str, Any]]) -> None:
    """Where friction is drawn, its coefficient serves the rows with Coulomb's law alone."""
    drawn = {v.touch for v in layout.variables if v.key == "friction" and v.distribution.order != "rows"}
    for k, punch in enumerate(punches):
        if k in drawn and punch["friction"] != "coulomb":
            punch.pop("friction_coefficient", None)


def _place_on_surface(layout: Layout, tables: dict[str, Any]) -> None:
    """Give the touch its place on a curved skin."""
    (punch,), (place,) = tables["punch"], layout.places
    punch["at_mm"] = at_surface(punch["at_mm"], tables) if place is None else on_surface(
        punch.pop("u"), punch.pop("v"), tables, punch.get("diameter_mm", 1e3 * Punch().diameter_m), place.gap_mm)


def _place(layout: Layout, tables: dict[str, Any], seed: int, index: int) -> None:
    """Give every touch its place: first those that stand fast, then the others where they do not overlap."""
    punches = tables["punch"]
    movable = [[v for v in layout.variables if v.table == "punch" and v.touch == k and v.distribution.order == "chance"
                and v.key in ("x_mm", "y_mm", "place")] for k in range(len(punches))]
    skin = outlined(tables) or tables.get("body", {}).get("radius_mm", Body().radius_m * 1e3)
    standing: list[Standing] = []
    rng: np.random.Generator | None = None
    for k in sorted(range(len(punches)), key=lambda k: bool(movable[k])):
        punch, drawn = punches[k], dict(punches[k])
        for _ in range(_TRIES):
            circle = _circle(layout, k, drawn, skin)
            if len(punches) == 1 or not movable[k] or _clear(circle, _keep_mm(layout, k), standing):
                break
            rng = rng or np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, 1)))
            drawn |= {v.key: v.distribution.quantile(float(rng.random())) for v in movable[k]
                      if v.distribution.quantile}
        else:
            raise ValueError(f"touch {k + 1} found no place among the others in {_TRIES} draws. Ask for fewer or "
                             "smaller punches, or a smaller apart_mm in place.")
        punch.pop("place", None)
        punch["x_mm"], punch["y_mm"] = circle[:2]
        standing.append((circle, _keep_mm(layout, k)))


def _circle(layout: Layout, k: int, punch: dict[str, Any], skin: Scene | float) -> Circle:
    """x, y and diameter of a touch, mm, on a skin with an outline or on a disc of a radius, mm."""
    places, diameter = layout.places[k], punch.get("diameter_mm", Punch().diameter_m * 1e3)
    if places is not None and places.distribution is None:
        u, v = punch["x_mm"], punch["y_mm"]
        x, y = on_outline(u, v, skin, diameter, places.gap_mm, places.within_mm) if isinstance(
            skin, Scene) else on_disc(u, v, skin, diameter, places)
        return x, y, diameter
    x, y = punch["place"] if "place" in punch else (punch.get("x_mm", 0.0), punch.get("y_mm", 0.0))
    return x, y, diameter


def _keep_mm(layout: Layout, k: int) -> float:
    places = layout.places[k]
    return 0.0 if places is None else places.apart_mm


def _clear(circle: Circle, keep_mm: float, others: Sequence[Standing]) -> bool:
    """Whether a touch keeps the larger of both distances from each that stands."""
    x, y, d = circle
    return all(math.hypot(x - a, y - b) - (d + e) / 2 > max(keep_mm, theirs) for (a, b, e), theirs in others)
