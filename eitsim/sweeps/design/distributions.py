"""How the values of one key of a design come about: by chance from a law, every combination in turn, or row by row."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from touchcal.document import is_number

MOST = 1e15  # Largest number of a law, in size; a lognormal variable's standard deviation over its mean.
_MOST_SPREAD = 1e6

Quantile = Callable[[float], Any]

# law -> what it takes next to its name, and what it may take
LAWS = {"uniform": (("lo", "hi"), ()), "loguniform": (("lo", "hi"), ()), "integer": (("lo", "hi"), ()),
        "normal": (("mean", "sd"), ("lo", "hi")), "lognormal": (("mean", "sd"), ("lo", "hi"))}
_FORMS = ("a range [lowest, highest], {choice = [...]}, {list = [...]} or {dist = \"" + "\"|\"".join(LAWS)
          + "\", ...}")
# Least probability that a truncated law may leave between its ends, and least probability that a quantile is from 0
# and from 1.
_LEAST_KEPT, _LEAST = 1e-6, 2.0**-53


@dataclass(frozen=True)
class Distribution:
    """The values that a key takes over the rows of a design."""

    # "chance": a quantile each row; "list": each combination with other lists once, over and over; "rows": one a row
    order: Literal["chance", "list", "rows"]
    quantile: Quantile | None  # value at a number of [0, 1); of "chance" only
    values: tuple[Any, ...]  # all values, in the order given; empty where they are a continuum
    ends: tuple[float, float]  # least and largest number, infinite where there is none; NaN where values are no numbers
    words: str  # for people


def distribution_of(where: str, value: Any) -> Distribution | None:
    """How the value of the key `where` is drawn; None for a plain value. ValueError says what it may be."""
    if isinstance(value, list):
        return _law(where, "uniform", dict(zip(("lo", "hi"), value, strict=True)) if len(value) == 2 else {}, value)
    if not isinstance(value, Mapping):
        return None
    for form in ("choice", "list", "rows"):
        if set(value) == {form} and isinstance(value[form], list) and value[form]:
            return of_values(form, value[form])
    if "dist" in value:
        return _law(where, value["dist"], {key: v for key, v in value.items() if key != "dist"}, value)
    raise ValueError(f"{where} must be a plain value, {_FORMS}, got {dict(value)}.")


def of_values(form: str, values: Sequence[Any]) -> Distribution:
    """A draw of these values: "choice" by chance, all with the same odds, "list" in turn, "rows" one a row."""
    found = tuple(values)
    numbers = [v for v in found if v is not None]
    ordered = bool(numbers) and all(map(is_number, numbers))
    ends = (float(min(numbers)), float(max(numbers))) if ordered else (math.nan, math.nan)
    opening = {"choice": "one of ", "list": "in turn ", "rows": f"given for each of {len(found)} scenes"}[form]
    if form == "choice":
        return Distribution("chance", lambda u: found[min(int(u * len(found)), len(found) - 1)], found, ends,
                            opening + ", ".join(map(str, found)))
    if form == "list":
        return Distribution("list", None, found, ends, opening + ", ".join(map(str, found)))
    span = f", from {ends[0]:g} to {ends[1]:g}" if ends[0] <= ends[1] else ""
    return Distribution("rows", None, found, ends, opening + span)


def _law(where: str, name: Any, given: Mapping[str, Any], raw: Any) -> Distribution:
    if not isinstance(name, str) or name not in LAWS:
        raise ValueError(f"{where}: dist '{name}' is unknown; known: {', '.join(LAWS)}.")
    needed, allowed = LAWS[name]
    if not set(needed) <= given.keys() <= {*needed, *allowed} or not all(map(is_number, given.values())):
        if endless := [v for v in given.values() if isinstance(v, float) and not math.isfinite(v)]:
            raise ValueError(f"{where} holds {endless[0]}, which is no finite number. Give {' and '.join(needed)} as "
                             "finite numbers.")
        if isinstance(raw, list):
            raise ValueError(f"{where} must be a plain value or {_FORMS}, got {raw}.")
        optional = f" and, to cut it off, {' or '.join(allowed)}" if allowed else ""
        raise ValueError(f"{where}: dist = \"{name}\" takes the numbers {' and '.join(needed)}{optional}, got "
                         f"{dict(given)}.")
    if huge := [v for v in given.values() if abs(v) > MOST]:
        raise ValueError(f"{where} holds {huge[0]:g}; numbers of a law are from {-MOST:g} to {MOST:g}.")
    lo, hi = (float(given.get(key, end)) for key, end in (("lo", -math.inf), ("hi", math.inf)))
    if not lo <= hi:
        raise ValueError(f"{where}: the lowest value {lo:g} is above the highest {hi:g}. Give [lowest, highest].")
    if name in ("normal", "lognormal"):
        return _normal(where, name == "lognormal", float(given["mean"]), float(given["sd"]), lo, hi)
    return _between(where, name, lo, hi)


def _between(where: str, name: str, lo: float, hi: float) -> Distribution:
    """Uniform, uniform in the logarithm, or whole numbers with the same odds, both ends included."""
    if name == "uniform":
        return Distribution("chance", lambda u: lo + (hi - lo) * u, (), (lo, hi), f"uniform from {lo:g} to {hi:g}")
    if name == "loguniform":
        if lo <= 0:
            raise ValueError(f"{where}: dist = \"loguniform\" needs lo above 0, got {lo:g}.")
        return Distribution("chance", lambda u: min(max(lo * (hi / lo) ** u, lo), hi), (), (lo, hi),
                            f"uniform in the logarithm from {lo:g} to {hi:g}")
    if lo != int(lo) or hi != int(hi):
        raise ValueError(f"{where}: dist = \"integer\" takes whole numbers lo and hi, got {lo:g} and {hi:g}.")
    first, count = int(lo), int(hi) - int(lo) + 1
    return Distribution("chance", lambda u: first + min(int(u * count), count - 1), (), (lo, hi),
                        f"a whole number from {lo:g} to {hi:g}")


def _normal(where: str, logarithmic: bool, mean: float, sd: float, lo: float, hi: float) -> Distribution:
    """A (log-)normal variable with this mean and standard deviation of the variable itself, before it is cut off."""
    from scipy.special import ndtr, ndtri

    name = "lognormal" if logarithmic else "normal"
    if sd <= 0 or (logarithmic and mean <= 0):
        raise ValueError(f"{where}: dist = \"{name}\" needs sd{' and mean' if logarithmic else ''} above 0, got mean = "
                         f"{mean:g}, sd = {sd:g}.")
    if logarithmic and sd > _MOST_SPREAD * mean:
        raise ValueError(f"{where}: sd = {sd:g} of dist = \"lognormal\" is more than {_MOST_SPREAD:g} times the mean "
                         f"{mean:g}. Make it smaller, or use \"loguniform\".")
    spread = math.sqrt(math.log1p((sd / mean) ** 2)) if logarithmic else sd
    middle = math.log(mean) - spread**2 / 2 if logarithmic else mean
    if logarithmic:
        lo = max(lo, 0.0)

    def probability(end: float) -> float:
        if logarithmic:
            end = math.log(end) if end > 0 else -math.inf
        return float(ndtr((end - middle) / spread))

    below, kept = probability(lo), probability(hi) - probability(lo)
    if kept < _LEAST_KEPT:
        raise ValueError(f"{where}: only {kept:.1e} of dist = \"{name}\" with mean {mean:g} and sd {sd:g} lies from "
                         f"{lo:g} to {hi:g}. Widen lo and hi, or draw uniformly between them.")

    def quantile(u: float) -> float:
        score = middle + spread * float(ndtri(min(max(below + u * kept, _LEAST), 1 - _LEAST)))
        return min(max(math.exp(score) if logarithmic else score, lo), hi)

    cut = f", cut off to {lo:g} ... {hi:g}" if kept < 1 else ""
    return Distribution("chance", quantile, (), (lo, hi), f"{name}, mean {mean:g}, standard deviation {sd:g}{cut}")
