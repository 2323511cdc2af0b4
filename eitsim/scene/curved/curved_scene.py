"""A scene on a body that is not flat, and its file (TOML), with keys as those of flat scenes where there are such."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from eitsim.scene.channels import Channels
from eitsim.scene.curved.curved_body import CurvedBody, curved_body
from eitsim.scene.curved_skin import CurvedSkin, drive_of, electrodes_of
from eitsim.scene.drive import Drive, with_matrices
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Accuracy, Hold, Punch, Scene, Skin, read_scene, scene_from, scene_tables
from eitsim.scene.scene_limits import require
from eitsim.scene.triangles.punch_files import with_shapes
from touchcal.arrays import Array
from touchcal.document import check_keys, is_number
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml

_TABLES = ("body", "punch", "skin", "electrodes", "drive", "hold", "accuracy", "card")
_ELSEWHERE = {"x_mm": "at_mm = [x, y, z]", "y_mm": "at_mm = [x, y, z]"}


@dataclass(frozen=True, eq=False)
class CurvedScene:
    """Everything that one simulation on a curved body needs but the card."""

    body: CurvedBody
    punches: tuple[Punch, ...]  # one a touch; their x and y are not read
    places_m: Array  # (punches, 3) places near which they are pressed, along the inward normal of the nearest one, m
    # how electrodes lie on the body's triangles: fields of `CurvedSkin`
    electrodes: Mapping[str, Any]
    skin: Skin = field(default_factory=Skin)
    drive: Drive = field(default_factory=Drive)
    hold: Hold = field(default_factory=Hold)
    accuracy: Accuracy = field(default_factory=Accuracy)
    card: str | None = None  # path of the card that the scene file names; None where it names none

    @property
    def channels(self) -> Channels:
        """Those of an instrument without errors."""
        return Channels()

    @property
    def flat(self) -> Scene:
        """The same punches on a flat layer."""
        return Scene(self.body.flat, self.punches, self.skin, hold=self.hold, accuracy=self.accuracy)

    def sheet(self, conductance_S: float) -> CurvedSkin:
        """The untouched skin of a sheet conductance, S."""
        return CurvedSkin(self.body.triangles, conductance_S, drive=self.drive, **self.electrodes)


AnyScene = Scene | CurvedScene


def is_curved(tables: Mapping[str, Any]) -> bool:
    """Whether tables of a scene are of one on a curved body."""
    body = tables.get("body")
    return isinstance(body, Mapping) and "surface" in body


def any_scene(tables: Mapping[str, Any]) -> AnyScene:
    """The scene of tables that need no other file but that of a surface, by its whole path; ValueError names the
    key."""
    return curved_scene(tables, Path()) if is_curved(tables) else scene_from(tables)


def electrode_count(scene: AnyScene) -> int:
    """How many electrodes a scene has."""
    return scene.sheet(1.0).count if isinstance(scene, CurvedScene) else scene.electrodes.count


def read_any_scene(path: Path | str) -> AnyScene:
    """The scene of a file, flat or on a curved body; InputFileError names the file and the key."""
    path = Path(path)
    raw = read_toml(path)
    if not is_curved(raw):
        return read_scene(path)
    try:
        return curved_scene(with_matrices(raw, path.parent), path.parent)
    except InputFileError:
        raise
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def curved_scene(raw: Mapping[str, Any], folder: Path) -> CurvedScene:
    """A checked scene from the tables of its file, file names relative to a folder; ValueError names the key."""
    check_keys(raw, _TABLES)
    raw = with_shapes(raw, folder)
    body = curved_body(raw["body"], folder)
    touches = raw.get("punch", {})
    touches = touches if isinstance(touches, list) else [touches]
    if not touches:
        raise ValueError("punch is an empty list; give one [[punch]] a touch.")
    skin = raw.get("skin")
    require(not (isinstance(skin, Mapping) and skin.get("kind") == "layer"), "kind in [skin]",
            "is not built on curved bodies, whose skin is a sheet in space; leave it out", "layer")
    flat = scene_from({key: raw[key] for key in ("skin", "hold", "accuracy", "card") if key in raw})
    electrodes = _on_surface(electrodes_of(raw.get("electrodes", {})), body)
    places = np.array([_place(table, body) for table in touches])
    punches = tuple(_punch(table, body) for table in touches)
    scene = CurvedScene(body, punches, places, electrodes, flat.skin, drive_of(raw.get("drive", {}), electrodes),
                        flat.hold, flat.accuracy, flat.card)
    _check_apart(scene.sheet(1.0))
    return scene


def _check_apart(sheet: CurvedSkin) -> None:
    """ValueError where round electrodes overlap."""
    places, widths = np.array(sheet.places_m).reshape(-1, 3), np.broadcast_to(np.asarray(sheet.widths_m), sheet.count)
    if not len(places):
        return
    gap = cdist(places, places) - (widths[:, None] + widths) / 2
    i, j = np.argwhere(np.triu(gap <= 0, 1))[0] if np.any(np.triu(gap <= 0, 1)) else (0, 0)
    if i != j:
        raise ValueError(f"electrodes {i} and {j} (from 0) overlap; place them further from each other or make them "
                         "smaller.")


def _on_surface(electrodes: Mapping[str, Any], body: CurvedBody) -> Mapping[str, Any]:
    """Electrodes at the places of the surface nearest to those given."""
    if "places_m" not in electrodes:
        return electrodes
    places = placed(body, np.array(electrodes["places_m"]).reshape(-1, 3), "electrodes")
    return {**electrodes, "places_m": tuple(map(tuple, places.tolist()))}


def placed(body: CurvedBody, points_m: Array, table: str) -> Array:
    """The places (n, 3) of a body that are nearest to points (n, 3), m; ValueError where one is not near."""
    places = body.surface.nearest(points_m)[0]
    away = np.linalg.norm(points_m - places, axis=1)
    if np.any(away > body.thickness_m):
        k = int(np.argmax(away))
        at = ", ".join(f"{part:.4g}" for part in 1e3 * points_m[k])
        raise ValueError(f"at_mm in [{table}]: [{at}] lies {1e3 * away[k]:.3g} mm off the surface; give a place on it, "
                         "or nearer to it than thickness_mm.")
    return places


def _place(table: Any, body: CurvedBody) -> list[float]:
    given = table if isinstance(table, Mapping) else {}
    for key, instead in _ELSEWHERE.items():
        if key in given:
            raise ValueError(f"{key} in [punch] has no effect on a curved body; give {instead}.")
    at = given.get("at_mm")
    if not isinstance(at, list) or len(at) != 3 or not all(is_number(part) for part in at):
        raise ValueError(f"at_mm in [punch] must hold x, y and z of a place near the surface, got {at!r:.80}.")
    point = np.array(at, dtype=float) / 1e3
    placed(body, point[None], "punch")
    return point.tolist()


def _punch(table: Mapping[str, Any], body: CurvedBody) -> Punch:
    (punch,) = scene_from({"punch": {key: value for key, value in table.items() if key != "at_mm"},
                           "body": {"thickness_mm": 1e3 * body.thickness_m}}).punches
    if punch.conductor:
        raise ValueError("conductor in [punch]: conducting punches are not built on curved bodies; leave it out.")
    return punch


def curved_tables(scene: CurvedScene) -> dict[str, Any]:
    """The scene as the tables of its file, defaults filled in."""
    flat = scene_tables(scene.flat)
    tables = {key: flat[key] for key in ("skin", "hold", "accuracy")}
    punches = [{**{key: value for key, value in table.items() if key not in ("x_mm", "y_mm")},
                "at_mm": [float(f"{1e3 * part:.12g}") for part in place]}
               for table, place in zip(flat["punch"], scene.places_m.tolist(), strict=True)]
    drive = scene_tables(Scene(drive=scene.drive, electrodes=Electrodes(count=scene.sheet(1.0).count)))["drive"]
    return {"body": dict(scene.body.tables), "punch": punches, **tables, "electrodes": _electrode_table(scene),
            "drive": drive}


def _electrode_table(scene: CurvedScene) -> dict[str, Any]:
    sheet = scene.sheet(1.0)
    table: dict[str, Any] = {"contact_impedance_Ohm_m2": sheet.contact_impedance_Ohm_m2}
    if sheet.groups:
        return table | {"groups": list(sheet.groups)}
    return table | {"at_mm": [[float(f"{1e3 * part:.12g}") for part in place] for place in sheet.places_m],
                    "width_mm": (1e3 * np.asarray(sheet.widths_m)).tolist()}
