"""A design of scenes: ranges, laws and lists in the tables of a scene file, and the scene of any row."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from eitsim.electrics.forward.gridded_fields import StoredFields, check_on_skin, check_one_grid, fields_from
from eitsim.scene.curved.curved_scene import AnyScene, any_scene, is_curved
from eitsim.scene.drive import with_matrices
from eitsim.scene.scene import Scene, scene_keys
from eitsim.scene.scene_files import with_files
from eitsim.scene.triangles.punch_files import with_shapes
from eitsim.sweeps.design import nested_design
from eitsim.sweeps.design.card_draws import Material, material_from
from eitsim.sweeps.design.outline_places import reached
from eitsim.sweeps.design.sampling import FIXED, row_tables
from eitsim.sweeps.design.variables import Layout, Variable, layout_of
from eitsim.sweeps.measurement.instrument_table import as_table, measurement_from
from touchcal.document import check_keys
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml

SAMPLERS = ("random", *FIXED, nested_design.SAMPLER)
# Those whose count may grow.
GROWING = ("random", nested_design.SAMPLER)
_TOP = ("scenes", "seed", "sampler", "touches", "card", "material", "measurement", "fields")
# Most scenes: of samplers that draw each row for itself, and of those that choose all points at once.
_MOST, _MOST_FIXED = 10**8, 10**6
_TRIED = 100  # Rows that are tried to find one whose scene is right.


@dataclass(frozen=True, eq=False)
class Design:
    """What a sweep draws its scenes from."""

    scenes: int  # number of scenes
    seed: int  # seed of every draw
    sampler: str  # one of SAMPLERS
    # tables of a scene file, a scalar possibly replaced by a range, a choice, a list or a law
    tables: Mapping[str, Any]
    material: Material | None = None  # which cards of the posterior serve the rows; None: the card itself
    # the keys of [measurement], which changes no row: they stay clean, and `measured_set` applies it; empty: none
    measurement: Mapping[str, Any] = field(default_factory=dict)
    fields: StoredFields | None = None  # what is stored of each row's skin, and on which grid; None: nothing
    touches: Any = None  # number of touches of a row, possibly drawn; None: one for each [[punch]]
    # name and sha256 of the table of scenes that it was read from; None where it is drawn
    source: Mapping[str, str] | None = None


def is_design(raw: Mapping[str, Any]) -> bool:
    """Whether tables are those of a design and not of a scene: they say how many rows there are, or hold a list."""
    tables = [table for value in raw.values() for table in (value if isinstance(value, list) else [value])]
    return "scenes" in raw or any(isinstance(drawn, Mapping) and "list" in drawn for table in tables
                                  if isinstance(table, Mapping) for drawn in table.values())


def read_design(path: Path | str, scenes: int | None = None) -> Design:
    """Read a design file; `scenes` overrides its count. InputFileError names the file and the key.

    >>> import eitsim
    >>> eitsim.read_design("examples/design.toml", scenes=20).scenes
    20
    """
    path = Path(path)
    raw = read_toml(path)
    try:
        return design_from(_with_surface(raw, path.parent) if is_curved(raw) else with_files(raw, path.parent), scenes)
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def _with_surface(raw: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a design on a curved body, matrices of [drive] written out and a file of triangles by its whole
    path."""
    tables, surface = with_shapes(with_matrices(raw, folder), folder), str(raw["body"]["surface"])
    whole = str((folder / surface).resolve()) if Path(surface).suffix else surface
    return {**tables, "body": {**tables["body"], "surface": whole}}


def design_from(raw: Mapping[str, Any], scenes: int | None = None) -> Design:
    """A checked design from its tables; ValueError names the key and what it may hold."""
    known = (*_TOP, *scene_keys())
    check_keys(raw, known)
    if is_curved(raw) and "fields" in raw:
        raise ValueError("[fields]: a grid of fields lies on flat skins; leave it out on a curved one.")
    seed, sampler = raw.get("seed", 0), raw.get("sampler", "random")
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ValueError(f"seed must be a whole number from 0, got {seed!r}.")
    if sampler not in SAMPLERS:
        raise ValueError(f"sampler '{sampler}' is unknown; known: {', '.join(SAMPLERS)}.")
    tables, touches = {key: value for key, value in raw.items() if key in scene_keys()}, raw.get("touches")
    layout = layout_of(tables, touches)
    count = _count(scenes if scenes is not None else raw.get("scenes"), layout, sampler)
    material = material_from(raw["material"]) if "material" in raw else None
    if sampler == nested_design.SAMPLER:
        _check_nested(count, material, layout)
    measurement = as_table(measurement_from(raw["measurement"])) if "measurement" in raw else {}
    stored = fields_from(raw["fields"]) if "fields" in raw else None
    if stored is not None and isinstance(raw.get("skin"), Mapping) and "layer" in str(raw["skin"].get("kind")):
        raise ValueError("[fields]: a grid of fields is that of a coating's surface, and a layer conducts in its "
                         "volume; leave it out.")
    design = Design(count, seed, sampler, tables, material, measurement, stored, touches)
    if stored is not None:
        check_one_grid(drawn_keys(design))
    first = representative_scene(design)
    if stored is not None and isinstance(first, Scene):
        check_on_skin(stored, first.body)
    return design


def with_scenes(design: Design, scenes: int) -> Design:
    """The design with another number of scenes; ValueError where its lists, rows or sampler do not allow it."""
    count = _count(scenes, _layout(design), design.sampler)
    if design.sampler == nested_design.SAMPLER:
        _check_nested(count, design.material, _layout(design))
    return replace(design, scenes=count)


def _check_nested(count: int, material: Material | None, layout: Layout) -> None:
    nested_design.check(count, material, any(v.distribution.order != "chance" for v in layout.variables))


def _count(scenes: Any, layout: Layout, sampler: str) -> int:
    """The number of scenes: as asked for, else what lists and rows have."""
    count = scenes if scenes is not None else layout.rows or layout.combinations
    if count is None:
        raise ValueError("scenes is not given, and no list tells how many there are. Add scenes = 200, say.")
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise ValueError(f"scenes must be a positive whole number, got {count!r}.")
    if count > (most := _MOST_FIXED if sampler in FIXED else _MOST):
        raise ValueError(f"scenes = {count}: at most {most:,} are drawn with sampler \"{sampler}\". Ask for fewer.")
    if layout.rows is not None and count > layout.rows:
        raise ValueError(f"scenes = {count}, but {layout.rows} are given row by row. Ask for that many or fewer.")
    return count


def tables_at(design: Design, index: int) -> dict[str, Any]:
    """Tables of the scene of row `index`, as in a scene file, "punch" a list of its touches; ValueError where touches
    find no place."""
    number = nested_design.touch_number(index) if design.sampler == nested_design.SAMPLER else index
    return row_tables(_layout(design), design.sampler, design.scenes, design.seed, number)


def scene_at(design: Design, index: int) -> AnyScene:
    """The scene of row `index`; with "random" and "nested" it depends on (seed, index) only. ValueError where it is
    none."""
    return any_scene(tables_at(design, index))


def valid_scenes(design: Design, most: int) -> Iterator[AnyScene]:
    """The scenes of the first `most` rows, those left out that are none."""
    for index in range(min(design.scenes, most)):
        try:
            yield scene_at(design, index)
        except ValueError:
            continue


def representative_scene(design: Design) -> AnyScene:
    """The first scene of a design that is right; ValueError says what is wrong with row 0 where none of many is."""
    found = next(valid_scenes(design, _TRIED), None)
    return scene_at(design, 0) if found is None else found


def flat_scene(design: Design) -> Scene:
    """The representative scene of a design on a flat skin; ValueError on a curved one."""
    first = representative_scene(design)
    if not isinstance(first, Scene):
        raise ValueError("surface in [body]: this takes flat skins alone; give a set of one.")
    return first


def kept_from_edges(design: Design) -> str:
    """In words, how far from the edges of an outline touches stay whose place and gap are left to chance, and on which
    part of the skin that leaves; empty where none are."""
    scene = next(valid_scenes(design, _TRIED), None)
    if not isinstance(scene, Scene) or not scene.body.has_outline:
        return ""
    left = [(place, punch) for place, punch in zip(_layout(design).places, scene.punches, strict=False)
            if place is not None and place.distribution is None and place.gap_mm is None]
    if not left:
        return ""
    place, punch = left[0]
    gap_mm, share = reached(scene, 1e3 * punch.diameter_m, place.within_mm)
    return (f"places: touches keep {gap_mm:.3g} mm from all edges, which a punch of {1e3 * punch.diameter_m:.3g} mm "
            f"does on {100 * share:.2g} % of the skin; gap_mm of place in [punch] takes them nearer, where a touch is "
            "solved in three dimensions")


def most_touches(design: Design) -> int:
    """The largest number of touches that a row may have."""
    return len(_layout(design).places)


def varied_keys(design: Design) -> tuple[Variable, ...]:
    """What differs between the rows of a design, in a fixed order."""
    return _layout(design).variables


def card_number(design: Design, index: int) -> int:
    """The number by which `materials` chooses the card of row `index`."""
    return nested_design.card_number(index) if design.sampler == nested_design.SAMPLER else index


def drawn_keys(design: Design) -> list[tuple[str, str]]:
    """(table, key) of every key of a scene that is drawn, in a fixed order; of several touches once for each."""
    return [(v.table, key) for v in varied_keys(design) if v.table
            for key in (("x_mm", "y_mm") if v.key == "place" else (v.key,))]


def same_or_grown(old: Any, new: Any) -> bool:
    """Whether tables of a design are those of an older one, but for rows that were added to its end."""
    if not isinstance(old, Mapping) or not isinstance(new, Mapping):
        if isinstance(old, list | tuple) and isinstance(new, list | tuple):
            return len(old) == len(new) and all(map(same_or_grown, old, new))
        return bool(old == new)
    if old.keys() != new.keys():
        return False
    if old.keys() == {"rows"}:
        return list(new["rows"][:len(old["rows"])]) == list(old["rows"])
    return all(same_or_grown(old[key], new[key]) for key in old)


@lru_cache(maxsize=4)
def _layout(design: Design) -> Layout:
    return layout_of(design.tables, design.touches)
