"""What a scene file may hold: its keys with their units, limits and words, and what a scene must meet."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from eitsim.scene.channels import Channels, sinks
from eitsim.scene.drive import MATRICES, Drive, protocol
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.outline import Loop, Outline, Point, check_keys
from eitsim.scene.electrodes import Electrodes, unread
from eitsim.scene.polygons import KINDS
from eitsim.scene.profiles.registry import profiles
from eitsim.scene.scene_parts import CONTROLS, FRICTIONS, MODULI, STRAINS, Accuracy, Body, Hold, Punch, Scene, Skin
from touchcal.document import is_number

# Least and largest value by unit, and of keys that differ, in the unit of the key: what is built and measured, with
# room; outside them a value is a slip of the unit.
_OF_UNITS = {"mm": (1e-3, 1e4), "um": (1e-3, 1e4), "N": (0.0, 1e9), "mA": (1e-9, 1e6), "deg": (-3600.0, 3600.0),
             "Ohm_m": (1e-12, 1e9), "Ohm_m2": (1e-12, 1e9), "s": (0.0, 1e12), "uS": (-1e9, 1e9), "S": (1e-12, 1e9)}
_OF_KEYS = {"x_mm": (-1e4, 1e4), "y_mm": (-1e4, 1e4), "depth_mm": (0.0, 1e4), "half_angle_deg": (1.0, 89.0),
            "tilt_deg": (-60.0, 60.0),
            "friction_coefficient": (0.0, 100.0), "signal": (1e-9, 10.0), "positions_mm": (-1e5, 1e5),
            "points_mm": (-1e4, 1e4), "holes_mm": (-1e4, 1e4), "corner_radius_mm": (0.0, 1e4),
            "gains": (-100.0, 100.0), "current_factors": (0.0, 100.0), "sheet_modes": (-10.0, 10.0),
            "size_error": (0.0, 10.0)}
MOST_TOUCHES = 100


@dataclass(frozen=True)
class _BodyKeys:
    """The table [body] of a scene file: of a disc, a rectangle or a polygon; None for what is not written there."""

    radius_m: float | None = None  # of a disc, m; that of `Disc` unless given
    thickness_m: float = Body.thickness_m  # of the foam, m
    outline: str | None = "disc"  # what its edge is
    # sizes of a rectangle along x and y, and the radius that rounds its corners, m
    width_m: float | None = None
    height_m: float | None = None
    corner_radius_m: float | None = None
    points_m: Loop = ()  # corners (n, 2) of a polygon in order, m
    # holes: a circle as its centre and radius (3,), or a polygon as its corners (n, 2), m
    holes_m: tuple[Point | Loop, ...] = ()

    def body(self) -> Body:
        names = ("width_m", "height_m", "corner_radius_m", "points_m", "holes_m")
        sizes = {name: getattr(self, name) for name in names}
        if self.outline not in (None, "disc"):
            if self.radius_m is not None:
                raise ValueError("radius_mm in [body] has no effect with an outline; leave it out.")
            return Body(Outline(self.outline, **sizes), self.thickness_m)
        check_keys("disc", sizes)
        return Body(Disc() if self.radius_m is None else Disc(self.radius_m), self.thickness_m)
# table -> scene-file key -> (field, its units per SI unit); the one place where units of a scene file are converted
KEYS: dict[str, dict[str, tuple[str, float | None]]] = {
    "body": {"radius_mm": ("radius_m", 1e3), "thickness_mm": ("thickness_m", 1e3), "outline": ("outline", None),
             "width_mm": ("width_m", 1e3), "height_mm": ("height_m", 1e3),
             "corner_radius_mm": ("corner_radius_m", 1e3), "points_mm": ("points_m", 1e3),
             "holes_mm": ("holes_m", 1e3)},
    "punch": {"x_mm": ("x_m", 1e3), "y_mm": ("y_m", 1e3), "diameter_mm": ("diameter_m", 1e3),
              "force_N": ("force_N", 1.0), "depth_mm": ("depth_m", 1e3), "profile": ("profile", None),
              "fillet_mm": ("fillet_m", 1e3), "half_angle_deg": ("half_angle_rad", 180 / math.pi),
              "tilt_deg": ("tilt_rad", 180 / math.pi), "tilt_direction_deg": ("tilt_direction_rad", 180 / math.pi),
              "friction": ("friction", None), "friction_coefficient": ("friction_coefficient", 1.0),
              "conductor": ("conductor", None), "contact_impedance_Ohm_m2": ("contact_impedance_Ohm_m2", 1.0)},
    "skin": {"thickness_um": ("thickness_m", 1e6), "strain": ("strain", None)},
    "electrodes": {"kind": ("kind", None), "count": ("count", None), "width_mm": ("width_m", 1e3),
                   "length_mm": ("length_m", 1e3), "first_angle_deg": ("first_angle_rad", 180 / math.pi),
                   "clockwise": ("clockwise", None), "angles_deg": ("angles_rad", 180 / math.pi),
                   "missing": ("missing", None),
                   "contact_impedance_Ohm_m": ("contact_impedance_Ohm_m", 1.0),
                   "contact_impedance_Ohm_m2": ("contact_impedance_Ohm_m2", 1.0),
                   "positions_mm": ("positions_m", 1e3), "shares": ("shares", None), "x_mm": ("x_m", 1e3),
                   "y_mm": ("y_m", 1e3), "shape": ("shape", None), "turn_deg": ("turn_rad", 180 / math.pi),
                   "opening_deg": ("opening_rad", 180 / math.pi), "soft": ("soft", None)},
    "drive": {"current_mA": ("current_A", 1e3), "pattern": ("pattern", None), "reading": ("reading", None),
              **{key: (key, None) for key in MATRICES}},
    "channels": {"gains": ("gains", 1.0), "current_factors": ("current_factors", 1.0), "leaks_uS": ("leaks_S", 1e6),
                 "conductance_S": ("conductance_S", 1.0), "sheet_modes": ("sheet_modes", 1.0),
                 "size_error": ("size_error", 1.0)},
    "hold": {"time_s": ("time_s", None), "control": ("control", None), "loading_s": ("loading_s", 1.0),
             "moduli": ("moduli", None)},
    "accuracy": {"signal": ("signal", 1.0)},
}
# Keys that may hold a list of one number an electrode, and those that always hold a list.
EACH = ("width_mm", "length_mm", "turn_deg", "shape", "contact_impedance_Ohm_m", "contact_impedance_Ohm_m2")
LISTS = {"drive": MATRICES, "electrodes": ("angles_deg", "missing", "positions_mm", "shares", "x_mm", "y_mm"),
          "body": ("points_mm", "holes_mm")}
IN_FILES = {"drive": ("pairs",)}  # keys of files alone, which `with_files` replaces
CLASSES = {"body": _BodyKeys, "punch": Punch, "skin": Skin, "electrodes": Electrodes, "drive": Drive,
            "channels": Channels, "hold": Hold, "accuracy": Accuracy}


def _words() -> dict[tuple[str, str], Collection[str]]:
    """The keys that hold one of a few words."""
    return {("body", "outline"): ("disc", *KINDS), ("punch", "profile"): profiles(), ("punch", "friction"): FRICTIONS,
            ("skin", "strain"): STRAINS, ("hold", "control"): CONTROLS, ("hold", "moduli"): MODULI}


def is_list(table: str, key: str, value: Any) -> bool:
    """Whether a value is a list that a key itself holds, not a range that a design draws one number from."""
    whole = table == "channels" or key in LISTS.get(table, ())
    return isinstance(value, list) and (whole or (table == "electrodes" and key in EACH and len(value) > 2))


def check_value(table: str, key: str, value: Any) -> None:
    """ValueError where `value` is none that a key may hold, whatever the other keys hold."""
    if is_list(table, key, value):
        return
    name, per = KEYS[table][key]
    found = value_of(f"{key} in [{table}]", value, per, getattr(CLASSES[table](), name))
    _check_limits(table, key, found, per)
    if known := _words().get((table, key)):
        one_of(f"{key} in [{table}]", value, known)


def parts_of(scene: Scene, table: str) -> tuple[Any, ...]:
    """What a table of a scene file holds, as objects whose fields its keys name."""
    if table == "body":
        return (_BodyKeys(thickness_m=scene.body.thickness_m, **scene.body.edge.keys),)
    return scene.punches if table == "punch" else (getattr(scene, table),)


def value_of(where: str, value: Any, per: float | None, default: Any) -> Any:
    if isinstance(default, tuple):
        cells = value if isinstance(value, list) else [value]
        return tuple(value_of(where, cell, per or 1.0, () if isinstance(cell, list) else 0.0) for cell in cells)
    if per is not None:
        if not is_number(value):
            raise ValueError(f"{where} must be a finite number, got {value!r}.")
        return float(value) / per
    if type(value) is not type(default):
        raise ValueError(f"{where} must be of the kind of {default!r}, got {value!r}.")
    return value


def check(scene: Scene) -> None:
    body, electrodes = scene.body, scene.electrodes
    for punch in scene.punches:
        _check_punch(punch, body)
    for table, keys in KEYS.items():
        for part in parts_of(scene, table):
            for key, (name, per) in keys.items():
                _check_limits(table, key, getattr(part, name), per)
    for (table, key), words in _words().items():
        for part in parts_of(scene, table) if table != "body" else ():
            one_of(f"{key} in [{table}]", getattr(part, key), words)
    body.edge.check(electrodes)
    _require(all(t > 0 for t in scene.hold.time_s), "time_s in [hold]", "must be positive", scene.hold.time_s)
    _require(scene.hold.loading_s == 0 or bool(scene.hold.time_s), "loading_s in [hold]",
             "has no effect without time_s; give time_s, or leave it out", scene.hold.loading_s)
    _require(scene.hold.moduli != "longterm" or not scene.hold.time_s, "moduli in [hold]",
             "leaves nothing to relax; leave out moduli (a hold begins with the instantaneous ones) or time_s",
             scene.hold.moduli)
    _check_channels(scene)
    if unread(scene.drive, electrodes).all():
        raise ValueError(f"missing in [electrodes]: without {', '.join(map(str, electrodes.missing))} no reading of "
                         "the drive is left; leave some of them, or choose another pattern in [drive].")


def _check_channels(scene: Scene) -> None:
    channels, count = scene.channels, scene.electrodes.count
    for key, (name, _) in KEYS["channels"].items():
        number = {"conductance_S": 1, "size_error": 1, "sheet_modes": len(channels.sheet_modes)}.get(name, count)
        _require(len(getattr(channels, name)) in (0, number), f"{key} in [channels]",
                 f"must hold {number} number{'s, one an electrode' if number > 1 else ''}",
                 len(getattr(channels, name)))
    if channels.there:
        _require(not scene.electrodes.missing, "missing in [electrodes]", "is not built with [channels]; leave out the "
                 "drives and readings that need them", list(scene.electrodes.missing))
        sinks(protocol(scene.drive, count))


def _check_limits(table: str, key: str, value: Any, per: float | None) -> None:
    """ValueError where a value, or one of several, lies outside its key's limits; what has no contact is infinite."""
    unit = next((unit for unit in sorted(_OF_UNITS, key=len, reverse=True) if key.endswith(f"_{unit}")), "")
    least, most = _OF_KEYS.get(key) or _OF_UNITS.get(unit, (-math.inf, math.inf))
    for each in _flat(value):
        if math.isinf(most) or each is None or (unit.startswith("Ohm") and each == math.inf and table == "electrodes"):
            continue
        found = each * (per or 1.0) if is_number(each) else math.nan
        _require(least * (1 - 1e-9) <= found <= most * (1 + 1e-9) or least == found, f"{key} in [{table}]",
                 "must be positive" if found <= 0 < least else
                 f"must be from {least:g} to {most:g} {unit.replace('_', ' ')}".rstrip(),
                 f"{found:g}" if is_number(each) else repr(each))


def _flat(value: Any) -> tuple[Any, ...]:
    """The parts of a value that are no tuples."""
    return tuple(part for each in value for part in _flat(each)) if isinstance(value, tuple) else (value,)


def _check_punch(punch: Punch, body: Body) -> None:
    if punch.force_N is not None and punch.depth_m is not None:
        raise ValueError("[punch] has both force_N and depth_mm; give one of them.")
    if punch.force_N is not None:
        _require(punch.force_N > 0, "force_N in [punch]", "must be positive (N, pressing into the foam)", punch.force_N)
    if punch.depth_m is not None:
        _require(0 < punch.depth_m < body.thickness_m, "depth_mm in [punch]",
                 "must lie between 0 and the foam's thickness", punch.depth_m * 1e3)
    _require(0 < punch.fillet_m <= punch.diameter_m / 2, "fillet_mm in [punch]",
             "(0.5 unless given) must be positive (a sharp edge has no finite peak stress) and at most half of "
             f"diameter_mm = {punch.diameter_m * 1e3:g}", punch.fillet_m * 1e3)
    _require(0 < punch.half_angle_rad < math.pi / 2, "half_angle_deg in [punch]",
             "(from the axis to the face of a cone) must lie between 0 and 90", math.degrees(punch.half_angle_rad))
    if punch.tilt_rad and punch.friction != "none":
        raise ValueError("friction in [punch] is built for upright punches; leave it out where tilt_deg is not 0.")
    if punch.tilt_rad and punch.conductor:
        raise ValueError("conductor in [punch] is built for upright punches; leave it out where tilt_deg is not 0.")
    by_coulomb = punch.friction == "coulomb"
    _require(punch.friction_coefficient > 0 or not by_coulomb, "friction_coefficient in [punch]",
             "must be positive with friction = \"coulomb\"", punch.friction_coefficient)
    _require(punch.friction_coefficient == 0 or by_coulomb, "friction_coefficient in [punch]",
             f"has no effect with friction = \"{punch.friction}\"; leave it out, or ask for \"coulomb\"",
             punch.friction_coefficient)


def _require(ok: bool, where: str, expected: str, value: Any) -> None:
    if not ok:
        raise ValueError(f"{where} {expected}, got {value}.")


def one_of(where: str, value: str, known: Collection[str]) -> None:
    if value not in [*known]:
        raise ValueError(f"{where}: '{value}' is unknown; known: {', '.join(known)}.")
