"""Punches of any shape: a file of triangles in place of a profile, and the profile of revolution that is about it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.triangles.solid import Indices, open_nodes, outwards
from eitsim.scene.triangles.triangle_files import read_triangles
from touchcal.arrays import Array
from touchcal.document import is_number
from touchcal.errors import InputFileError

# Thickness of a body, mm, that states none; width of a punch, mm, below which its file is in another unit; height of an
# ellipse over its radius below which a face is flat, and the edge of such a face over its radius.
_THICKNESS_MM, _LEAST_MM, _FLAT, _EDGE = 10.0, 0.3, 0.25, 0.1


def with_shapes(raw: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a scene whose punches name their files of triangles by whole paths, with the diameter, profile and
    fillet that are about such a punch. ValueError names the key, InputFileError the file."""
    touches = raw.get("punch")
    if isinstance(touches, list):
        return {**raw, "punch": [_with_shape(touch, raw, folder) for touch in touches]}
    return {**raw, "punch": _with_shape(touches, raw, folder)} if isinstance(touches, Mapping) else dict(raw)


def _with_shape(touch: Any, raw: Mapping[str, Any], folder: Path) -> Any:
    if not isinstance(touch, Mapping) or "shape" not in touch:
        return touch
    if not isinstance(touch["shape"], str) or not touch["shape"]:
        raise ValueError(f"shape in [punch] must name one file of triangles, got {touch['shape']!r:.80}.")
    path = (folder / touch["shape"]).resolve()
    about = _about(path, _thickness_mm(raw))
    for key, value in about.items():
        if touch.get(key, value) != value:
            raise ValueError(f"{key} in [punch] has no effect with shape, whose file has it; leave it out.")
    return {**touch, "shape": str(path), **about}


def punch_surface(path: Path) -> tuple[Array, Indices]:
    """Nodes (n, 3), m, and triangles (t, 3), outwards, of the closed surface that a file holds in mm; InputFileError
    where it is open, or in another unit."""
    mesh = read_triangles(path)
    used, cells = np.unique(mesh.cells[:, :3], return_inverse=True)
    nodes, cells = mesh.nodes_m[used], cells.reshape(-1, 3)
    if len(rim := open_nodes(cells)):
        x, y, z = 1e3 * nodes[rim[0]]
        raise InputFileError(path, f"a punch is closed, and this surface is open, at ({x:.4g}, {y:.4g}, {z:.4g}) mm. "
                                   "Fill its holes.")
    if (width := 1e3 * float(np.ptp(nodes[:, :2], axis=0).max())) < _LEAST_MM:
        raise InputFileError(path, f"the punch is {width:.3g} mm wide if its lengths are mm. Save it in mm.")
    return nodes, outwards(nodes, cells)


def _about(path: Path, reached_mm: float) -> dict[str, Any]:
    """Diameter, profile and fillet, mm, of a punch of revolution that is about the lowest part of a surface: half an
    ellipse whose mean height over its width is that of the faces that look down, or a flat face."""
    nodes, cells = punch_surface(path)
    corners = nodes[cells]
    for axis, name in enumerate("xy"):
        low, high = 1e3 * nodes[:, axis].min(), 1e3 * nodes[:, axis].max()
        if not low < 0 < high:
            raise InputFileError(path, f"the punch's axis is z through the file's origin, and misses it: {name} goes "
                                       f"from {low:.4g} to {high:.4g} mm. Move it there.")
    height = 1e3 * (nodes[:, 2] - nodes[:, 2].min())
    radius = 1e3 * float(np.hypot(*nodes[height <= max(reached_mm, 1e-3 * np.ptp(height)), :2].T).max())
    seen = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
    middle = height[cells].mean(axis=1)
    down = (seen > 0) & (middle <= reached_mm)
    tall = 3 * float(seen[down] @ middle[down] / seen[down].sum()) / radius
    profile, fillet = ("flat", _EDGE * radius) if tall < _FLAT else ("ellipse", min(tall, 1.0) ** 2 * radius)
    return {"diameter_mm": float(f"{2 * radius:.6g}"), "profile": profile, "fillet_mm": float(f"{fillet:.6g}")}


def _thickness_mm(raw: Mapping[str, Any]) -> float:
    """Thickness of the layer, the largest where it is drawn."""
    found = [table["thickness_mm"] for name in ("body", "skin")
             if isinstance(table := raw.get(name), Mapping) and "thickness_mm" in table]
    numbers = [value for one in found for value in (one if isinstance(one, list) else [one]) if is_number(value)]
    return max(numbers, default=_THICKNESS_MM)
