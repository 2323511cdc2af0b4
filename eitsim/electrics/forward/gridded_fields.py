"""Fields on the skin of a sweep's rows, on one grid for all of them: which, where, and their values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eitsim.electrics.forward.sheet_fields import contact_pressure, surface_displacement
from eitsim.scene.results import Array, Touch
from eitsim.scene.scene import Body, Punch, Scene
from eitsim.sheet.sheet_conductance import added_metric, driving_strain, touched_conductance
from matcal.laws.conductivity import Conductivity, conductivity
from touchcal.document import Number, check, check_keys

Touches = tuple[tuple[Punch, Touch], ...]

TABLE = "fields"
# Sizes of a grid unless they are given, and the fewest and most that are taken.
_SIZES = {"square": {"side": 64}, "polar": {"rings": 32, "angles": 64}}
_FEWEST, _MOST = 2, 1024
_POINTS = 256 * 256  # Most points: the rows of a part are in memory together.


@dataclass(frozen=True)
class StoredFields:
    """The table [fields] of a design: fields at points, not averages over pixels."""

    names: tuple[str, ...]  # some of QUANTITIES
    grid: str = "square"  # "square": pixels of the square about the skin, or "polar": rings of the disc
    side: int | None = None  # pixels along a side of a square grid; None: a polar one
    # rings of a polar grid, and points on each; None: a square one
    rings: int | None = None
    angles: int | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Points along y and x of a square grid, rings and angles of a polar one."""
        first, second = (self.side, self.side) if self.grid == "square" else (self.rings, self.angles)
        assert first is not None
        assert second is not None
        return first, second


@dataclass(frozen=True)
class Quantity:
    """One field."""

    dataset: str  # name of its data set, unit in it where it has one
    # unit and meaning
    unit: str
    meaning: str
    # values (n,) or, of a tensor, (n, 3) at points (n, 2), m
    values: Callable[[Array, Touches, Scene, Conductivity], Array]
    parts: int = 1  # numbers at a point


def _strain(points: Array, touches: Touches, scene: Scene, law: Conductivity) -> Array:
    metric, normal = added_metric(points, touches)
    second, first = np.sqrt(np.linalg.eigvalsh(metric)).T
    return driving_strain(scene.skin.strain, first, second, normal)


def _conductivity_change(points: Array, touches: Touches, scene: Scene, law: Conductivity) -> Array:
    return conductivity(law, _strain(points, touches, scene, law)) / law.c0_S_per_m - 1


def _conductance(points: Array, touches: Touches, scene: Scene, law: Conductivity) -> Array:
    sheet = touched_conductance(points, touches, scene.skin, law)
    return np.stack([sheet[:, 0, 0], sheet[:, 1, 1], sheet[:, 0, 1]], axis=-1)


QUANTITIES = {
    "strain": Quantity("driving_strain", "1", "strain that drives the skin, the one of [skin] strain", _strain),
    "conductivity": Quantity("conductivity_change", "1", "c(e)/c(0) - 1 of the coating's conductivity",
                             _conductivity_change),
    "conductance": Quantity("sheet_conductance_S", "S", "xx, yy, xy of the sheet conductance on the untouched surface",
                            _conductance, 3),
    "pressure": Quantity("contact_pressure_kPa", "kPa", "contact pressure on the deformed surface, facet averages; of "
                         "the touch alone where the rim or a neighbour changes it",
                         lambda points, touches, *_: contact_pressure(points, touches) / 1e3),
    "displacement": Quantity("normal_displacement_mm", "mm", "displacement along z, down negative",
                             lambda points, touches, *_: surface_displacement(points, touches)[:, 2] * 1e3)}


def fields_from(raw: Any) -> StoredFields:
    """The checked table [fields]; ValueError names the key and what it may hold."""
    known = tuple(field.name for field in fields(StoredFields))
    check_keys(raw, known, TABLE)
    names = raw.get("names")
    if not isinstance(names, list | tuple) or not names or any(
            not isinstance(name, str) or name not in QUANTITIES for name in names):
        raise ValueError(f"names in [{TABLE}] must be a list of some of {', '.join(QUANTITIES)}, got {names!r}.")
    grid = raw.get("grid", StoredFields.grid)
    if not isinstance(grid, str) or grid not in _SIZES:
        raise ValueError(f"grid in [{TABLE}]: '{grid}' is unknown; known: {', '.join(_SIZES)}.")
    for key, value in raw.items():
        if key in ("names", "grid"):
            continue
        if key not in _SIZES[grid]:
            raise ValueError(f"{key} in [{TABLE}] has no effect with grid = \"{grid}\"; leave it out.")
        check(value, Number(_FEWEST, _MOST, whole=True), f"{key} in [{TABLE}]")
    found = StoredFields(**{**_SIZES[grid], **raw, "names": tuple(name for name in QUANTITIES if name in names)})
    if (points := found.shape[0] * found.shape[1]) > _POINTS:
        raise ValueError(f"the grid in [{TABLE}] has {points} points, at most {_POINTS} are stored. Make it coarser.")
    return found


def check_one_grid(drawn: Sequence[tuple[str, str]]) -> None:
    """ValueError where the disc that the grid lies on is drawn row by row."""
    if ("body", "radius_mm") in drawn:
        raise ValueError(f"radius_mm in [body] is drawn, but [{TABLE}] stores all rows on one grid. Fix it, or leave "
                         f"out [{TABLE}].")


def check_on_skin(stored: StoredFields, body: Body) -> None:
    """ValueError where the grid does not lie on such a skin."""
    if stored.grid not in body.edge.grids:
        raise ValueError(f"grid = \"{stored.grid}\" in [{TABLE}] lies on discs alone; leave it out on a skin with an "
                         "outline.")


def coordinates(stored: StoredFields, body: Body) -> dict[str, Array]:
    """Axes of the grid: y_mm and x_mm of the pixels' middles in the square about the skin, or, of a disc, radius_mm of
    the rings' middles and angle_deg from +x, counter-clockwise."""
    (first, second), (x, y), radius = stored.shape, *_square(body)
    if stored.grid == "polar":
        return {"radius_mm": radius / first * (np.arange(first, dtype=float) + 0.5),
                "angle_deg": 360 / second * np.arange(second, dtype=float)}
    middles = radius * ((2 * np.arange(first, dtype=float) + 1) / first - 1)
    return {"y_mm": y + middles, "x_mm": x + middles}


def _square(body: Body) -> tuple[tuple[float, float], float]:
    """Middle and half the side of the square about the skin, mm."""
    low, high = body.edge.box_m
    x, y = ((low + high) / 2 * 1e3).tolist()
    return (x, y), float((high - low).max()) / 2 * 1e3


def places(stored: StoredFields, body: Body) -> Array:
    """(*shape, 2) x and y of the grid's points, m."""
    first, second = np.meshgrid(*coordinates(stored, body).values(), indexing="ij")
    if stored.grid == "polar":
        turn = np.deg2rad(second)
        return np.stack([first * np.cos(turn), first * np.sin(turn)], axis=-1) / 1e3
    return np.stack([second, first], axis=-1) / 1e3


def inside(stored: StoredFields, body: Body) -> NDArray[np.bool_]:
    """(*shape,) which points of the grid lie on the skin."""
    return body.edge.contains(places(stored, body))


def values(stored: StoredFields, scene: Scene, touches: Sequence[Touch],
           law: Conductivity) -> dict[str, NDArray[np.float32]]:
    """Name -> field (*shape,) or (*shape, parts) of a solved scene, units as QUANTITIES say; NaN outside the skin."""
    pairs = tuple(zip(scene.punches, touches, strict=True))
    there = inside(stored, scene.body)
    points = places(stored, scene.body)[there]
    found = {}
    for name in stored.names:
        out = blank(stored, name)
        out[there] = QUANTITIES[name].values(points, pairs, scene, law)
        found[name] = out
    return found


def blank(stored: StoredFields, name: str) -> NDArray[np.float32]:
    """A field without numbers, as of a scene that was not solved."""
    parts = QUANTITIES[name].parts
    return np.full((*stored.shape, parts) if parts > 1 else stored.shape, np.nan, dtype=np.float32)
