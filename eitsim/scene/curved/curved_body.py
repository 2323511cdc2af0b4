"""A body that is not flat: a layer of one thickness under a curved outer surface, fixed to a rigid core."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.curved.triangulated import cylinder_triangles, quadratic, saddle_triangles, sphere_triangles
from eitsim.scene.scene import Body
from eitsim.scene.surfaces.curved_surface import CurvedSurface
from eitsim.scene.surfaces.cylinder import Cylinder
from eitsim.scene.surfaces.saddle import Saddle
from eitsim.scene.surfaces.sphere import Sphere
from eitsim.scene.surfaces.triangle_surface import triangle_surface
from eitsim.scene.triangles.triangle_files import TriangleMesh, read_triangles
from touchcal.document import is_number
from touchcal.errors import unknown_key

# word in [body] -> keys of its numbers; those in _OPTIONAL may be left out
SURFACES = {"cylinder": ("radius_mm", "length_mm"), "sphere": ("radius_mm",),
            "saddle": ("radius_mm", "radius_2_mm", "length_mm", "width_mm")}
_OPTIONAL = ("width_mm", "unit_mm")
_OF_FILES = ("unit_mm",)
_SIGNED = ("radius_mm", "radius_2_mm")  # of a saddle
# Least and largest of the numbers that give a surface, mm, and the longest side over the lesser radius: a side is cut
# into triangles as short as this asks for.
_LEAST_MM, _MOST_MM, _SLENDER = 1e-3, 1e4, 100


@dataclass(frozen=True, eq=False)
class CurvedBody:
    """A layer under a curved surface, which conducts, on a rigid core."""

    surface: CurvedSurface
    triangles: TriangleMesh  # the outer surface, as far as it conducts
    thickness_m: float  # of the layer, along the inward normal, m
    tables: Mapping[str, Any]  # what [body] of a scene file says of it

    @property
    def flat(self) -> Body:
        """A flat layer of the same thickness, wide enough."""
        return Body(thickness_m=self.thickness_m)

    @property
    def size_m(self) -> float:
        """Square root of the surface's area over pi, m."""
        a, b, c = np.moveaxis(self.triangles.nodes_m[self.triangles.cells[:, :3]], 1, 0)
        return float(np.sqrt(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 / np.pi))


def curved_body(raw: Mapping[str, Any], folder: Path) -> CurvedBody:
    """The body of a table [body] that has `surface`, one and the same for equal tables of one file; ValueError names
    the key."""
    file = folder / str(raw["surface"])
    stamp = file.stat().st_mtime_ns if file.is_file() else 0
    return _kept(json.dumps(raw, sort_keys=True, default=repr), folder, stamp)


@lru_cache(maxsize=8)
def _kept(text: str, folder: Path, stamp: int) -> CurvedBody:
    return _checked(json.loads(text), folder)


def _checked(raw: Mapping[str, Any], folder: Path) -> CurvedBody:
    kind = raw["surface"]
    thickness = _number(raw, "thickness_mm", positive=True) if "thickness_mm" in raw else 1e3 * Body.thickness_m
    if not isinstance(kind, str) or not (kind in SURFACES or Path(kind).suffix):
        raise ValueError(f"surface in [body] must be one of {', '.join(SURFACES)}, or name a file of triangles, got "
                         f"{kind!r:.80}.")
    keys = SURFACES.get(kind, _OF_FILES)
    if unknown := [key for key in raw if key not in ("surface", "thickness_mm", *keys)]:
        raise ValueError(unknown_key(unknown[0], ("surface", "thickness_mm", *keys), "body"))
    if missing := [key for key in keys if key not in raw and key not in _OPTIONAL]:
        raise ValueError(f"{missing[0]} in [body] is missing: surface = \"{kind}\" needs {' and '.join(missing)}.")
    signed = _SIGNED if kind == "saddle" else ()
    sizes = {key: _number(raw, key, positive=key not in signed) / 1e3 for key in keys if key in raw}
    if kind in SURFACES:
        _check_sizes({key: 1e3 * value for key, value in sizes.items()})
    surface, triangles = _made(kind, sizes) if kind in SURFACES else _of_file(folder / kind, sizes.get("unit_mm", 1e-3))
    return CurvedBody(surface, triangles, thickness / 1e3, {**raw, "thickness_mm": thickness})


def _check_sizes(sizes_mm: Mapping[str, float]) -> None:
    """ValueError where a number that gives a surface is a slip of the unit, or a side too long for its triangles."""
    for key, value in sizes_mm.items():
        if not _LEAST_MM <= abs(value) <= _MOST_MM:
            raise ValueError(f"{key} in [body] must be from {_LEAST_MM:g} to {_MOST_MM:g} mm, got {value:g}.")
    radius = min(abs(sizes_mm[key]) for key in _SIGNED if key in sizes_mm)
    for key in ("length_mm", "width_mm"):
        if sizes_mm.get(key, 0.0) > _SLENDER * radius:
            raise ValueError(f"{key} in [body] must be at most {_SLENDER} times the lesser radius, "
                             f"{_SLENDER * radius:g}, got {sizes_mm[key]:g}.")


def _of_file(path: Path, unit_m: float) -> tuple[CurvedSurface, TriangleMesh]:
    mesh = read_triangles(path, unit_m)
    surface = triangle_surface(mesh)
    if mesh.cells.shape[1] == 3:
        mesh = replace(quadratic(surface, surface.nodes_m, surface.cells, mesh.name), groups=mesh.groups)
    return surface, mesh


def _made(kind: str, sizes: Mapping[str, float]) -> tuple[CurvedSurface, TriangleMesh]:
    radius = sizes["radius_mm"]
    if kind == "cylinder":
        cylinder = Cylinder(radius, sizes["length_mm"])
        return cylinder, cylinder_triangles(cylinder, radius, sizes["length_mm"])
    if kind == "sphere":
        sphere = Sphere(radius)
        return sphere, sphere_triangles(sphere, radius)
    saddle, length = Saddle(radius, sizes["radius_2_mm"]), sizes["length_mm"]
    if length > (most := saddle.length_m):
        raise ValueError(f"length_mm in [body] of a saddle must be at most the lesser radius, {1e3 * most:g}, got "
                         f"{1e3 * length:g}.")
    return saddle, saddle_triangles(saddle, saddle.length_m, length, sizes.get("width_mm", length))


def _number(raw: Mapping[str, Any], key: str, *, positive: bool) -> float:
    value = raw[key]
    if not is_number(value) or value == 0 or (positive and value < 0):
        what = "a positive number" if positive else "a number that is not 0"
        raise ValueError(f"{key} in [body] must be {what}, got {value!r:.80}.")
    return float(value)
