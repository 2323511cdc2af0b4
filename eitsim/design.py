"""A design of scenes: ranges and distributions in the tables of a scene file, and the scene of any row."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.drive_files import with_matrices
from eitsim.scene import Scene, is_list, scene_from, scene_keys
from matcal.errors import TestFileError
from matcal.toml_file import read_toml

SAMPLERS = ("random", "lhs", "sobol")
_TOP = ("scenes", "seed", "sampler", "card", "material", "measurement")
# What decides which readings a row holds, and so cannot vary between rows.
_SENSOR = (("electrodes", "count"), ("drive", "pattern"), ("drive", "reading"))
Quantile = Callable[[float], Any]


@dataclass(frozen=True)
class Design:
    """What a sweep draws its scenes from."""

    # number of scenes
    scenes: int
    # seed of every draw
    seed: int
    # one of SAMPLERS
    sampler: str
    # tables of a scene file, a scalar possibly replaced by a range, a choice or a distribution
    tables: Mapping[str, Any]


def read_design(path: Path | str, scenes: int | None = None) -> Design:
    """Read a design file; `scenes` overrides its count. TestFileError names the file and the key."""
    path = Path(path)
    raw = read_toml(path)
    try:
        return design_from(with_matrices(raw, path.parent), scenes)
    except ValueError as error:
        raise TestFileError(path, str(error)) from None


def design_from(raw: Mapping[str, Any], scenes: int | None = None) -> Design:
    """A checked design from its tables; ValueError names the key and what it may hold."""
    known = (*_TOP, *scene_keys())
    if unknown := [key for key in raw if key not in known]:
        raise ValueError(f"unknown key '{unknown[0]}'; known: {', '.join(known)}.")
    for table in ("material", "measurement"):
        if table in raw:
            raise ValueError(f"[{table}] is not built yet. Remove it; rows are then clean and of the card itself.")
    count = scenes if scenes is not None else raw.get("scenes")
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ValueError(f"scenes must be a positive whole number, got {count!r}.")
    seed, sampler = raw.get("seed", 0), raw.get("sampler", "random")
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ValueError(f"seed must be a whole number from 0, got {seed!r}.")
    if sampler not in SAMPLERS:
        raise ValueError(f"sampler '{sampler}' is unknown; known: {', '.join(SAMPLERS)}.")
    design = Design(count, seed, sampler, {key: value for key, value in raw.items() if key in scene_keys()})
    if varied := [key for key in drawn_keys(design) if key in _SENSOR]:
        raise ValueError(f"{varied[0][1]} in [{varied[0][0]}] is drawn, but the readings of all rows stand in the same "
                         "columns. Fix it, and make one data set for each of its values.")
    if (touches := len(scene_at(design, 0).punches)) > 1:
        raise ValueError(f"{touches} touches are given; a row of a data set holds one. Give one [punch].")
    return design


def scene_at(design: Design, index: int) -> Scene:
    """The scene of row `index`; with "random" it depends on (seed, index) only."""
    return scene_from(_drawn(design, _uniforms(design, index)))


def drawn_keys(design: Design) -> list[tuple[str, str]]:
    """(table, key) of every scalar that is drawn, in a fixed order; of several touches once for each."""
    tables = _completed(design.tables)
    names = {id(part): name for name, value in tables.items()
             for part in (value if isinstance(value, list) else [value])}
    return [(names[id(table)], key) for table, key, _ in _variables(tables)]


def _uniforms(design: Design, index: int) -> NDArray[np.float64]:
    """Numbers of [0, 1), one a free variable of the design, for one row."""
    count = sum(1 for _ in _variables(_completed(design.tables)))
    if design.sampler == "random":
        return np.random.default_rng(np.random.SeedSequence(design.seed, spawn_key=(index,))).random(count)
    return _points(design.sampler, design.scenes, design.seed, count)[index]


def _points(sampler: str, scenes: int, seed: int, count: int) -> NDArray[np.float64]:
    from scipy.stats import qmc

    if sampler == "lhs":
        return qmc.LatinHypercube(count, rng=seed).random(scenes)
    return qmc.Sobol(count, rng=seed).random_base2(math.ceil(math.log2(max(scenes, 2))))[:scenes]


def _completed(tables: Mapping[str, Any]) -> dict[str, Any]:
    """The tables with x and y of every touch present: left out, they are uniform over the disc."""
    out: dict[str, Any] = copy.deepcopy(dict(tables))
    touches = out.get("punch", {})
    out["punch"] = [dict(t) for t in (touches if isinstance(touches, list) else [touches])]
    for touch in out["punch"]:
        if "x_mm" not in touch and "y_mm" not in touch:
            touch["x_mm"], touch["y_mm"] = [0.0, 1.0], [0.0, 1.0]
            touch["uniform_over_disc"] = True
    return out


def _variables(tables: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], str, Quantile]]:
    """(table, key, quantile function) of every scalar that is drawn, in a fixed order."""
    for name in sorted(tables):
        value = tables[name]
        for table in value if isinstance(value, list) else [value]:
            for key in sorted(table):
                if is_list(name, key, table[key]):
                    continue
                if (quantile := _quantile(f"{key} in [{name}]", table[key])) is not None:
                    yield table, key, quantile


def _quantile(where: str, value: Any) -> Quantile | None:
    """The quantile function of a range, a choice or a distribution; None for a plain value."""
    if isinstance(value, list):
        if len(value) != 2 or not all(isinstance(v, int | float) for v in value) or value[0] > value[1]:
            raise ValueError(f"{where} must be a number or a range [lowest, highest], got {value}.")
        lo, hi = map(float, value)
        return lambda u: lo + (hi - lo) * u
    if not isinstance(value, Mapping):
        return None
    if "choice" in value and isinstance(value["choice"], list) and value["choice"]:
        choice = value["choice"]
        return lambda u: choice[min(int(u * len(choice)), len(choice) - 1)]
    if value.get("dist") in ("normal", "lognormal") and {"mean", "sd"} <= value.keys():
        return _normal(float(value["mean"]), float(value["sd"]), value["dist"] == "lognormal")
    raise ValueError(f"{where} must be a number, a range [lowest, highest], {{choice = [...]}} or "
                     f"{{dist = \"normal\"|\"lognormal\", mean = , sd = }}, got {dict(value)}.")


def _normal(mean: float, sd: float, logarithmic: bool) -> Quantile:
    """Quantiles of a (log-)normal variable with this mean and standard deviation of the variable itself."""
    from scipy.special import ndtri

    if not logarithmic:
        return lambda u: mean + sd * float(ndtri(u))
    s = math.sqrt(math.log1p((sd / mean) ** 2))
    return lambda u: mean * math.exp(s * float(ndtri(u)) - s * s / 2)


def _drawn(design: Design, u: NDArray[np.float64]) -> dict[str, Any]:
    tables = _completed(design.tables)
    drawn = [(table, key, quantile(float(p))) for (table, key, quantile), p in zip(_variables(tables), u, strict=True)]
    for table, key, value in drawn:
        table[key] = value
    body = scene_from({"body": tables.get("body", {})}).body
    for touch in tables["punch"]:
        if touch.pop("uniform_over_disc", False):
            _place(touch, body.radius_m * 1e3)
    return tables


def _place(touch: dict[str, Any], radius_mm: float) -> None:
    """Turn two uniform numbers into a place uniform over the part of the disc where the whole punch fits."""
    diameter = touch.get("diameter_mm", scene_from({}).punches[0].diameter_m * 1e3)
    r = (radius_mm - diameter / 2) * math.sqrt(touch["x_mm"])
    angle = 2 * math.pi * touch["y_mm"]
    touch["x_mm"], touch["y_mm"] = r * math.cos(angle), r * math.sin(angle)
