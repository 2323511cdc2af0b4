"""What varies between the rows of a design, in a fixed order, and what stays."""

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eitsim.scene.curved.curved_scene import is_curved
from eitsim.scene.drive import MATRICES
from eitsim.scene.scene import Body, Punch, scene_keys
from eitsim.scene.scene_keys import MOST_TOUCHES, check_value, is_list
from eitsim.sweeps.design.distributions import Distribution, distribution_of, of_values
from eitsim.sweeps.design.punch_positions import Places, gap_of, places_of
from touchcal.document import is_number
from touchcal.errors import unknown_key

# What decides which readings a row holds, and so cannot vary between rows.
SENSOR = (*(("body", key) for key in ("outline", "width_mm", "height_mm", "corner_radius_mm")), ("electrodes", "count"),
           ("drive", "pattern"), ("drive", "reading"), *(("drive", key) for key in MATRICES))
_UNIT = Distribution("chance", lambda u: u, (), (0.0, 1.0), "uniform from 0 to 1")


@dataclass(frozen=True)
class Variable:
    """A key whose value is drawn."""

    table: str  # table of a scene file; "" for the number of touches
    touch: int  # number of the touch, from 0; 0 in other tables than "punch"
    # key of the table, or "place" for both x_mm and y_mm, or "touches"
    key: str
    distribution: Distribution


@dataclass(frozen=True)
class Layout:
    """The tables of a design, parted."""

    # tables of a scene file with their plain values alone; "punch" a list of as many as a row may have at most
    plain: Mapping[str, Any]
    variables: tuple[Variable, ...]  # in the order in which they take their random numbers
    places: tuple[Places | None, ...]  # one a touch: where it stands; None where x_mm or y_mm are given as keys

    @property
    def free(self) -> int:
        """How many random numbers a row takes."""
        return sum(v.distribution.order == "chance" for v in self.variables)

    @property
    def combinations(self) -> int | None:
        """How many combinations the lists have; None without lists."""
        sizes = [len(v.distribution.values) for v in self.variables if v.distribution.order == "list"]
        return math.prod(sizes) if sizes else None

    @property
    def rows(self) -> int | None:
        """For how many scenes values are given row by row; None where there are none."""
        return min((len(v.distribution.values) for v in self.variables if v.distribution.order == "rows"), default=None)


def layout_of(tables: Mapping[str, Any], touches: Any = None) -> Layout:
    """The layout of a design's tables and of its number of touches; ValueError names the key and what it may hold."""
    if is_curved(tables):
        return _on_curved_skin(tables, touches)
    number = number_of_touches(touches)
    plain = {name: value for name, value in copy.deepcopy(dict(tables)).items() if name != "punch"}
    plain["punch"] = _punches(tables.get("punch", {}), number)
    variables = [v for name in sorted(plain) if name != "punch" for v in _parted(name, 0, plain[name])]
    later = [v for v in variables if v.table > "punch"]
    radius = _end(plain.get("body", {}), variables, "body", "radius_mm", Body().radius_m * 1e3, 0)
    places: list[Places | None] = []
    touched: list[Variable] = []
    for k, punch in enumerate(plain["punch"]):
        placed = "place" in punch
        if placed and (both := {"x_mm", "y_mm"} & punch.keys()):
            raise ValueError(f"[punch] has both place and {min(both)}; give one of them.")
        place, free = punch.pop("place", {}), placed or not {"x_mm", "y_mm"} & punch.keys()
        own = list(_parted("punch", k, punch))
        largest = _end(punch, own, "punch", "diameter_mm", Punch().diameter_m * 1e3, 1)
        if isinstance(place, Mapping) and "grid" in place and plain.get("body", {}).get("outline", "disc") != "disc":
            raise ValueError("grid of place in [punch] is laid on discs alone; on a skin with an outline leave it out, "
                             "or give list or choice.")
        places.append(places_of(place, radius, largest) if free else None)
        if (stands := places[-1]) is not None:
            own += [Variable("punch", k, key, _UNIT) for key in ("x_mm", "y_mm")] if stands.distribution is None else [
                Variable("punch", k, "place", stands.distribution)]
        touched += own
    ordered = [*(v for v in variables if v.table < "punch"), *touched, *later]
    if isinstance(number, Distribution):
        ordered.append(Variable("", 0, "touches", number))
    return Layout(plain, tuple(ordered), tuple(places))


def _on_curved_skin(tables: Mapping[str, Any], touches: Any) -> Layout:
    """The layout of a design of touches on a curved body, whose body, electrodes and drive stay."""
    plain = copy.deepcopy(dict(tables))
    punch = plain.get("punch", {})
    punch = punch[0] if isinstance(punch, list) and len(punch) == 1 else punch
    if not isinstance(punch, dict) or touches not in (None, 1):
        raise ValueError("[punch]: a sweep on a curved skin takes one touch a scene; give one [punch], and leave "
                         "touches out.")
    place, at = punch.pop("place", {}), punch.pop("at_mm", None)
    if at is not None and place:
        raise ValueError("[punch] has both place and at_mm; give one of them.")
    gap_mm = gap_of(place)
    varied = {name: table for name, table in plain.items() if name not in ("body", "electrodes", "drive", "punch")}
    variables = [v for name in sorted(varied) for v in _parted(name, 0, varied[name])]
    own = list(_parted("punch", 0, punch))
    listed = distribution_of("at_mm in [punch]", at) if isinstance(at, Mapping) else None
    if listed is not None:
        own.append(Variable("punch", 0, "at_mm", listed))
    elif at is None:
        own += [Variable("punch", 0, key, _UNIT) for key in ("u", "v")]
    else:
        punch["at_mm"] = at
    ordered = [*(v for v in variables if v.table < "punch"), *own, *(v for v in variables if v.table > "punch")]
    return Layout({**plain, "punch": [punch]}, tuple(ordered), (None if at is not None else Places(None, gap_mm),))


def number_of_touches(touches: Any) -> int | Distribution | None:
    """The number of touches of a row: fixed, drawn, or None where the tables give it."""
    if touches is None:
        return None
    raw: Any = {"dist": "integer", "lo": touches[0], "hi": touches[1]} if (
        isinstance(touches, list) and len(touches) == 2) else touches
    distribution = distribution_of("touches", raw)
    values: Sequence[Any] = [touches] if distribution is None else distribution.values or distribution.ends
    law = isinstance(raw, Mapping) and raw.get("dist", "integer") != "integer"
    if law or not all(is_number(v) and v == int(v) and 1 <= v <= MOST_TOUCHES for v in values):
        raise ValueError(f"touches must be a whole number from 1 to {MOST_TOUCHES}, a range of "
                         "them, {choice = [...]}, {list = [...]} or "
                         f"{{dist = \"integer\", ...}}, got {touches!r}.")
    if distribution is None:
        return int(values[0])
    return of_values(next(iter(raw)), [int(v) for v in distribution.values]) if distribution.values else distribution


def _punches(raw: Any, number: int | Distribution | None) -> list[dict[str, Any]]:
    """One table a touch; a single one serves them all."""
    given = raw if isinstance(raw, list) else [raw]
    if not given or not all(isinstance(punch, Mapping) for punch in given):
        raise ValueError(f"[punch] must be a table of keys, or one [[punch]] a touch, got {raw!r:.80}.")
    most = number if isinstance(number, int) else len(given) if number is None else int(number.ends[1])
    if len(given) == 1:
        given = given * most
    if len(given) != most:
        raise ValueError(f"touches goes up to {most}, but {len(given)} [[punch]] are given. Give one [punch] for all "
                         f"of them, or {most}.")
    return [copy.deepcopy(dict(punch)) for punch in given]


def _parted(name: str, touch: int, table: Any) -> Iterator[Variable]:
    """The drawn keys of a table, taken out of it, by name."""
    if not isinstance(table, dict):
        raise ValueError(f"[{name}] must be a table of keys, got {table!r}.")
    known = scene_keys()[name]
    for key in sorted(table):
        where, value = f"{key} in [{name}]", table[key]
        if key not in known:
            raise ValueError(unknown_key(key, (*known, "place") if name == "punch" else known, name))
        if is_list(name, key, value):
            continue
        if (name, key) == ("hold", "time_s"):
            _check_times(value)
            if isinstance(value, list) and len(value) == 1:
                value = table[key] = value[0]
        distribution = distribution_of(where, value)
        if distribution is None:
            if name in ("body", "punch"):
                check_value(name, key, value)
            continue
        if (name, key) in SENSOR:
            raise ValueError(f"{where} is drawn, but the readings of all rows stand in the same columns. Fix it, and "
                             "make one data set for each of its values.")
        for each in distribution.values or ([distribution.quantile(0.5)] if distribution.quantile else []):
            if each is not None:
                check_value(name, key, each)
        del table[key]
        yield Variable(name, touch, key, distribution)


def _check_times(value: Any) -> None:
    """A row is one scene at one time."""
    several = isinstance(value, list) and len(value) > 2
    if isinstance(value, Mapping):
        several = any(isinstance(each, list) for form in value.values() if isinstance(form, list) for each in form)
    if several:
        raise ValueError(f"time_s in [hold] holds several times, got {value}, and a row is one scene at one time. Give "
                         "{list = [...]} for a row each, [shortest, longest] for a time by chance, or run the scene by "
                         "`eitsim run`.")


def _end(plain: Mapping[str, Any], variables: list[Variable], table: str, key: str, default: float, end: int) -> float:
    """The least (end 0) or largest (end 1) value of a key over all rows."""
    drawn = [v.distribution.ends[end] for v in variables if (v.table, v.key) == (table, key)]
    return drawn[0] if drawn else float(plain.get(key, default))
