"""A skin that is a sheet in space: its triangles, electrodes, drive, and touches as prescribed changes of conductance.

A file (TOML) has a form of its own, not that of a scene, since a sheet has no punch.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from numbers import Integral
from pathlib import Path
from typing import Any

from eitsim.scene.drive import MATRICES, Drive, as_tuples, with_matrices
from eitsim.scene.electrodes import FEWEST, MOST
from eitsim.scene.scene import scene_from
from eitsim.scene.triangles.triangle_files import TriangleMesh, read_triangles
from touchcal.document import check_keys, is_number
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml

Point = tuple[float, ...]

_COLUMNS = ("x_mm", "y_mm", "z_mm")
_NARROW_MM = 1.0  # Width of electrodes of which only the number counts.
_KEYS = {"body": ("mesh", "unit_mm"), "skin": ("conductance_S",),
         "electrodes": ("at_mm", "x_mm", "y_mm", "z_mm", "width_mm", "groups", "contact_impedance_Ohm_m2"),
         "drive": ("current_mA", "pattern", "reading", *MATRICES),
         "patch": ("x_mm", "y_mm", "z_mm", "width_mm", "factor")}


@dataclass(frozen=True)
class ConductancePatch:
    """A touch, prescribed: the part of the sheet within a ball, whose conductance is multiplied."""

    centre_m: Point  # (3,) m
    width_m: float  # diameter of the ball, m
    factor: float  # of the sheet conductance


@dataclass(frozen=True, eq=False)
class CurvedSkin:
    """A sheet in space with electrodes on its surface. ValueError where it cannot be."""

    mesh: TriangleMesh
    conductance_S: float  # sheet conductance of the untouched skin, S
    # places (electrodes, 3) that round electrodes are cut out about, m; or the groups of triangles that are electrodes
    places_m: tuple[Point, ...] = ()
    widths_m: float | tuple[float, ...] = 0.01  # diameters of the balls that cut them out, m
    groups: tuple[str | int, ...] = ()
    contact_impedance_Ohm_m2: float | tuple[float, ...] = 1e-2  # Ohm m^2
    drive: Drive = field(default_factory=Drive)
    patches: tuple[ConductancePatch, ...] = ()
    file: Path | None = None  # the file that it was read from

    def __post_init__(self) -> None:
        for name in ("places_m", "widths_m", "groups", "contact_impedance_Ohm_m2", "patches"):
            object.__setattr__(self, name, as_tuples(getattr(self, name)))
        _check(self)

    @property
    def count(self) -> int:
        """How many electrodes."""
        return len(self.places_m) or len(self.groups)


def read_curved_skin(path: Path | str) -> CurvedSkin:
    """Read the file (TOML) of a curved skin; InputFileError names the file and the key.

    Lengths in mm: those of the mesh times `unit_mm`.

    >>> import eitsim
    >>> eitsim.read_curved_skin("examples/scene.toml")
    Traceback (most recent call last):
    touchcal.errors.InputFileError: ...[punch]: a sheet has no layer to press; give a touch as a [[patch]] of ...
    """
    path = Path(path)
    tables = with_matrices(read_toml(path), path.parent)
    try:
        return replace(_skin(tables, path.parent), file=path)
    except InputFileError:
        raise
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def _skin(tables: Mapping[str, Any], folder: Path) -> CurvedSkin:
    for table in ("punch", "hold"):
        if table in tables:
            raise ValueError(f"[{table}]: a sheet has no layer to press; give a touch as a [[patch]] of conductance, "
                             "or surface and thickness_mm in [body], which `eitsim run` solves.")
    check_keys(tables, _KEYS)
    parts = {name: _table(name, tables.get(name, {})) for name in ("body", "skin")}
    body = parts["body"]
    if not isinstance(body.get("mesh"), str):
        raise ValueError("mesh in [body] must name a file of triangles (.stl, .obj, .msh, .vtu ...).")
    unit = positive("unit_mm in [body]", body.get("unit_mm", 1.0)) / 1e3
    electrodes = electrodes_of(tables.get("electrodes", {}))
    patches = tuple(_patch(one) for one in _list("[[patch]]", tables.get("patch", [])))
    sheet = positive("conductance_S in [skin]", parts["skin"].get("conductance_S"))
    drive = drive_of(tables.get("drive", {}), electrodes)
    return CurvedSkin(read_triangles(folder / body["mesh"], unit), sheet, drive=drive, patches=patches, **electrodes)


def electrodes_of(raw: Any) -> dict[str, Any]:
    """Electrodes of a table [electrodes], as fields of `CurvedSkin`; ValueError names the key."""
    table, given = _table("electrodes", raw), {}
    if "groups" in table:
        if other := [key for key in ("at_mm", *_COLUMNS, "width_mm") if key in table]:
            raise ValueError(f"{other[0]} in [electrodes] has no effect with groups; leave it out.")
        given["groups"] = tuple(_list("groups in [electrodes]", table["groups"]))
    else:
        given["places_m"] = _places_m(table)
        given["widths_m"] = _each("width_mm in [electrodes]", table.get("width_mm", 10.0), 1e-3)
    if "contact_impedance_Ohm_m2" in table:
        given["contact_impedance_Ohm_m2"] = _each("contact_impedance_Ohm_m2 in [electrodes]",
                                                  table["contact_impedance_Ohm_m2"], 1.0)
    return given


def _places_m(table: Mapping[str, Any]) -> tuple[Point, ...]:
    """Places, m, by x_mm, y_mm and z_mm, or by at_mm."""
    if "at_mm" in table:
        if other := [key for key in _COLUMNS if key in table]:
            raise ValueError(f"{other[0]} in [electrodes] has no effect with at_mm; leave it out.")
        places = [_numbers("places of at_mm in [electrodes]", place)
                  for place in _list("at_mm in [electrodes]", table["at_mm"])]
        if any(len(place) != 3 for place in places):
            raise ValueError("at_mm in [electrodes] must hold x, y and z of each electrode.")
    elif not any(key in table for key in _COLUMNS):
        raise ValueError("[electrodes] of a skin that is not flat needs at_mm, a list of the places [x, y, z] of its "
                         "electrodes.")
    else:
        columns = [_numbers(f"{key} in [electrodes]", table.get(key)) for key in _COLUMNS]
        if len({len(column) for column in columns}) > 1:
            raise ValueError("x_mm, y_mm and z_mm in [electrodes] must hold one number an electrode each, got "
                             f"{', '.join(str(len(column)) for column in columns)}.")
        places = list(zip(*columns, strict=True))
    return tuple(tuple(part / 1e3 for part in place) for place in places)


def drive_of(raw: Any, electrodes: Mapping[str, Any]) -> Drive:
    """The drive of a table [drive] for so many electrodes; ValueError names the key."""
    count = len(electrodes.get("places_m") or electrodes.get("groups") or ())
    count = min(max(count, FEWEST), MOST)
    return scene_from({"drive": _table("drive", raw), "electrodes": {"count": count, "width_mm": _NARROW_MM}}).drive


def _table(name: str, raw: Any) -> Mapping[str, Any]:
    check_keys(raw, _KEYS[name], name)
    return raw


def _patch(raw: Any) -> ConductancePatch:
    table = _table("patch", raw)
    place = [_numbers(f"{key} in [[patch]]", [table.get(key)])[0] / 1e3 for key in ("x_mm", "y_mm", "z_mm")]
    factor = positive("factor in [[patch]]", table.get("factor"))
    if factor == 1:
        raise ValueError("factor in [[patch]] is 1, which changes nothing; give another one or leave the patch out.")
    return ConductancePatch(tuple(place), positive("width_mm in [[patch]]", table.get("width_mm")) / 1e3, factor)


def _list(where: str, value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{where} must be a list, got {value!r:.80}.")
    return value


def _numbers(where: str, value: Any) -> list[float]:
    if not isinstance(value, list) or not value or not all(is_number(one) for one in value):
        raise ValueError(f"{where} must hold finite numbers, got {value!r:.80}.")
    return [float(one) for one in value]


def positive(where: str, value: Any) -> float:
    if not is_number(value) or not value > 0:
        raise ValueError(f"{where} must be a positive number, got {value!r:.80}.")
    return float(value)


def _each(where: str, value: Any, unit: float) -> float | tuple[float, ...]:
    if isinstance(value, list):
        return tuple(positive(where, one) * unit for one in value)
    return positive(where, value) * unit


def _check(skin: CurvedSkin) -> None:
    if not FEWEST <= skin.count <= MOST:
        raise ValueError(f"[electrodes] must give {FEWEST} to {MOST} electrodes by x_mm, y_mm and z_mm or by groups, "
                         f"got {skin.count}.")
    for key, value in (("width_mm", skin.widths_m), ("contact_impedance_Ohm_m2", skin.contact_impedance_Ohm_m2)):
        if isinstance(value, tuple) and len(value) != skin.count:
            raise ValueError(f"{key} in [electrodes] must hold one number or {skin.count}, got {len(value)}.")
    for group in skin.groups:
        if isinstance(group, bool) or not isinstance(group, (str, Integral)):
            raise ValueError(f"groups in [electrodes] must hold whole numbers or names, got {group!r:.80}.")
