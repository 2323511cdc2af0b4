"""Places of touches in a design: uniform over the disc where the punch fits, on a grid, or from a list."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from eitsim.sweeps.design.distributions import Distribution, of_values
from touchcal.document import Number, check, is_number

GRIDS = {"square": "spacing_mm", "polar": "spacing_mm", "sunflower": "count"}
_LIMITS = ("gap_mm", "within_mm", "apart_mm")
_MOST_PLACES, _MOST_RINGS = 100_000, 180  # places of a sunflower, and steps of other grids, which then have as many
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))

Place = tuple[float, float]


@dataclass(frozen=True)
class Places:
    """Where the punch of a design's touch stands."""

    # places to choose from or to go through; None: anywhere on the disc where the punch fits
    distribution: Distribution | None
    # least distance from the punch's edge to the rim, mm; None: 0, on a skin with an outline what the plan asks for
    gap_mm: float | None = None
    within_mm: float = math.inf  # largest distance from the centre to the punch's axis, mm
    # least distance between the edges of this punch and of others where one of both is placed by chance, mm; of two
    # such distances the larger holds
    apart_mm: float = 0.0


def places_of(raw: Any, radius_mm: float, diameter_mm: float) -> Places:
    """Places from the table `place` of a design's [punch]; ValueError says what it may hold.

    radius_mm: least radius of the disc; diameter_mm: largest of the punch, infinite where its law has no end.
    """
    forms = ("grid", "list", "choice")
    if not isinstance(raw, Mapping) or (unknown := set(raw) - {*forms, *_LIMITS, "spacing_mm", "count"}):
        named = f"unknown '{min(unknown)}'" if isinstance(raw, Mapping) else f"got {raw!r}"
        raise ValueError(f"place in [punch] takes grid with spacing_mm or count, list or choice of [x, y] in mm, and "
                         f"{', '.join(_LIMITS)}; {named}.")
    limits = {key: _positive(key, raw[key]) for key in _LIMITS if key in raw}
    given = [form for form in forms if form in raw]
    if len(given) > 1:
        raise ValueError(f"place in [punch] holds both {given[0]} and {given[1]}; give one of them.")
    if given != ["grid"] and (extra := {"spacing_mm", "count"} & raw.keys()):
        raise ValueError(f"{min(extra)} of place in [punch] belongs to a grid; add grid, one of "
                         f"{', '.join(GRIDS)}.")
    if not given:
        return Places(None, **limits)
    if given != ["grid"]:
        if extra := ({"gap_mm", "within_mm"} | ({"apart_mm"} if given == ["list"] else set())) & limits.keys():
            raise ValueError(f"{min(extra)} of place in [punch] has no effect on a {given[0]} of places; leave it out.")
        return Places(of_values(given[0], _listed(raw[given[0]])), **limits)
    if "apart_mm" in limits:
        raise ValueError("apart_mm of place in [punch] has no effect on a grid of places; leave it out.")
    reach = min(radius_mm - diameter_mm / 2 - limits.get("gap_mm", 0.0), limits.get("within_mm", math.inf))
    if not math.isfinite(reach) or reach < 0:
        raise ValueError("place in [punch]: the largest punch leaves no room for a grid; give diameter_mm, or its law, "
                         f"a highest value below {2 * radius_mm:g}, or a smaller gap_mm.")
    return Places(of_values("list", _grid(raw, reach)), **limits)


def gap_of(raw: Any) -> float | None:
    """The distance of the table `place` of a design on a curved skin, mm, the one key that it takes there."""
    if not isinstance(raw, Mapping) or set(raw) - {"gap_mm"}:
        raise ValueError("place in [punch] takes gap_mm alone on a curved skin; for a list of places give at_mm, as "
                         f"{{list = [[x, y, z], ...]}}, got {raw!r:.80}.")
    return _positive("gap_mm", raw["gap_mm"]) if "gap_mm" in raw else None


def on_disc(u: float, v: float, radius_mm: float, diameter_mm: float, places: Places) -> Place:
    """A place uniform over the part of the disc that `places` leaves for the whole punch, mm, from two uniform
    numbers; ValueError where nothing is left."""
    gap = places.gap_mm or 0.0
    reach = min(radius_mm - diameter_mm / 2 - gap, places.within_mm)
    if reach < 0:
        raise ValueError(f"a punch of diameter_mm = {diameter_mm:g} does not fit on the disc of radius_mm = "
                         f"{radius_mm:g} with a gap_mm of {gap:g}; make it smaller.")
    return _polar(reach * math.sqrt(u), 2 * math.pi * v)


def _listed(raw: Any) -> list[Place]:
    if not (isinstance(raw, list) and raw and all(
            isinstance(p, list) and len(p) == 2 and all(map(is_number, p)) for p in raw)):
        raise ValueError(f"place in [punch] lists places as [[x, y], ...] in mm, got {raw!r:.80}.")
    return [(float(x), float(y)) for x, y in raw]


def _grid(raw: Mapping[str, Any], reach_mm: float) -> list[Place]:
    """Places of a grid about the centre, no farther from it than `reach_mm`."""
    kind = raw["grid"]
    if not isinstance(kind, str) or kind not in GRIDS:
        raise ValueError(f"grid of place in [punch]: '{kind}' is unknown; known: {', '.join(GRIDS)}.")
    needed = GRIDS[kind]
    if needed not in raw or {"spacing_mm", "count"} & raw.keys() != {needed}:
        raise ValueError(f"grid = \"{kind}\" of place in [punch] takes {needed}"
                         f"{' and no count' if needed == 'spacing_mm' else ' and no spacing_mm'}.")
    if kind == "sunflower":
        count = raw["count"]
        check(count, Number(1, _MOST_PLACES, whole=True), "count of place in [punch]")
        count = int(count)
        return [_polar(reach_mm * math.sqrt((k + 0.5) / count), k * _GOLDEN_ANGLE) for k in range(count)]
    spacing = _positive("spacing_mm", raw["spacing_mm"])
    if spacing == 0 or reach_mm / spacing > _MOST_RINGS:
        raise ValueError(f"spacing_mm of place in [punch] must be at least {reach_mm / _MOST_RINGS:g}, got "
                         f"{spacing:g}.")
    rings = int(reach_mm / spacing + 1e-9)
    if kind == "polar":
        return [(0.0, 0.0), *(_polar(ring * spacing, 2 * math.pi * k / (6 * ring))
                              for ring in range(1, rings + 1) for k in range(6 * ring))]
    steps = range(-rings, rings + 1)
    return [(i * spacing, j * spacing) for j in steps for i in steps
            if math.hypot(i, j) * spacing <= reach_mm * (1 + 1e-9)]


def _polar(r: float, angle: float) -> Place:
    return r * math.cos(angle), r * math.sin(angle)


def _positive(key: str, value: Any) -> float:
    if not is_number(value) or value < 0:
        raise ValueError(f"{key} of place in [punch] must be a number from 0, in mm, got {value!r}.")
    return float(value)
