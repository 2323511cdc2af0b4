"""A scene: the body, its skin and electrodes, the touches, and how well they must be known."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.channels import Channels, sinks
from eitsim.scene.drive import MATRICES, MOST_WEIGHT, Drive, protocol
from eitsim.scene.edges.disc import Disc
from eitsim.scene.edges.edge import Edge
from eitsim.scene.edges.outline import Loop, Outline, Point, check_keys
from eitsim.scene.electrodes import IMPEDANCES, SIDES, Electrodes, unread
from eitsim.scene.electrodes import KINDS as ELECTRODE_KINDS
from eitsim.scene.polygons import KINDS
from eitsim.scene.pressing import (
    CONTROLS,
    FRICTIONS,
    LAYER_STRAINS,
    MODULI,
    SKINS,
    STRAINS,
    Accuracy,
    Hold,
    Punch,
    Skin,
    check_punch,
    check_skin,
)
from eitsim.scene.profiles.profile import Profile
from eitsim.scene.profiles.registry import profiles
from eitsim.scene.scene_files import with_files
from eitsim.scene.scene_limits import check_limits, one_of, plain, require, value_of
from touchcal.arrays import Array
from touchcal.document import is_number
from touchcal.errors import InputFileError, unknown_key
from touchcal.toml_file import read_toml

MOST_TOUCHES = 100


@dataclass(frozen=True)
class Body:
    """Foam of one thickness, bottom fixed, or a layer on a soft base."""

    edge: Edge = field(default_factory=Disc)  # where it ends, and its coating with it
    thickness_m: float = 0.01  # of the foam, or of layer and base together, m
    base_m: float = 0.0  # of that the base's, m; 0: there is none

    @property
    def layer_m(self) -> float:
        """Thickness of what lies on the base, m."""
        return self.thickness_m - self.base_m if self.base_m else self.thickness_m

    @property
    def has_outline(self) -> bool:
        """Whether it is no disc."""
        return not self.edge.is_round

    @property
    def size_m(self) -> float:
        """Square root of its area over pi, m, by which lengths on the skin are measured."""
        return self.edge.size_m

    @property
    def radius_m(self) -> float:
        """Radius of a disc, m; ValueError for another edge."""
        if not isinstance(self.edge, Disc):
            raise ValueError(f"the body has the outline '{self.outline.kind}', and this is for discs.")
        return self.edge.radius_m

    @property
    def outline(self) -> Outline:
        """The outline of a skin that is no disc; ValueError for a disc."""
        if not isinstance(self.edge, Outline):
            raise ValueError("the body is a disc, and has no outline.")
        return self.edge










@dataclass(frozen=True)
class Scene:
    """Everything that one simulation needs but the card."""

    body: Body = field(default_factory=Body)  # the foam
    punches: tuple[Punch, ...] = field(default_factory=lambda: (Punch(),))  # one a touch
    skin: Skin = field(default_factory=Skin)  # the conductive coating
    electrodes: Electrodes = field(default_factory=Electrodes)  # how many, where, and their contacts
    drive: Drive = field(default_factory=Drive)  # which currents flow and what is read
    channels: Channels = field(default_factory=Channels)  # gains, true currents and leaks of the instrument
    hold: Hold = field(default_factory=Hold)  # times at which a touch that is held is read
    accuracy: Accuracy = field(default_factory=Accuracy)  # the requested error
    card: str | None = None  # path of the card that the scene file names; None where it names none

    def __post_init__(self) -> None:
        object.__setattr__(self, "punches", tuple(self.punches))
        for part in (self.body, self.skin, self.electrodes, self.drive, self.hold, self.accuracy):
            plain(part)
        if self.body.base_m not in (0.0, self.skin.base_m):
            raise ValueError(f"base_m of Body is {self.body.base_m:g} m, and that of Skin {self.skin.base_m:g} m. Give "
                             "a soft base in Skin, with its card: base_m and base_card.")
        if self.skin.fills:
            object.__setattr__(self, "body", replace(
                self.body, thickness_m=self.skin.thickness_m + self.skin.base_m, base_m=self.skin.base_m))
        object.__setattr__(self, "electrodes", self.body.edge.placed(self.electrodes))


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
_KEYS: dict[str, dict[str, tuple[str, float | None]]] = {
    "body": {"radius_mm": ("radius_m", 1e3), "thickness_mm": ("thickness_m", 1e3), "outline": ("outline", None),
             "width_mm": ("width_m", 1e3), "height_mm": ("height_m", 1e3),
             "corner_radius_mm": ("corner_radius_m", 1e3), "points_mm": ("points_m", 1e3),
             "holes_mm": ("holes_m", 1e3)},
    "punch": {"x_mm": ("x_m", 1e3), "y_mm": ("y_m", 1e3), "diameter_mm": ("diameter_m", 1e3),
              "force_N": ("force_N", 1.0), "depth_mm": ("depth_m", 1e3), "profile": ("profile", None),
              "fillet_mm": ("fillet_m", 1e3), "half_angle_deg": ("half_angle_rad", 180 / math.pi),
              "tilt_deg": ("tilt_rad", 180 / math.pi), "tilt_direction_deg": ("tilt_direction_rad", 180 / math.pi),
              "shape": ("shape", None), "friction": ("friction", None),
              "friction_coefficient": ("friction_coefficient", 1.0),
              "conductor": ("conductor", None), "contact_impedance_Ohm_m2": ("contact_impedance_Ohm_m2", 1.0)},
    "skin": {"kind": ("kind", None), "thickness_um": ("thickness_m", 1e6), "thickness_mm": ("thickness_m", 1e3),
             "strain": ("strain", None), "along": ("along", 1.0), "across": ("across", 1.0),
             "base_thickness_mm": ("base_m", 1e3), "base_card": ("base_card", None)},
    "electrodes": {"kind": ("kind", None), "count": ("count", None), "width_mm": ("width_m", 1e3),
                   "length_mm": ("length_m", 1e3), "first_angle_deg": ("first_angle_rad", 180 / math.pi),
                   "clockwise": ("clockwise", None), "angles_deg": ("angles_rad", 180 / math.pi),
                   "missing": ("missing", None),
                   "contact_impedance_Ohm_m": ("contact_impedance_Ohm_m", 1.0),
                   "contact_impedance_Ohm_m2": ("contact_impedance_Ohm_m2", 1.0),
                   "positions_mm": ("positions_m", 1e3), "shares": ("shares", None), "x_mm": ("x_m", 1e3),
                   "y_mm": ("y_m", 1e3), "shape": ("shape", None), "turn_deg": ("turn_rad", 180 / math.pi),
                   "opening_deg": ("opening_rad", 180 / math.pi), "soft": ("soft", None), "side": ("side", None),
                   "low_mm": ("low_m", 1e3), "high_mm": ("high_m", 1e3)},
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
_IN_FILES = {"drive": ("pairs",)}  # keys of files alone, which `with_files` replaces
_CLASSES = {"body": _BodyKeys, "punch": Punch, "skin": Skin, "electrodes": Electrodes, "drive": Drive,
            "channels": Channels, "hold": Hold, "accuracy": Accuracy}


def _words() -> dict[tuple[str, str], Collection[str]]:
    """The keys that hold one of a few words."""
    return {("body", "outline"): ("disc", *KINDS), ("punch", "profile"): profiles(), ("punch", "friction"): FRICTIONS,
            ("skin", "kind"): SKINS, ("skin", "strain"): dict.fromkeys((*STRAINS, *LAYER_STRAINS)),
            ("electrodes", "side"): SIDES, ("hold", "control"): CONTROLS, ("hold", "moduli"): MODULI}


def is_list(table: str, key: str, value: Any) -> bool:
    """Whether a value is a list that a key itself holds, not a range that a design draws one number from."""
    whole = table == "channels" or key in LISTS.get(table, ())
    return isinstance(value, list) and (whole or (table == "electrodes" and key in EACH and len(value) > 2))


def check_value(table: str, key: str, value: Any) -> None:
    """ValueError where `value` is none that a key may hold, whatever the other keys hold."""
    if is_list(table, key, value):
        return
    name, per = _KEYS[table][key]
    found = value_of(f"{key} in [{table}]", value, per, getattr(_CLASSES[table](), name))
    check_limits(table, key, found, per)
    if known := _words().get((table, key)):
        one_of(f"{key} in [{table}]", value, known)


def profile_of(punch: Punch, unit_m: float = 1.0) -> Profile:
    """The punch's profile, lengths over a unit; ValueError for a profile that is not known."""
    one_of("profile in [punch]", punch.profile, profiles())
    return profiles()[punch.profile].of(punch.diameter_m / 2 / unit_m, punch.fillet_m / unit_m, punch.half_angle_rad)


def rim_gap_m(body: Body, punch: Punch) -> float:
    """Distance from the punch's edge to the rim, or to the nearest edge or hole of an outline, m; negative where it
    overhangs."""
    return float(from_edge_m(body, np.array([punch.x_m, punch.y_m]))) - punch.diameter_m / 2


def from_edge_m(body: Body, points_m: Array) -> Array:
    """Distance (...) of points (..., 2) to the rim, or to the nearest edge or hole of an outline, m; negative
    outside."""
    return body.edge.gap_m(points_m)


def scene_keys() -> dict[str, tuple[str, ...]]:
    """Table -> keys that a scene file may hold."""
    return {table: tuple(keys) for table, keys in _KEYS.items()}


def scene_tables(scene: Scene) -> dict[str, Any]:
    """The scene as the tables of a scene file, every default that has an effect filled in, units as the keys say."""
    out: dict[str, Any] = {}
    for table, keys in _KEYS.items():
        parts = _parts(scene, table)
        blocks = [{key: _unconverted(getattr(part, name), per) for key, (name, per) in keys.items()
                   if getattr(part, name) is not None} for part in parts]
        out[table] = blocks if table == "punch" else blocks[0]
    out["channels"] = {key: values for key, values in out["channels"].items() if values}
    if not out["channels"]:
        del out["channels"]
    _without_idle(scene, out)
    drive = scene.drive
    for key, instead in (("pattern", drive.currents), ("reading", drive.currents or drive.measurements)):
        if instead is not None:
            del out["drive"][key]
    return out


def _parts(scene: Scene, table: str) -> tuple[Any, ...]:
    """What a table of a scene file holds, as objects whose fields its keys name."""
    if table == "body":
        return (_BodyKeys(thickness_m=scene.body.thickness_m, **scene.body.edge.keys),)
    return scene.punches if table == "punch" else (getattr(scene, table),)


def _without_idle(scene: Scene, tables: dict[str, Any]) -> None:
    """Take out of a scene's tables what outlines alone have, or what they leave without effect, and the lean of upright
    punches."""
    for punch, table in zip(scene.punches, tables["punch"], strict=True):
        if punch.tilt_rad == 0:
            del table["tilt_deg"], table["tilt_direction_deg"]
        if not punch.shape:
            del table["shape"]
    skin, electrodes = tables["skin"], tables["electrodes"]
    del skin["thickness_um" if scene.skin.fills else "thickness_mm"]
    if scene.skin.strain != "piezoresistive":
        del skin["along"], skin["across"]
    if not scene.skin.fills:
        del skin["kind"]
    if not scene.skin.base_m:
        del skin["base_thickness_mm"], skin["base_card"]
    if not scene.skin.fills or scene.electrodes.along_edge:
        del electrodes["side"]
    if not scene.skin.fills or scene.electrodes.over_thickness or not scene.electrodes.along_edge:
        del electrodes["low_mm"], electrodes["high_mm"]
    outlined = not scene.body.edge.is_round
    kept = ("clockwise", *IMPEDANCES, *(() if outlined else ("length_mm",)))
    idle = [key for key in ELECTRODE_KINDS[scene.electrodes.kind].idle if key not in kept]
    empty = {"body": LISTS["body"], "electrodes": ("positions_mm", "shares", "x_mm", "y_mm") + (
        ("angles_deg",) if outlined else ())}
    for table, keys in empty.items():
        for key in (*(idle if table == "electrodes" else ()), *(key for key in keys if tables[table].get(key) == [])):
            tables[table].pop(key, None)


def _unconverted(value: Any, per: float | None) -> Any:
    if isinstance(value, tuple):
        return [_unconverted(part, per) for part in value]
    if per is None:
        return value
    return value if per == 1.0 else float(f"{value * per:.12g}")


def read_scene(path: Path | str) -> Scene:
    """Read a scene file (TOML); InputFileError names the file and the key, ValueError's text inside it.

    >>> import eitsim
    >>> eitsim.read_scene("examples/scene.toml").punches[0].force_N
    1.0
    """
    path = Path(path)
    raw = read_toml(path)
    if "scenes" in raw:
        raise InputFileError(path, "scenes makes it a design, which `eitsim sweep` takes. Give a file of one scene, "
                                   "without ranges.")
    if "readings" in raw:
        raise InputFileError(path, "[readings] makes it a sensor file, which `eitsim sensor` and `eitsim reconstruct` "
                                   "take; in Python eitsim.read_sensor(path).scene is its scene.")
    if isinstance(raw.get("body"), Mapping) and "surface" in raw["body"]:
        raise InputFileError(path, "surface in [body] makes it a scene on a curved body, which `eitsim run` and "
                                   "`eitsim plan` take; here flat skins alone are taken.")
    try:
        return scene_from(with_files(raw, path.parent))
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def as_scene(scene: Scene | Path | str) -> Scene:
    """A scene made in Python, checked, or the one that a file (TOML) holds; errors as those of `read_scene`."""
    if not isinstance(scene, Scene):
        return read_scene(scene)
    if not scene.punches:
        raise ValueError("punches is empty; give one Punch a touch.")
    _check(scene)
    return scene


def scene_from(raw: Mapping[str, Any]) -> Scene:
    """A checked scene from the tables of a scene file, units as their keys say; ValueError names the key."""
    known = (*_KEYS, "card")
    if unknown := [key for key in raw if key not in known]:
        raise ValueError(unknown_key(unknown[0], known))
    parts: dict[str, Any] = {}
    for table in _KEYS:
        if table in raw and table != "punch":
            parts[table] = _electrodes(raw[table]) if table == "electrodes" else _table(table, raw[table])
    if "body" in parts:
        parts["body"] = parts["body"].body()
    touches = raw.get("punch", {})
    touches = touches if isinstance(touches, list) else [touches]
    if len(touches) > MOST_TOUCHES:
        raise ValueError(f"punch holds {len(touches)} touches; at most {MOST_TOUCHES} are solved.")
    if not touches:
        raise ValueError("punch is an empty list; give one [[punch]] a touch, or leave it out for the default one.")
    parts["punches"] = tuple(_table("punch", t) for t in touches)
    if not isinstance(raw.get("card", ""), str):
        raise ValueError(f"card must be the name of a file, got {raw['card']!r:.80}.")
    scene = Scene(**parts, card=raw.get("card"))
    _check_thickness(scene, raw)
    _check(scene)
    return scene


def _table(table: str, raw: Any) -> Any:
    if not isinstance(raw, Mapping):
        raise ValueError(f"[{table}] must be a table of keys, got {raw!r}.")
    keys, values = _KEYS[table], {}
    for key, value in raw.items():
        if key not in keys:
            raise ValueError(unknown_key(key, (*keys, *_IN_FILES.get(table, ())), table))
        name, per = keys[key]
        where = f"{key} in [{table}]"
        values[name] = (_rows(where, value) if table == "drive" and key in MATRICES else
                        value_of(where, value, per, getattr(_CLASSES[table](), name)))
    return _CLASSES[table](**values)




def _rows(where: str, value: Any) -> tuple[Any, ...]:
    if not (isinstance(value, list | tuple) and value and all(isinstance(row, list | tuple) and row for row in value)):
        raise ValueError(f"{where} must hold rows of numbers or, in a file, the name of a CSV file of them, got "
                         f"{value!r:.80}.")
    return tuple(tuple(_rows(where, [cell])[0] if isinstance(cell, list | tuple) else _weight(where, cell)
                       for cell in row) for row in value)


def _weight(where: str, cell: Any) -> float:
    weight = value_of(where, cell, 1.0, 0.0)
    if abs(weight) > MOST_WEIGHT:
        raise ValueError(f"{where} must hold numbers from {-MOST_WEIGHT:g} to {MOST_WEIGHT:g}, got {weight:g}.")
    return weight


def _electrodes(raw: Any) -> Electrodes:
    """Electrodes, with lists of one number an electrode; an infinite contact impedance is a missing electrode."""
    lists = {key: value for key, value in raw.items() if key in EACH and isinstance(value, list)} if isinstance(
        raw, Mapping) else {}
    if isinstance(raw, Mapping) and math.inf in [raw.get(key) for key in IMPEDANCES]:
        raise ValueError("contact impedances in [electrodes] are one finite number or a list of one an electrode, inf "
                         "where it has no contact; or name those electrodes in missing.")
    given = _table("electrodes", {key: value for key, value in raw.items() if key not in lists} if lists else raw)
    values, open_ends = {}, set()
    for key, cells in lists.items():
        name, per = _KEYS["electrodes"][key]
        infinite = [k for k, cell in enumerate(cells) if cell == math.inf and key != "width_mm"]
        open_ends.update(infinite if key == given.impedance_key else [])
        values[name] = tuple(value_of(f"{key} in [electrodes]", 1.0 if k in infinite else cell, per,
                                    Electrodes.shape if per is None else 0.0) for k, cell in enumerate(cells))
    if any(not isinstance(k, int | float) or k % 1 for k in given.missing):
        raise ValueError(f"missing in [electrodes] must hold numbers of electrodes, from 0, got {list(given.missing)}.")
    return replace(given, **values, missing=tuple(sorted(open_ends.union(int(k) for k in given.missing))))


def _check_thickness(scene: Scene, raw: Mapping[str, Any]) -> None:
    """ValueError where a scene's tables give a thickness by the key of another kind of skin, or two of one body."""
    skin, body, fills = raw.get("skin", {}), raw.get("body", {}), scene.skin.fills
    require(scene.skin.kind in SKINS, "kind in [skin]", f"must be one of {', '.join(SKINS)}", f"'{scene.skin.kind}'")
    key, other = ("thickness_mm", "thickness_um") if fills else ("thickness_um", "thickness_mm")
    require(other not in skin, f"{other} in [skin]", f"is not of a {scene.skin.kind}; give {key}", skin.get(other))
    require(not fills or key in skin, "thickness_mm in [skin]", "must be given with kind = \"layer\"", "none")
    whole_mm = 1e3 * scene.body.thickness_m
    require(not fills or math.isclose(body.get(key, whole_mm), whole_mm), "thickness_mm in [body]",
            f"must be left out, or that of layer and base in [skin], {whole_mm:g}: they are the body, on a rigid plate",
            body.get(key))


def _check_layer(scene: Scene) -> None:
    """ValueError where what layers alone have is given of a coating, or electrodes reach outside a layer."""
    check_skin(scene.skin)
    if scene.skin.base_m:
        require(not scene.hold.time_s, "time_s in [hold]",
                "is not built with a soft base, which relaxes by another Prony series than the layer; leave it out",
                list(scene.hold.time_s))
        require(len(scene.punches) == 1, "[[punch]]", "must be one touch with a soft base: how far touches change each "
                "other is measured on one material", f"{len(scene.punches)}")
        require(scene.electrodes.soft, "soft in [electrodes]", "must be true with a soft base: what stiff electrodes "
                "change is measured on one material alone", "false")
    electrodes, thickness_m = scene.electrodes, scene.skin.thickness_m
    if not scene.skin.fills:
        for key, given in (("side", electrodes.side != "top"), ("low_mm", electrodes.low_m),
                           ("high_mm", electrodes.high_m)):
            require(not given, f"{key} in [electrodes]", 'has no effect without kind = "layer" in [skin]; leave it out',
                    getattr(electrodes, key.replace("_mm", "_m")))
        return
    require(electrodes.along_edge or electrodes.low_m == electrodes.high_m == 0, "low_mm and high_mm in [electrodes]",
            'are of kind = "line", on the rim; leave them out', electrodes.low_m)
    require(not electrodes.along_edge or electrodes.side == "top", "side in [electrodes]",
            'has no effect with kind = "line", whose electrodes lie on the rim; leave it out', electrodes.side)
    require(electrodes.over_thickness or electrodes.low_m < electrodes.high_m <= thickness_m * (1 + 1e-9) or
            not electrodes.along_edge, "high_mm in [electrodes]",
            f"must lie above low_mm, up to the layer's thickness, {thickness_m * 1e3:g}", electrodes.high_m * 1e3)
    if any(punch.conductor for punch in scene.punches):
        raise ValueError("conductor in [punch]: what a conducting punch shunts is not built on a layer that conducts "
                         "in its volume, where the current into it depends on the height; leave it out.")


def _check(scene: Scene) -> None:
    body, electrodes = scene.body, scene.electrodes
    _check_layer(scene)
    for punch in scene.punches:
        check_punch(punch, body.thickness_m)
    idle = ("skin", "thickness_um" if scene.skin.fills else "thickness_mm")
    for table, keys in _KEYS.items():
        for part in _parts(scene, table):
            for key, (name, per) in keys.items():
                if (table, key) != idle:
                    check_limits(table, key, getattr(part, name), per)
    for (table, key), words in _words().items():
        for part in _parts(scene, table) if table != "body" else ():
            one_of(f"{key} in [{table}]", getattr(part, key), words)
    body.edge.check(electrodes)
    require(all(is_number(t) and t > 0 for t in scene.hold.time_s), "time_s in [hold]", "must be positive numbers",
            scene.hold.time_s)
    require(scene.hold.loading_s == 0 or bool(scene.hold.time_s), "loading_s in [hold]",
             "has no effect without time_s; give time_s, or leave it out", scene.hold.loading_s)
    require(scene.hold.moduli != "longterm" or not scene.hold.time_s, "moduli in [hold]",
             "leaves nothing to relax; leave out moduli (a hold begins with the instantaneous ones) or time_s",
             scene.hold.moduli)
    _check_channels(scene)
    if unread(scene.drive, electrodes).all():
        raise ValueError(f"missing in [electrodes]: without {', '.join(map(str, electrodes.missing))} no reading of "
                         "the drive is left; leave some of them, or choose another pattern in [drive].")


def _check_channels(scene: Scene) -> None:
    channels, count = scene.channels, scene.electrodes.count
    for key, (name, _) in _KEYS["channels"].items():
        number = {"conductance_S": 1, "size_error": 1, "sheet_modes": len(channels.sheet_modes)}.get(name, count)
        require(len(getattr(channels, name)) in (0, number), f"{key} in [channels]",
                 f"must hold {number} number{'s, one an electrode' if number > 1 else ''}",
                 len(getattr(channels, name)))
    if channels.there:
        require(not scene.electrodes.missing, "missing in [electrodes]", "is not built with [channels]; leave out the "
                 "drives and readings that need them", list(scene.electrodes.missing))
        sinks(protocol(scene.drive, count))










